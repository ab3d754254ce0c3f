"""Prints what the planners take and find: `python -m benchmarks.planner`, a part of `make bench`.

Times are medians, in CPU seconds of one thread unless said otherwise, on compiled problems; compilation of
kernels is excluded by a first call. libPRADA's figures are published ones: CPU seconds of an A-PRADA call on
tables of the same shape, with the same horizon and number of samples.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.tabletop import GOALS, tabletop
from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.planning.base import ArrayPlanner, PlanResult, PlanStatus
from cognitive_arch.planning.prada import Prada
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.planning.registry import PLANNERS, make_planner
from cognitive_arch.relational.libprada import load_problem, write_problem
from cognitive_arch.relational.symbols import Goal, parse_literal
from cognitive_arch.session import Setting
from cognitive_arch.world.anchoring import WorldModel

HORIZON = 5
SIZES = (3, 6, 10, 15, 20, 30)
PLOT_SIZES = (*SIZES, 45, 60)
LIBPRADA: Mapping[int, float] = {3: 0.074, 6: 0.45, 10: 5.4, 15: 22, 20: 36, 30: 130}
"""Objects -> CPU seconds of an A-PRADA call."""
LIBPRADA_UCT: Mapping[int, float] = {3: 0.9, 6: 22}
LIBPRADA_SETUP = 21.0
"""At 30 objects."""
SETUP_BUDGET = 1.0
BUDGET: Mapping[int, float] = {6: 0.009, 10: 0.029, 20: 0.090, 30: 0.190}
FOUND_BUDGET = ">= 99 of 100, < 200 ms"
"""For the two-layer stack among 20 objects."""

SANDWICH = "make a ham sandwich"
WHOLE_SANDWICH: Goal = (parse_literal("on(Ham,Bun-bottom)"), parse_literal("on(Bun-top,Ham)"))

Row = Callable[[str, str, str], None]
Curves = Mapping[str, Mapping[int, float]]
"""Planner -> objects -> CPU seconds."""


class Effort(NamedTuple):
    """How often things are measured."""

    repeats: int
    plan_seeds: int
    value_seeds: int


FULL = Effort(repeats=30, plan_seeds=100, value_seeds=30)
QUICK = Effort(repeats=3, plan_seeds=10, value_seeds=5)


class Runs(NamedTuple):
    """Calls with seeds 0, 1, ... and the median of their times."""

    seconds: float
    results: Sequence[PlanResult]

    @property
    def found(self) -> int:
        """How many have a plan."""
        return sum(result.status is PlanStatus.PLAN for result in self.results)

    @property
    def value(self) -> float:
        """Mean value."""
        return statistics.fmean(result.value for result in self.results)


def timed(call: Callable[[int], object], repeats: int) -> float:
    """Median CPU seconds of `call(0)`, `call(1)`, ..., after one call that is not counted."""
    call(0)
    times = []
    for seed in range(repeats):
        started = time.process_time()
        call(seed)
        times.append(time.process_time() - started)
    return statistics.median(times)


def runs(name: str, problem: Problem, horizon: int, seeds: int) -> Runs:
    """`seeds` calls of a planner."""
    call = caller(single(name), problem, horizon)
    results: dict[int, PlanResult] = {}

    def kept(seed: int) -> None:
        results[seed] = call(seed)

    return Runs(timed(kept, seeds), list(results.values()))


def caller(planner: ArrayPlanner, problem: Problem, horizon: int) -> Callable[[int], PlanResult]:
    """One call, given its seed."""
    return lambda seed: planner.solve(problem, horizon, np.random.default_rng(seed))


def single(name: str, workers: int = 1) -> ArrayPlanner:
    """A planner by name, with default settings but for the number of threads."""
    planner = make_planner(name)
    assert isinstance(planner, ArrayPlanner)
    return replace(planner, workers=workers) if isinstance(planner, Prada) else planner


def table_problem(n_objects: int, goal: str) -> Problem:
    """A compiled table; three objects have no tools among them, as in the published problem."""
    state, rules, _ = tabletop(n_objects, 0 if n_objects == 3 else 2)
    return compile_problem(state, GOALS[goal], rules)


def scene_problems(name: str) -> tuple[Mapping[str, Problem], Problem]:
    """The sandwich's sub-goals g1, g2, ... in a scene's initial state, and the whole sandwich at once."""
    setting = Setting.load(name)
    env = make_environment("symbolic", setting.domain, setting.scene, setting.rules, noise=NoiseLevels())
    world = WorldModel().update(env.reset(0))
    state, rules = world.atoms(), setting.rules.ground(world.entities)
    goals = setting.understand(SANDWICH).goals
    parts = {f"g{i}": compile_problem(state, goal, rules) for i, goal in enumerate(goals, 1)}
    return parts, compile_problem(state, WHOLE_SANDWICH, rules)


def seconds(value: float) -> str:
    """Readable from microseconds to minutes."""
    return f"{1e3 * value:.3g} ms" if value < 1 else f"{value:.3g} s"


def limits(budget: float | None, published: float | None) -> str:
    """The last column of a time."""
    parts = [] if budget is None else [f"< {seconds(budget)}"]
    if published is not None:
        parts.append(f"libPRADA {seconds(published)}")
    return "; ".join(parts)


def calls(row: Row, effort: Effort, sizes: Sequence[int]) -> Curves:
    """One call on tables of all sizes."""
    curves: dict[str, dict[int, float]] = {}
    for name in ("prada", "a-prada", "guided-prada"):
        curves[name] = {}
        for n in sizes:
            curves[name][n] = runs(name, table_problem(n, "one"), HORIZON, effort.repeats).seconds
            what = f"{name}, N={n}, one on another"
            row(what, seconds(curves[name][n]), limits(BUDGET.get(n), LIBPRADA.get(n)))
    return curves


def search_trees(row: Row, effort: Effort) -> None:
    """The planners that look at single worlds, as far as there are any."""
    for name in ("uct", "sst"):
        if name not in PLANNERS:
            continue
        for n in (3, 6):
            done = runs(name, table_problem(n, "one"), HORIZON, min(effort.repeats, 5))
            published = LIBPRADA_UCT.get(n) if name == "uct" else None
            row(
                f"{name}, N={n}, one on another",
                f"{seconds(done.seconds)}, value {done.value:.2f}",
                limits(None, published),
            )


def setup(row: Row, effort: Effort) -> None:
    """From the rules as they are written to arrays."""
    n, repeats = 30, min(effort.repeats, 5)
    took = timed(lambda _: table_problem(n, "one"), repeats)
    row(f"setup, N={n}: ground and compile", seconds(took), limits(SETUP_BUDGET, LIBPRADA_SETUP))
    with tempfile.TemporaryDirectory() as folder:
        state, rules, _ = tabletop(n)
        write_problem(Path(folder), rules, state, GOALS["one"])
        files = [Path(folder) / f"{part}.dat" for part in ("symbols", "rules", "state", "goal")]

        def read(_: int) -> None:
            problem = load_problem(*files)
            compile_problem(problem.state, problem.goal, problem.rules)

        what = f"setup, N={n}: libPRADA's files read and compiled"
        row(what, seconds(timed(read, repeats)), limits(SETUP_BUDGET, LIBPRADA_SETUP))


def threads(row: Row, effort: Effort) -> None:
    """Wall time; the result is the same.

    Calls take turns, so that whatever else the machine does falls on both; the fastest ones had it least.
    """
    n = 30
    problem = table_problem(n, "one")
    callers = {workers: caller(single("prada", workers), problem, HORIZON) for workers in (1, 2)}
    times: dict[int, list[float]] = {workers: [] for workers in callers}
    for seed in range(2 * effort.repeats):
        for workers, call in callers.items():
            started = time.perf_counter()
            call(seed)
            times[workers].append(time.perf_counter() - started)
    for workers, took in times.items():
        measured = f"{seconds(statistics.median(took))}, best {seconds(min(took))}"
        row(f"prada, N={n}, workers={workers}, wall time", measured, "")


def found(row: Row, effort: Effort) -> None:
    """How often there is a plan where chance rarely finds one."""
    _, sandwich = scene_problems("complex")
    cases = [("complex, whole sandwich", sandwich, h) for h in (7, 10)]
    cases.append(("N=20, stack", table_problem(20, "stack"), HORIZON))
    for what, problem, horizon in cases:
        for name in ("prada", "a-prada", "guided-prada"):
            done = runs(name, problem, horizon, effort.plan_seeds)
            row(
                f"{name}, {what}, h={horizon}",
                f"{done.found} of {effort.plan_seeds}, {seconds(done.seconds)}",
                FOUND_BUDGET if name == "guided-prada" and what.startswith("N=20") else "",
            )


def values(row: Row, effort: Effort) -> None:
    """The quality of plans, by one measure for both: why the guided planner is the default."""
    cases = {
        f"{scene}, {name}": problem
        for scene in ("simple", "complex")
        for name, problem in scene_problems(scene)[0].items()
    }
    cases |= {f"N={n}, stack": table_problem(n, "stack") for n in (6, 10, 20, 30)}
    row(f"mean value, h={HORIZON}, {effort.value_seeds} seeds", "a-prada | guided", "")
    for what, problem in cases.items():
        plain, guided = (
            runs(name, problem, HORIZON, effort.value_seeds) for name in ("a-prada", "guided-prada")
        )
        row(f"  {what}", f"{plain.value:.3f} | {guided.value:.3f}", "")


def plot(curves: Curves, path: Path) -> None:
    """Draw how CPU time grows with the number of objects, beside libPRADA's points."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    figure = Figure(figsize=(9, 5.2), dpi=100, layout="constrained")
    axes = figure.add_subplot()
    axes.set(xscale="log", yscale="log", xlim=(2.7, 125), ylim=(0.001, 300))
    for name, color, below in (("prada", "#4c72b0", True), ("guided-prada", "#c44e52", False)):
        sizes, times = zip(*curves[name].items(), strict=True)
        axes.plot(sizes, times, "-o", color=color, linewidth=2, markersize=5)
        axes.annotate(
            name,
            (sizes[-1], times[-1]),
            xytext=(10, -4 if below else 2),
            textcoords="offset points",
            color=color,
            va="center",
            fontsize=12,
        )
    axes.plot(*zip(*LIBPRADA.items(), strict=True), "D", color="#444444", markersize=6)
    n, took = list(LIBPRADA.items())[-1]
    label = "libPRADA\n(its A-PRADA, as published)"
    axes.annotate(label, (n, took), xytext=(12, 0), textcoords="offset points", color="#444444", va="center")
    axes.xaxis.set_major_locator(FixedLocator(PLOT_SIZES))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:.0f}"))
    axes.yaxis.set_major_locator(FixedLocator([0.001, 0.01, 0.1, 1, 10, 100]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: seconds(y)))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("objects on the table")
    axes.set_ylabel("CPU time of one planning call")
    axes.set_title(
        f"{HORIZON} steps, at most 2000 samples; two hands, everything within reach", loc="left", fontsize=11
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Measure the planners.")
    parser.add_argument("--quick", action="store_true", help="fewer repeats and seeds")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="also draw CPU time against objects (PNG)")
    options = parser.parse_args()
    effort = QUICK if options.quick else FULL

    def row(what: str, measured: str, budget: str) -> None:
        print(f"{what:<52} {measured:>20}   {budget}".rstrip(), flush=True)

    row("what", "measured", "budget; published")
    curves = calls(row, effort, PLOT_SIZES if options.plot else SIZES)
    if options.plot:
        plot(curves, options.plot)
    search_trees(row, effort)
    setup(row, effort)
    threads(row, effort)
    found(row, effort)
    values(row, effort)


if __name__ == "__main__":
    main()
