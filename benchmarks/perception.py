"""What seeing costs and how right it is: `python -m benchmarks.perception [--what speed,masks] [--data DIR]`.

DIR holds the published data; else it is `$COGARCH_DATA` or `../shared/data`. Times are medians of processor
time on one core, after a warm-up; nothing here can fail a test. A section is a function that yields rows,
and a line in `SECTIONS`.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks import published_descriptors
from cognitive_arch.domain import domain_names
from cognitive_arch.perception.descriptors import describe
from cognitive_arch.perception.images import read_image, read_mask
from cognitive_arch.perception.labelling import label_blobs
from cognitive_arch.perception.recognition import load_recogniser
from cognitive_arch.perception.segmentation import FOR_PLAIN_IMAGES, MARGINS, make_segmenter, widened
from cognitive_arch.perception.vision import Recogniser, see

ROOT = Path(__file__).resolve().parents[1]
TABLE = (170, 136, 102)
SEED = 0


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    what: str
    measured: str
    budget: str = ""


def six_objects(size: tuple[int, int]) -> NDArray[np.uint8]:
    """A table with six objects of several forms, slightly noisy: (height, width, 3) RGB for `size` (width,
    height) in pixels."""
    width, height = size
    unit = height / 480
    image = np.full((height, width, 3), TABLE, np.uint8)

    def at(x: float, y: float) -> tuple[int, int]:
        return round(x * unit), round(y * unit)

    cv2.circle(image, at(120, 110), round(34 * unit), (230, 40, 30), cv2.FILLED, cv2.LINE_AA)
    cv2.circle(image, at(330, 100), round(40 * unit), (250, 140, 160), cv2.FILLED, cv2.LINE_AA)
    cv2.rectangle(image, at(470, 60), at(550, 140), (250, 225, 50), cv2.FILLED)
    axes = (round(60 * unit), round(28 * unit))
    cv2.ellipse(image, at(150, 330), axes, 30, 0, 360, (40, 90, 210), cv2.FILLED, cv2.LINE_AA)
    rake = [
        at(*p) for p in ((300, 260), (440, 260), (440, 280), (380, 280), (380, 440), (360, 440), (360, 280))
    ]
    cv2.fillPoly(image, [np.array([*rake, at(300, 280)], np.int32)], (60, 110, 40), cv2.LINE_AA)
    t = np.arange(10) * np.pi / 5
    radius = np.where(np.arange(10) % 2, 26, 58)
    star = np.column_stack([530 + radius * np.cos(t), 340 + radius * np.sin(t)]) * unit
    cv2.fillPoly(image, [star.astype(np.int32)], (150, 30, 160), cv2.LINE_AA)
    noise = np.random.default_rng(SEED).normal(0, 2, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def cpu_ms(work: Callable[[], object], repeat: int = 100) -> tuple[float, float]:
    """Median and least milliseconds of processor time of `work`, the first tenth left out.

    Other work on the machine makes even processor time longer; the least is nearest to what it takes alone.
    """
    times = []
    for _ in range(repeat + repeat // 10):
        started = time.process_time()
        work()
        times.append(time.process_time() - started)
    counted = [1e3 * seconds for seconds in times[repeat // 10 :]]
    return statistics.median(counted), min(counted)


def speed(_: Path) -> Iterator[Row]:
    """How long it takes from an image to blobs with descriptors, and of what that consists."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        for size, budget in (((640, 480), 3.0), ((320, 240), 1.0)):
            image = six_objects(size)
            for name in FOR_PLAIN_IMAGES:
                segmenter = make_segmenter(name)
                mask = segmenter.segment(image)
                pieces = [blob.mask for blob in label_blobs(mask).blobs]
                wide = MARGINS[name]
                whole = cpu_ms(lambda s=segmenter, i=image, m=wide: see(i, s, margin=m))  # type: ignore[misc]
                cut = cpu_ms(lambda s=segmenter, i=image: s.segment(i))  # type: ignore[misc]
                label = cpu_ms(lambda m=mask: label_blobs(m))  # type: ignore[misc]
                shape = cpu_ms(lambda p=pieces: [describe(one) for one in p])  # type: ignore[misc]
                told = f"{size[0]}x{size[1]}, {name}, {len(pieces)} blobs: all"
                yield Row(told, _times(whole), f"<= {budget:g} ms" if name == "colour" else "")
                yield Row("  segmentation", _times(cut))
                yield Row("  labelling", _times(label))
                yield Row("  descriptors of wholes and halves", _times(shape))
        yield _video(None, "without names")
        yield _video(load_recogniser("sandwich"), "with names")
    finally:
        cv2.setNumThreads(threads)


