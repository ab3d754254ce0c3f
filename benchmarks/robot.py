"""How reliably the robot does things in Drake: `python -m benchmarks.robot [--what grasp,pull] [--jobs 2]`.

One row for each skill and hand, for whole tasks, and for the named scenarios, each over jittered seeds. The
whole table takes about an hour on two cores; `--seeds 4` gives an idea of it. Nothing here can fail a test.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import time
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import partial

from sim.trials import TRIALS, Trial


def timed(what: str, hand: str, jitter: float, seed: int) -> tuple[Trial, float]:
    """One trial and the CPU seconds it took."""
    started = time.process_time()
    trial = TRIALS[what].run(hand, seed, jitter)
    return trial, time.process_time() - started


def row(what: str, hand: str, seeds: int | None, jitter: float | None, pool: Executor) -> None:
    """Run one row of the table and print it, with what the failed trials said."""
    kind = TRIALS[what]
    n, amount = seeds or kind.seeds, kind.jitter if jitter is None else jitter
    results = list(pool.map(partial(timed, what, hand, amount), range(n)))
    good = sum(trial.ok for trial, _ in results)
    spent = [cpu for _, cpu in results]
    measured = [trial.measured for trial, _ in results if trial.measured is not None]
    size = f"{statistics.mean(measured):6.1f} {kind.unit}" if measured else ""
    print(
        f"{what:<14} {hand:<6} {good:>3} of {n:<3} {kind.wanted:<12} {statistics.mean(spent):>6.1f}"
        f" {max(spent):>6.1f}   {size}",
        flush=True,
    )
    for seed, (trial, _) in enumerate(results):
        if not trial.ok:
            print(f"    seed {seed}: {', '.join(trial.said)}", flush=True)


def positive(text: str) -> int:
    """A whole number from 1."""
    number = int(text)
    if number < 1:
        raise ValueError(f"{number} is not positive")
    return number


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0] if __doc__ else None)
    parser.add_argument("--what", help=f"a comma list of {', '.join(TRIALS)}")
    parser.add_argument("--hand", choices=["left", "right", "both"], default="both")
    parser.add_argument("--seeds", type=positive, help="trials per row; else as the row wants")
    parser.add_argument("--jitter", type=float, help="metres; else as the row wants")
    parser.add_argument("--jobs", type=positive, default=1)
    options = parser.parse_args(arguments)
    names = options.what.split(",") if options.what else list(TRIALS)
    for name in names:
        if name not in TRIALS:
            parser.error(f"unknown trial '{name}'; valid: {', '.join(TRIALS)}")
    print(
        f"{'what':<14} {'hand':<6} {'done':<9} {'wanted':<12} {'CPU s':>6} {'most':>6}   measured", flush=True
    )
    # Fresh processes: forked ones would share the state of Drake and numba.
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.jobs, mp_context=fresh) as pool:
        for name in names:
            for hand in TRIALS[name].hands:
                if hand not in ("left", "right") or options.hand in (hand, "both"):
                    row(name, hand, options.seeds, options.jitter, pool)


if __name__ == "__main__":
    main()
