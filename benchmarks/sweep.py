"""Prints how quick sweeps are: `python -m benchmarks.sweep`, a part of `make bench`.

Episodes per second of the conditions of Figs. 58 to 61 by one and by two processes, each beginning with
nothing remembered. `--full` runs all 8,000 episodes, as published. On a machine that has other work, CPU
seconds tell more than the clock: what two processes take together, beside what one takes.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import tempfile
import time
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

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


class Took(NamedTuple):
    """Seconds by the clock, and of all processes on the CPU."""

    wall: float
    cpu: float


def sweep(config: SweepConfig, jobs: int, took: Connection) -> None:
    """The whole sweep, into a folder that is thrown away; sends seconds by the clock."""
    from joblib.externals.loky import get_reusable_executor

    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        run_sweep(config, Path(folder) / "sweep", jobs=jobs)
        took.send(time.perf_counter() - started)
    if jobs > 1:
        get_reusable_executor().shutdown(wait=True)  # else it waits for more work for minutes


def measure(config: SweepConfig, jobs: int) -> Took:
    """What it takes from nothing, starting the processes included; their CPU is known once they ended."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe(duplex=False)
    process = spawn.Process(target=sweep, args=(config, jobs, there))
    process.start()
    there.close()
    wall = here.recv()
    process.join()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return Took(wall, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--full", action="store_true", help="all 8,000 episodes")
    config = four_figures(FULL if parser.parse_args().full else QUICK)
    for planner in config.planners:
        warm_up(make_planner(planner))  # what is compiled is on the disk from now on
    took = {jobs: measure(config, jobs) for jobs in (1, 2)}
    print(f"{config.total} episodes of Figs. 58 to 61 (budget: 8000 in {BUDGET_S} s by two processes)")
    for jobs, (wall, cpu) in took.items():
        rate = config.total / wall
        print(
            f"--jobs {jobs}  {wall:6.1f} s  {rate:6.1f} episodes/s  8000 in {8000 / rate:5.0f} s"
            f"  {cpu:6.1f} s on the CPU"
        )
    print(
        f"two processes are {took[1].wall / took[2].wall:.2f} times as quick as one; "
        f"on two cores of their own at most {2 * took[1].cpu / took[2].cpu:.2f} times"
    )


if __name__ == "__main__":
    main()
