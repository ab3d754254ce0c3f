"""The heuristics `reliability` against the published four, on the same seeds, and what would be possible.

Cost is attempted actions, and 20 more for an episode in which somebody has to help in the end.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from cognitive_arch.evaluation.bounds import Learner, Task, omniscient_cost, steps_of
from cognitive_arch.evaluation.published_sweeps import EPISODES, Curves, told
from cognitive_arch.evaluation.reproduction import Check, Options, Reproduced
from cognitive_arch.evaluation.results import write_results
from cognitive_arch.evaluation.running import run_sweep
from cognitive_arch.evaluation.summary import RESAMPLES, cost
from cognitive_arch.evaluation.sweep import PUBLISHED, Cell, SweepConfig

OURS = "reliability"
FIGURES = ("simple", "complex")
POINT = ["scene", "vary", "noise"]

TARGETS: Mapping[tuple[str, str, float], str] = {
    ("complex", "left", 0.95): "the best published: success 0.83 at speed 0.68",
    ("complex", "both", 0.5): "success falls below one half",
}
"""Where success and speed must not fall, and what was published there."""

SUCCESS, SPEED = 0.97, 0.70
CHEAPER, DEARER = 0.10, 0.05
"""How much less than the best single set over all points, how much more than the best at any point."""

QUIET = 0.01
"""What a policy may pay more without noise before the bounds call that a price."""


class Bounds(NamedTuple):
    """What no policy can beat: knowing the levels, point by point; and for those that have to find out,
    the least mean over all points, and the least r such that no point costs more than r times the best of
    the four."""

    knowing: list[float]
    mean: float
    ratio: float


def config(episodes: int = EPISODES, seed: int = 0) -> SweepConfig:
    """The conditions of Figs. 58 to 61, all in one."""
    return SweepConfig(
        scenes=FIGURES,
        planners=("a-prada",),
        vary=("both", "left"),
        heuristics=(*PUBLISHED, OURS),
        episodes=episodes,
        seed=seed,
        coin="published",
    )


def reliability(options: Options) -> Reproduced:
    """Run the sweep and compare; see `reproduction.Recompute`."""
    settings = config(options.episodes or EPISODES, options.seed)
    command = f"cogarch reproduce reliability --episodes {settings.episodes} --seed {settings.seed}"
    run_sweep(
        settings,
        options.out,
        f"{command} --out {options.out}",
        jobs=options.jobs,
        on_rows=options.on_progress,
        on_notice=options.on_notice,
    )
    results = write_results(options.out, title="Reliability against the published heuristics")
    costs = results.summary.pivot_table(index=POINT, columns="heuristics", values="cost", sort=False)
    options.on_notice("computing what is possible at best, this takes up to a minute ...")
    bounds = _bounds(settings, costs[list(PUBLISHED)].min(axis=1))
    costs["bound"] = bounds.knowing
    gain = _gain(results.rows, settings.seed)
    numbers = {
        "episodes": settings.episodes,
        "costs": costs.reset_index().to_dict("records"),
        "gain": dict(zip(("mean", "low", "high"), gain, strict=True)),
        "least_mean": bounds.mean,
        "least_ratio": bounds.ratio,
        "points": results.summary.to_dict("records"),
    }
    checks = (
        *_targets(results.summary),
        _mean(costs, bounds, gain),
        _worst(costs, bounds),
        _quiet(results.summary),
    )
    return Reproduced(checks, numbers, results.files)


def _bounds(settings: SweepConfig, best: pd.Series) -> Bounds:
    """The bounds at the points of the sweep; `best` is the cost of the best of the four there.

    Who has to find out knows the scene, and that it is at one of the points of that scene. The policy that
    the bounds are for must meet the other targets, too: success, and no price without noise.
    """
    cells = [cell for cell in settings.cells() if cell.heuristics == OURS]
    quiet_release = settings.coin == "published"
    knowing = [omniscient_cost(cell.scene, cell.levels, quiet_release) for cell in cells]
    mean, ratio = 0.0, 0.0
    for scene in settings.scenes:
        mine = [n for n, cell in enumerate(cells) if cell.scene == scene]
        succeeds = {k: SUCCESS for k, n in enumerate(mine) if _point(cells[n]) in TARGETS}
        free = {k: (1 + QUIET) * knowing[n] for k, n in enumerate(mine) if cells[n].noise == 0}
        steps = steps_of(Task(scene, quiet_release), settings.noise)
        learner = Learner(steps, [cells[n].levels for n in mine])
        mean += learner.least_mean(free, succeeds).least * len(mine) / len(cells)
        ratio = max(ratio, learner.least_ratio([best.iloc[n] for n in mine], succeeds).least)
    return Bounds(knowing, mean, ratio)


def _point(cell: Cell) -> tuple[str, str, float]:
    return cell.scene, cell.vary, cell.noise


def _gain(rows: pd.DataFrame, seed: int) -> tuple[float, float, float]:
    """How much less ours costs than the best single published set, over all points; and a 95 % interval.

    The interval is by bootstrap over episodes, which have the same seed in every cell.
    """
    table = rows.assign(cost=cost(rows)).pivot_table(
        index="episode", columns="heuristics", values="cost", aggfunc="mean"
    )
    best = table[list(PUBLISHED)].mean().idxmin()
    pairs = table[[OURS, best]].to_numpy(float)
    drawn = np.random.default_rng(seed).integers(len(pairs), size=(RESAMPLES, len(pairs)))
    means = pairs[drawn].mean(axis=1)
    low, high = np.quantile(1 - means[:, 0] / means[:, 1], [0.025, 0.975])
    ours, theirs = pairs.mean(axis=0)
    return float(1 - ours / theirs), float(low), float(high)


def _targets(summary: pd.DataFrame) -> list[Check]:
    checks = []
    for (scene, vary, noise), published in TARGETS.items():
        curves = Curves(summary[(summary["scene"] == scene) & (summary["vary"] == vary)])
        success, speed = (curves.of(OURS, what, noise) for what in ("success", "speed"))
        checks.append(
            Check(
                f"{scene} scene, noise {noise:g} ({vary}): success at least 0.97 at speed at least 0.70",
                published,
                f"success {success:.2f}, speed {speed:.2f}",
                success >= SUCCESS and speed >= SPEED,
            )
        )
    return checks


def _mean(costs: pd.DataFrame, bounds: Bounds, gain: tuple[float, float, float]) -> Check:
    four = costs[list(PUBLISHED)].mean()
    possible = 1 - bounds.mean / four.min()
    mean, low, high = (100 * value for value in gain)
    knowing = costs["bound"].mean()
    told_bound = (
        f"who has to find out the levels pays {bounds.mean:.2f} or more, at most {100 * possible:.1f} % below"
    )
    return Check(
        "mean cost over all points at least 10 % below the best single published set",
        f"{told(four.tolist())} for {', '.join(PUBLISHED)}",
        f"{costs[OURS].mean():.2f}, {mean:.1f} % below (95 % interval {low:.1f} to {high:.1f}); "
        f"{told_bound}; who knows them {knowing:.2f}, {100 * (1 - knowing / four.min()):.1f} %",
        gain[0] >= CHEAPER,
        told_bound if possible < CHEAPER and gain[0] >= possible - DEARER else "",
    )


def _worst(costs: pd.DataFrame, bounds: Bounds) -> Check:
    ratio = costs[OURS] / costs[list(PUBLISHED)].min(axis=1)
    worst = ratio.max()
    where = ", ".join(f"{s} {v} {n:g} ({r:.2f})" for (s, v, n), r in ratio[ratio > 1 + DEARER].items())
    least = f"{100 * (bounds.ratio - 1):.0f} %"
    return Check(
        "at no point more than 5 % above the best of the four (which is another one at each point)",
        f"who has to find out the levels and meets the targets for success pays {least} more somewhere",
        f"at most {100 * (worst - 1):.0f} % above; above 5 %: {where or 'nowhere'}",
        worst <= 1 + DEARER,
        f"nobody stays below {least}; ours is {100 * (worst / bounds.ratio - 1):.0f} % above that"
        if bounds.ratio > 1 + DEARER and worst <= (1 + DEARER) * bounds.ratio
        else "",
    )


def _quiet(summary: pd.DataFrame) -> Check:
    """The same cost as the best of the four, or a difference that chance explains."""
    quiet = summary[summary["noise"] == 0].set_index([*POINT, "heuristics"])
    points = list(dict.fromkeys((s, v, n) for s, v, n, _ in quiet.index))
    best = [min(float(quiet.loc[(*point, name), "cost"]) for name in PUBLISHED) for point in points]
    ours, low = (
        [float(quiet.loc[(*point, OURS), what]) for point in points] for what in ("cost", "cost_low")
    )
    return Check(
        "at noise 0 it costs nothing",
        told(best),
        told(ours),
        all(a <= b + 1e-9 for a, b in zip(low, best, strict=True)),
    )
