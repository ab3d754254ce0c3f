"""The heuristics `reliability` against the published four, on the same seeds, and what would be possible.

Cost is attempted actions, and 20 more for an episode in which somebody has to help in the end.
"""

from __future__ import annotations

import math

import pandas as pd

from cognitive_arch.evaluation.bounds import Regret, least_regret, omniscient_cost
from cognitive_arch.evaluation.published_sweeps import EPISODES, Curves, told
from cognitive_arch.evaluation.reproduction import Check, Options, Reproduced
from cognitive_arch.evaluation.results import write_results
from cognitive_arch.evaluation.running import run_sweep
from cognitive_arch.evaluation.sweep import PUBLISHED, SweepConfig

OURS = "reliability"
FIGURES = ("simple", "complex")
POINT = ["scene", "vary", "noise"]
WORST_POINT, EQUAL_POINT = 0.95, 0.5


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
    costs["bound"] = _bounds(settings)
    regret = _regret(costs)
    numbers = {
        "episodes": settings.episodes,
        "costs": costs.reset_index().to_dict("records"),
        "least_regret": regret.ratio,
        "points": results.summary.to_dict("records"),
    }
    checks = (*_targets(results.summary), *_costs(costs, regret))
    return Reproduced(checks, numbers, results.files)


def _bounds(settings: SweepConfig) -> list[float]:
    """What a policy that knows the levels would cost, point by point."""
    cells = [cell for cell in settings.cells() if cell.heuristics == OURS]
    return [omniscient_cost(cell.scene, cell.levels, settings.coin == "published") for cell in cells]


def _regret(costs: pd.DataFrame) -> Regret:
    """How close to the best of the four any policy can stay that has to find out how noisy the arms are."""
    points = costs.loc[("simple", "both")]
    return least_regret(points.index.tolist(), points[list(PUBLISHED)].min(axis=1).tolist())


def _targets(summary: pd.DataFrame) -> list[Check]:
    checks = []
    for vary, noise, published in (
        ("left", WORST_POINT, "the best published: success 0.83 at speed 0.68"),
        ("both", EQUAL_POINT, "success falls below one half"),
    ):
        curves = Curves(summary[(summary["scene"] == "complex") & (summary["vary"] == vary)])
        success, speed = (curves.of(OURS, what, noise) for what in ("success", "speed"))
        checks.append(
            Check(
                f"complex scene, noise {noise:g} ({vary}): success at least 0.97 at speed at least 0.70",
                published,
                f"success {success:.2f}, speed {speed:.2f}",
                success >= 0.97 and speed >= 0.70,
            )
        )
    return checks


def _costs(costs: pd.DataFrame, regret: Regret) -> list[Check]:
    four = costs[list(PUBLISHED)]
    best, ours, bound = four.mean().min(), costs[OURS].mean(), costs["bound"].mean()
    quiet = costs.xs(0.0, level="noise")
    ratio = costs[OURS] / four.min(axis=1)
    where = ", ".join(f"{s} {v} {n:g} ({r:.2f})" for (s, v, n), r in ratio[ratio > 1.05].items())
    gained = (best - ours) / (best - bound)
    return [
        Check(
            "mean cost over all points at least 10 % below the best single published set",
            f"{told(four.mean().tolist())} for {', '.join(PUBLISHED)}",
            f"{ours:.2f}, {100 * (1 - ours / best):.1f} % below; knowing the levels {bound:.2f}, "
            f"{100 * (1 - bound / best):.1f} % below: {100 * gained:.0f} % of what is possible",
            ours <= 0.9 * best,
        ),
        Check(
            "at no point more than 5 % above the best of the four (which is another one at each point)",
            f"no policy that has to learn the level stays within {100 * (regret.ratio - 1):.0f} % everywhere",
            f"at most {100 * (ratio.max() - 1):.0f} % above; above 5 %: {where or 'nowhere'}",
            bool(ratio.max() <= 1.05),
        ),
        Check(
            "without noise it costs nothing",
            f"{told(quiet[list(PUBLISHED)].min(axis=1).tolist())}",
            told(quiet[OURS].tolist()),
            all(
                math.isclose(a, b) or a < b
                for a, b in zip(quiet[OURS], quiet[list(PUBLISHED)].min(axis=1), strict=True)
            ),
        ),
    ]