def _times(measured: tuple[float, float]) -> str:
    return f"{measured[0]:.2f} ms (least {measured[1]:.2f})"


def _video(recogniser: Recogniser | None, told: str) -> Row:
    """The share of one core that 30 pictures a second take, by processor time."""
    image, segmenter, frames = six_objects((640, 480)), make_segmenter(), 90
    started = time.process_time()
    for _ in range(frames):
        see(image, segmenter, recogniser=recogniser, margin=MARGINS["colour"])
    share = 30 * (time.process_time() - started) / frames
    return Row(f"640x480 at 30 frames a second, of one core, {told}", f"{100 * share:.1f} %", "<= 15 %")


def overlap(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """Intersection over union of two masks, 1 where both are empty."""
    union = np.count_nonzero(one | other)
    return float(np.count_nonzero(one & other) / union) if union else 1.0


def masks(data: Path) -> Iterator[Row]:
    """How far our masks and the published foreground are the same."""
    paths = sorted((data / "affordances" / "images").glob("*_FG.jpg"))
    if not paths:
        yield Row(f"no published pictures in {data}", "-")
        return
    pictures = [(read_image(p.with_name(p.name.replace("_FG", ""))), p) for p in paths]
    pairs = [(i, read_mask(p)) for i, p in pictures]
    for name in FOR_PLAIN_IMAGES:
        for margin in (0, 2):
            segmenter = make_segmenter(name)
            ours = (label_blobs(widened(segmenter.segment(i), margin)).labels > 0 for i, _ in pairs)
            found = [overlap(one, m) for one, (_, m) in zip(ours, pairs, strict=True)]
            usual = " (default)" if margin == MARGINS[name] else ""
            budget = ">= 0.85" if usual else ""
            told = f"mean overlap, {len(pairs)} published masks, {name}, margin {margin}{usual}"
            yield Row(told, f"{statistics.mean(found):.3f}", budget)
            yield Row("  median", f"{statistics.median(found):.3f}")


def shapes(data: Path) -> Iterator[Row]:
    """How near the descriptors of the same objects are to the published ones, by their medians."""
    folder = data / "affordances"
    if not (folder / "images").is_dir():
        yield Row(f"no published descriptors in {data}", "-")
        return
    found = published_descriptors.compare(folder)
    for formulas in dict.fromkeys(row.formulas for row in found):
        rows = [row for row in found if row.formulas == formulas]
        off = statistics.mean(abs(row.ours[0] - row.published[0]) for row in rows)
        within = statistics.mean(row.within for row in rows)
        objects = len({row.thing for row in rows})
        yield Row(f"{formulas}, {objects} objects: mean difference of medians", f"{off:.3f}")
        yield Row("  ours within the published range", f"{within:.0%}")


def recognition(data: Path) -> Iterator[Row]:
    """How well regions are recognised (`benchmarks.recognition`)."""
    from benchmarks import recognition as names

    for domain in domain_names():
        yield from (Row(*row) for row in names.rows(domain, names.VIEWS, names.SEED))


def scenes(data: Path) -> Iterator[Row]:
    """How well the robot knows its table (`benchmarks.sight`)."""
    from benchmarks import sight

    yield from (Row(*row) for row in sight.rows())


SECTIONS: dict[str, Callable[[Path], Iterator[Row]]] = {
    "speed": speed,
    "masks": masks,
    "shapes": shapes,
    "recognition": recognition,
    "scenes": scenes,
}
QUICK = ("speed", "masks", "shapes")  # the others take minutes


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0] if __doc__ else None)
    parser.add_argument("--what", help=f"a comma list of {', '.join(SECTIONS)}")
    parser.add_argument(
        "--data", type=Path, default=Path(os.environ.get("COGARCH_DATA", ROOT.parent / "shared" / "data"))
    )
    parser.add_argument("--quick", action="store_true", help=f"only {', '.join(QUICK)}")
    options = parser.parse_args(arguments)
    names = options.what.split(",") if options.what else list(QUICK if options.quick else SECTIONS)
    for name in names:
        if name not in SECTIONS:
            parser.error(f"unknown section '{name}'; valid: {', '.join(SECTIONS)}")
    print(f"{'what':<66} {'measured':>22}   budget", flush=True)
    for name in names:
        for row in SECTIONS[name](options.data):
            print(f"{row.what:<66} {row.measured:>22}   {row.budget}".rstrip(), flush=True)


if __name__ == "__main__":
    main()
