"""Our shape descriptors beside the published ones: `python -m benchmarks.published_descriptors [FOLDER]`.

FOLDER holds the published affordance data; else it is `affordances` in `$COGARCH_DATA` or `../shared/data`.
The published rows do not say of which picture they are, and none of the pictures there fits one: so what can
be compared is the laws within a row, and how the numbers of an object are distributed over many views.
"""

from __future__ import annotations

import argparse
import csv
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.perception.descriptors import AREA_UNIT, BLOB, SHAPE, describe

ROOT = Path(__file__).resolve().parents[1]
FOREGROUND = 12  # grey levels; what is brighter in a published foreground picture
RAGGED = 5  # pixels; side of the median filter that takes off the fringe which JPEG left
RATIOS = ("convexity", "eccentricity", "compactness", "circularity", "squareness")
Columns = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Comparison:
    """One descriptor of one object: medians and 10th to 90th percentiles over the published rows and over
    ours, and the share of ours that lies between the least and the greatest published one."""

    formulas: str
    thing: str
    descriptor: str
    published: tuple[float, float, float]
    ours: tuple[float, float, float]
    within: float
    rows: tuple[int, int]


def folder() -> Path:
    """Where the published affordance data are, or would be."""
    return Path(os.environ.get("COGARCH_DATA", ROOT.parent / "shared" / "data")) / "affordances"


def blob_rows(data: Path) -> dict[str, Columns]:
    """The rows of 2014-16 (blobDescriptor formulas), 14 things: by thing and column, (n,) each."""
    header = (data / "icub_tools_descriptors_header.txt").read_text().split()
    rows = [line.split() for line in (data / "icub_tools_descriptors.txt").read_text().splitlines()]
    return _by_thing([row[1] for row in rows], header[2:], [row[2:] for row in rows])


def shape_rows(data: Path) -> dict[str, Columns]:
    """The rows of 2017 (shapeDescriptor formulas), hands and objects: by thing and column, (n,) each."""
    with (data / "hand_and_object_descriptors.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    return _by_thing([row[0] for row in rows], header[1:], [row[1:] for row in rows])


def _by_thing(names: list[str], header: list[str], rows: list[list[str]]) -> dict[str, Columns]:
    table = np.array([[float(value) for value in row] for row in rows])
    things = np.array(names)
    return {
        thing: {column: table[things == thing, n] for n, column in enumerate(header)}
        for thing in sorted(set(names))
    }


def masks(data: Path) -> Iterator[tuple[str, NDArray[np.uint8]]]:
    """(thing, mask) of each published foreground picture, its fringe taken off."""
    for path in sorted((data / "images").glob("*_FG.jpg")):
        picture = cv2.imread(str(path))
        if picture is not None:
            mask = (picture.max(axis=2) > FOREGROUND).astype(np.uint8)
            yield path.name.split("_")[1], np.asarray(cv2.medianBlur(mask, RAGGED), np.uint8)


def law_errors(data: Path) -> dict[str, float]:
    """How far published rows are off from laws that our formulas keep (0: not at all)."""
    worst = {"squareness": 0.0, "eccentricity": 0.0, "compactness": 0.0, "roundest": 0.0}
    for columns in blob_rows(data).values():
        width, height = columns["objDesc.roi_width"], columns["objDesc.roi_height"]
        area = columns["objDesc.area"] * AREA_UNIT
        errors = {
            "squareness": np.abs(area / (width * height) - columns["objDesc.squareness"]),
            "eccentricity": np.abs(
                np.minimum(width, height) / np.maximum(width, height) - columns["objDesc.eccentricity"]
            ),
            "compactness": np.maximum(columns["objDesc.compactness"] - 1 / (4 * np.pi), 0),
        }
        worst.update({law: max(worst[law], float(error.max())) for law, error in errors.items()})
    for columns in shape_rows(data).values():
        # No area is spread less than a disc's: nu20 + nu02 >= 1 / (2 pi).
        missing = 1 / (2 * np.pi) - columns["nu20"] - columns["nu02"]
        worst["roundest"] = max(worst["roundest"], float(missing.max()), 0.0)
    return worst


def compare(data: Path) -> list[Comparison]:
    """All things of which there are both published rows and pictures, with the formulas of either program."""
    pictures = list(masks(data))
    found = []
    for formulas, published in ((BLOB, blob_rows(data)), (SHAPE, shape_rows(data))):
        for thing in sorted(set(published) & {name for name, _ in pictures}):
            seen = [describe(mask, formulas).whole for name, mask in pictures if name == thing]
            for descriptor in RATIOS:
                theirs = published[thing][_column(formulas, descriptor)]
                ours = np.array([whole[descriptor] for whole in seen])
                found.append(
                    Comparison(
                        formulas,
                        thing,
                        descriptor,
                        _spread(theirs),
                        _spread(ours),
                        float(np.mean((ours >= theirs.min()) & (ours <= theirs.max()))),
                        (len(theirs), len(ours)),
                    )
                )
    return found


def _column(formulas: str, descriptor: str) -> str:
    if formulas == SHAPE:
        return descriptor
    return "objDesc." + {"circularity": "circleness"}.get(descriptor, descriptor)


def _spread(values: NDArray[np.float64]) -> tuple[float, float, float]:
    low, middle, high = (float(v) for v in np.percentile(values, (10, 50, 90)))
    return middle, low, high


def report(data: Path) -> None:
    """Print both comparisons."""
    print("Laws within the published rows, largest deviation")
    for law, error in law_errors(data).items():
        print(f"  {law:<14} {error:.1e}")
    print("\nDescriptors per object: median (10th to 90th percentile)")
    print(f"{'formulas':<16}{'object':<8}{'descriptor':<14}{'published':<24}{'ours':<24}within  rows")
    for row in compare(data):
        cells = [f"{m:.3f} ({low:.3f} to {high:.3f})" for m, low, high in (row.published, row.ours)]
        print(
            f"{row.formulas:<16}{row.thing:<8}{row.descriptor:<14}{cells[0]:<24}{cells[1]:<24}"
            f"{row.within:5.0%}   {row.rows[0]}, {row.rows[1]}"
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0] if __doc__ else None)
    parser.add_argument("folder", nargs="?", type=Path, default=folder())
    data = parser.parse_args(arguments).folder
    if not (data / "images").is_dir():
        parser.exit(2, f"no published affordance data in {data}; COGARCH_DATA names the folder above it\n")
    report(data)


if __name__ == "__main__":
    main()
