"""How well, and how quickly, regions are recognised: `python -m benchmarks.recognition [--views N]`.

The views are others than those that `cogarch learn objects` learns from and tests with; the strangers are of
kinds and hues that are never learnt.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from cognitive_arch.domain import domain_names, load_domain
from cognitive_arch.evaluation.recognition import score
from cognitive_arch.perception.recognition import ObjectRecogniser, load_recogniser, recogniser_path
from sim.views import examples

VIEWS, SEED = 200, 2024
GOALS = {"known_right": 0.99, "unknown_right": 0.90}


def timed(measure: Callable[[], object], repeat: int) -> float:
    """Median CPU seconds of this thread."""
    times = []
    for _ in range(repeat):
        started = time.thread_time()
        measure()
        times.append(time.thread_time() - started)
    return float(np.median(times))


def rows(domain_name: str, views: int, seed: int) -> list[tuple[str, str, str]]:
    """What was measured of a domain: what, how much, and the goal where there is one."""
    load_recogniser.cache_clear()
    recogniser = load_recogniser(domain_name)
    shown = list(examples(load_domain(domain_name), views, np.random.default_rng(seed), test=True))
    scores = score(recogniser, shown)
    told = []
    for who in ("known", "unknown"):
        for part, words in (("", "80 % of it in view"), ("_half_hidden", "half of it in view")):
            right, count = scores[f"{who}_right{part}"], scores[f"{who}_examples{part}"]
            goal = f"{GOALS[f'{who}_right']:.0%}" if not part else ""
            told.append((f"{domain_name}: {who} right, {words} (n={count})", f"{right:.1%}", goal))
    # In a whole picture, as it comes from the eyes.
    times = []
    for example in shown[:100]:
        height, width = example.mask.shape
        image, mask = np.zeros((480, 640, 3), np.uint8), np.zeros((480, 640), bool)
        image[:height, :width], mask[:height, :width] = example.image, example.mask
        times.append(timed(lambda image=image, mask=mask: recogniser.classify(image, mask), 9))
    told.append((f"{domain_name}: one region, median", f"{1e3 * np.median(times):.2f} ms", "0.3 ms"))
    told.append(
        (f"{domain_name}: one region, 95th percentile", f"{1e3 * np.quantile(times, 0.95):.2f} ms", "")
    )
    loading = timed(lambda: ObjectRecogniser.load(recogniser_path(domain_name)), 5)
    told.append((f"{domain_name}: load", f"{1e3 * loading:.0f} ms", "100 ms"))
    return told


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=VIEWS)
    parser.add_argument("--seed", type=int, default=SEED)
    options = parser.parse_args()
    for name in domain_names():
        for what, measured, goal in rows(name, options.views, options.seed):
            print(f"{what:62} {measured:>9}  {goal}")


if __name__ == "__main__":
    main()
