"""What the rows of a sweep say: means with 95 % intervals, and comparisons in pairs on the same seeds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cognitive_arch.evaluation.sweep import published_order

Z = 1.959963984540054  # two-sided 95 % of a normal distribution
RESAMPLES = 2000
HELP_COST = 20.0
"""What a failed episode costs besides its actions: as much as so many of them."""

CONDITION = ["scene", "backend", "planner", "vary", "noise"]
CELL = [*CONDITION[:4], "heuristics", "noise"]

Floats = NDArray[np.float64]


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Wilson's score interval of a rate, 95 %; `n` at least 1."""
    rate = successes / n
    middle = (rate + Z * Z / (2 * n)) / (1 + Z * Z / n)
    half = Z / (1 + Z * Z / n) * math.sqrt(rate * (1 - rate) / n + Z * Z / (4 * n * n))
    low = 0.0 if successes == 0 else middle - half
    high = 1.0 if successes == n else middle + half
    return max(low, 0.0), min(high, 1.0)


def bootstrap(values: Floats, seed: int) -> tuple[float, float]:
    """Percentile bootstrap interval of the mean of `values` (n,), 95 %; the same for the same seed."""
    rng = np.random.default_rng(seed)
    # How often each value is drawn, over all resamples at once: (RESAMPLES, n).
    counts = rng.multinomial(len(values), np.full(len(values), 1 / len(values)), size=RESAMPLES)
    low, high = np.quantile(counts @ values / len(values), [0.025, 0.975])
    return float(low), float(high)


def mcnemar(only_a: int, only_b: int) -> float:
    """Exact two-sided p value that in a pair either is as likely as the other to be the one that succeeds."""
    n = only_a + only_b
    if n == 0:
        return 1.0
    tail = sum(math.comb(n, k) for k in range(min(only_a, only_b) + 1))
    return min(1.0, 2 * tail / 2**n)


def cost(rows: pd.DataFrame, help_cost: float = HELP_COST) -> pd.Series:
    """Per episode: actions attempted, and `help_cost` more if somebody had to help in the end."""
    return rows["total"] + help_cost * (1 - rows["success"].astype(float))


def summarise(rows: pd.DataFrame, seed: int = 0) -> pd.DataFrame:
    """One line per cell: means, and intervals where they are shown (columns `*_low`, `*_high`)."""
    lines = []
    for n, (names, cell) in enumerate(rows.groupby(CELL, sort=False)):
        success, costs = int(cell["success"].sum()), cost(cell).to_numpy(float)
        lines.append(
            dict(zip(CELL, names, strict=True))
            | {name: cell[name].iloc[0] for name in ("left", "right", "pull", "push")}
            | {"episodes": len(cell)}
            | _with_interval("success", success / len(cell), wilson(success, len(cell)))
            | _with_interval(
                "speed", cell["speed"].mean(), bootstrap(cell["speed"].to_numpy(float), seed + n)
            )
            | {"good": cell["good"].mean(), "total": cell["total"].mean()}
            | _with_interval("cost", costs.mean(), bootstrap(costs, seed + n))
            | {"wall_s": cell["wall_s"].mean()}
        )
    return pd.DataFrame(lines)


def compare(rows: pd.DataFrame, seed: int = 0) -> pd.DataFrame:
    """Every two sets of heuristics, under the same condition, episode by episode on the same seeds.

    `only_a` and `only_b` count the pairs of which one alone succeeded (McNemar's exact test); differences are
    a minus b, with bootstrap intervals over pairs.
    """
    lines = []
    for n, (names, group) in enumerate(rows.groupby(CONDITION, sort=False)):
        by_set = {str(h): g.set_index("seed") for h, g in group.groupby("heuristics", sort=False)}
        for a, b in itertools.combinations(published_order(list(by_set)), 2):
            one, other = by_set[a], by_set[b].reindex(by_set[a].index)
            ok_a, ok_b = one["success"].to_numpy(bool), other["success"].to_numpy(bool)
            only_a, only_b = int((ok_a & ~ok_b).sum()), int((ok_b & ~ok_a).sum())
            speed = (one["speed"] - other["speed"]).to_numpy(float)
            dearer = (cost(one) - cost(other)).to_numpy(float)
            lines.append(
                dict(zip(CONDITION, names, strict=True))
                | {"a": a, "b": b, "pairs": len(one), "only_a": only_a, "only_b": only_b}
                | {"success_p": mcnemar(only_a, only_b)}
                | _with_interval("speed_difference", speed.mean(), bootstrap(speed, seed + n))
                | _with_interval("cost_difference", dearer.mean(), bootstrap(dearer, seed + n))
            )
    return pd.DataFrame(lines)


def cost_by_help(rows: pd.DataFrame, help_costs: Sequence[float]) -> pd.DataFrame:
    """Mean cost of every set of heuristics over all conditions, one row per price of help."""
    columns: dict[str, Any] = {}
    for name in published_order(rows["heuristics"].unique().tolist()):
        mine = rows[rows["heuristics"] == name]
        columns[name] = [float(cost(mine, c).mean()) for c in help_costs]
    return pd.DataFrame(columns, index=pd.Index(help_costs, name="help_cost"))


def _with_interval(name: str, mean: float, interval: tuple[float, float]) -> dict[str, float]:
    return {name: float(mean), f"{name}_low": interval[0], f"{name}_high": interval[1]}
