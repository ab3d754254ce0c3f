"""Prints how quick sweeps are: `python -m benchmarks.sweep`, a part of `make bench`.

Episodes per second of the conditions of Figs. 58 to 61 by one and by two processes, each beginning with
nothing remembered. `--full` runs all 8,000 episodes, as published.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from cognitive_arch.evaluation.published_sweeps import published_config
from cognitive_arch.evaluation.running import run_sweep
from cognitive_arch.evaluation.sweep import SweepConfig
from cognitive_arch.planning.compilation import warm_up
from cognitive_arch.planning.registry import make_planner

QUICK, FULL = 20, 100
BUDGET_S = 180


def four_figures(episodes: int) -> SweepConfig:
    """The four figures as one sweep."""
    return replace(
        published_config("simple", "both", episodes), scenes=("simple", "complex"), vary=("both", "left")
    )


def seconds(config: SweepConfig, jobs: int) -> float:
    """Wall seconds of the whole sweep, starting the processes included."""
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        run_sweep(config, Path(folder) / "sweep", jobs=jobs)
        return time.perf_counter() - started


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="all 8,000 episodes")
    config = four_figures(FULL if parser.parse_args().full else QUICK)
    for planner in config.planners:
        warm_up(make_planner(planner))
    # Two first: what this process remembers would not help it, but what two have compiled is on the disk.
    took = {jobs: seconds(config, jobs) for jobs in (2, 1)}
    print(f"{config.total} episodes of Figs. 58 to 61 (budget: 8000 in {BUDGET_S} s by two processes)")
    for jobs in (1, 2):
        rate = config.total / took[jobs]
        print(f"--jobs {jobs}  {took[jobs]:6.1f} s  {rate:6.1f} episodes/s  8000 in {8000 / rate:5.0f} s")
    print(f"two processes are {took[1] / took[2]:.2f} times as quick as one")


if __name__ == "__main__":
    main()
