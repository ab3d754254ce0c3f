"""Figs. 58 to 61 of the thesis (Sec. 6.5.2), recomputed under the published conditions.

A-PRADA with 2000 samples, horizon 5 to 10, one seed for every planning call; put and drop are quiet; reach
by the scenes' constants; at most 50 actions. What the text says of each figure stands here as checks that can
fail.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from cognitive_arch.evaluation.reproduction import Check, Options, Reproduced
from cognitive_arch.evaluation.results import write_results
from cognitive_arch.evaluation.running import run_sweep
from cognitive_arch.evaluation.sweep import PUBLISHED, SweepConfig

EPISODES = 100
NONE, CREATIVITY, ADAPTABILITY, BOTH = PUBLISHED
WORST = 0.95


@dataclass(frozen=True)
class Curves:
    """Means of one figure's sweep by set of heuristics and noise."""

    summary: pd.DataFrame

    def of(self, heuristics: str, what: str, noise: float) -> float:
        """One point."""
        found = self.summary[(self.summary["heuristics"] == heuristics) & (self.summary["noise"] == noise)]
        return float(found[what].iloc[0])

    def curve(self, heuristics: str, what: str) -> list[float]:
        """All points, in the order of noise."""
        mine = self.summary[self.summary["heuristics"] == heuristics].sort_values("noise")
        return [float(value) for value in mine[what]]

    def differ(self, a: str, b: str, what: str) -> float:
        """The largest difference between two curves."""
        return max(abs(x - y) for x, y in zip(self.curve(a, what), self.curve(b, what), strict=True))


def told(values: list[float]) -> str:
    """Numbers with two digits."""
    return ", ".join(f"{value:.2f}" for value in values)


def _without_noise(c: Curves, actions: int) -> Check:
    totals = [c.of(name, "total", 0.0) for name in PUBLISHED]
    ours = f"{told(totals)} actions"
    return Check("actions without noise", f"{actions}, always", ours, all(t == actions for t in totals))


def _none_is_slow(c: Curves, reliable_to: float) -> list[Check]:
    success, speed = c.curve(NONE, "success"), c.curve(NONE, "speed")
    early = [c.of(NONE, "success", n) for n in (0.0, 0.25, 0.5, 0.75) if n <= reliable_to]
    return [
        Check(
            "without heuristics, success stays",
            f"1 for noise <= {reliable_to:g}, less only beyond",
            f"{told(success)} at noise 0, 0.25, 0.5, 0.75, 0.95",
            min(early) >= 0.97 and success[-1] <= min(early),
        ),
        Check(
            "without heuristics, speed falls with noise",
            "many actions, up to 50, are asked for",
            told(speed),
            all(a >= b - 0.02 for a, b in itertools.pairwise(speed)) and speed[-1] <= speed[0] - 0.4,
        ),
    ]


def _creativity_alone(c: Curves) -> Check:
    ours = f"differs by at most {c.differ(NONE, CREATIVITY, 'speed'):.2f} in speed"
    ours += f" and {c.differ(NONE, CREATIVITY, 'success'):.2f} in success"
    alike = max(c.differ(NONE, CREATIVITY, what) for what in ("speed", "success")) <= 0.1
    return Check("creativity alone does what no heuristic does", "similar", ours, alike)


def _adaptability_is_quick(c: Curves, name: str, least: float) -> Check:
    speed = c.curve(name, "speed")
    return Check(
        f"with {name}, speed stays high",
        "about constant",
        told(speed),
        min(speed) >= max(least, speed[0] - 0.2),
    )


def _success_collapses(c: Curves, name: str, published: str) -> Check:
    success = c.curve(name, "success")
    falling = all(a >= b - 0.05 for a, b in itertools.pairwise(success))
    return Check(f"with {name}, success collapses", published, told(success), falling and success[-1] <= 0.1)


def _fig58(c: Curves) -> list[Check]:
    return [
        _without_noise(c, 4),
        *_none_is_slow(c, 0.75),
        _creativity_alone(c),
        _adaptability_is_quick(c, ADAPTABILITY, 0.7),
        _adaptability_is_quick(c, BOTH, 0.7),
        _success_collapses(c, ADAPTABILITY, "decreases with noise"),
        _success_collapses(c, BOTH, "decreases with noise"),
    ]


def _fig59(c: Curves) -> list[Check]:
    speed, success = c.curve(BOTH, "speed"), c.curve(BOTH, "success")
    good, total = c.of(BOTH, "good", WORST), c.of(BOTH, "total", WORST)
    return [
        *_none_is_slow(c, 0.75),
        _creativity_alone(c),
        _adaptability_is_quick(c, ADAPTABILITY, 0.7),
        _success_collapses(c, ADAPTABILITY, "decreases rather abruptly"),
        Check(
            f"with {BOTH}, neither falls much",
            "always in the top right region",
            f"speed {told(speed)}; success {told(success)}",
            min(speed) >= 0.75 and min(success) >= 0.75,
        ),
        Check(
            f"with {BOTH}, typical episodes at noise 0.95",
            "4 good of 9 actions",
            f"{good:.1f} good of {total:.1f} on average",
            abs(good - 4) <= 1 and abs(total - 9) <= 1.5,
        ),
    ]


def _fig60(c: Curves) -> list[Check]:
    half = {name: c.of(name, "success", 0.5) for name in (ADAPTABILITY, BOTH)}
    low = c.of(BOTH, "success_low", 0.5)  # of the 95 % interval: "less than half" is not excluded
    worst = {name: [c.of(name, "success", noise) for noise in (0.75, WORST)] for name in half}
    return [
        _without_noise(c, 7),
        *_none_is_slow(c, 0.5),
        _creativity_alone(c),
        _adaptability_is_quick(c, ADAPTABILITY, 0.7),
        _adaptability_is_quick(c, BOTH, 0.7),
        Check(
            "with adaptability, success at noise 0.5",
            "less than half of the episodes complete the plan",
            f"{half[ADAPTABILITY]:.2f} alone, {half[BOTH]:.2f} with creativity (from {low:.2f})",
            half[ADAPTABILITY] < 0.5 and low < 0.5,
        ),
        Check(
            "with adaptability, success beyond",
            "drops to zero",
            f"{told(worst[ADAPTABILITY])} alone, {told(worst[BOTH])} with creativity at noise 0.75, 0.95",
            all(three_quarters <= 0.2 and at_worst <= 0.02 for three_quarters, at_worst in worst.values()),
        ),
        Check(
            "creativity helps adaptability at noise 0.5",
            "fares better there",
            f"{half[BOTH]:.2f} against {half[ADAPTABILITY]:.2f}",
            half[BOTH] > half[ADAPTABILITY],
        ),
    ]


def _fig61(c: Curves) -> list[Check]:
    good, total, success = (c.of(BOTH, what, WORST) for what in ("good", "total", "success"))
    speeds = {name: c.of(name, "speed", WORST) for name in PUBLISHED}
    others = {name: [c.of(name, "success", n) for n in (0.75, WORST)] for name in PUBLISHED}
    return [
        *_none_is_slow(c, 0.5),
        Check(
            f"with {BOTH} at left noise 0.95, success",
            "0.83 (the aim: at least 0.8)",
            f"{success:.2f}",
            success >= 0.8,
        ),
        Check(
            f"with {BOTH} at left noise 0.95, actions",
            "9 good of 16",
            f"{good:.1f} good of {total:.1f} on average",
            abs(good - 9) <= 1 and abs(total - 16) <= 2.5,
        ),
        Check(
            f"{BOTH} is faster at left noise 0.95 than what succeeds as well",
            "outperforms in speed for noise > 0.75",
            ", ".join(f"{name} {speed:.2f}" for name, speed in speeds.items()),
            speeds[BOTH] > max(speeds[NONE], speeds[CREATIVITY]),
        ),
        Check(
            f"{BOTH} succeeds more often than adaptability for noise > 0.5",
            "outperforms in success",
            f"{told(others[BOTH])} against {told(others[ADAPTABILITY])}",
            all(a > b + 0.3 for a, b in zip(others[BOTH], others[ADAPTABILITY], strict=True)),
        ),
        Check(
            "adaptability alone: speed very good, to the detriment of success",
            "speed above all others, success low",
            f"speed {speeds[ADAPTABILITY]:.2f}, success {others[ADAPTABILITY][1]:.2f} at noise 0.95",
            speeds[ADAPTABILITY] >= max(speeds.values()) and others[ADAPTABILITY][1] <= 0.1,
        ),
    ]


def published_config(scene: str, vary: str, episodes: int = EPISODES, seed: int = 0) -> SweepConfig:
    """The conditions of one figure."""
    return SweepConfig(
        scenes=(scene,),
        planners=("a-prada",),
        vary=(vary,),
        episodes=episodes,
        seed=seed,
        coin="published",
    )


def _recompute(
    options: Options, name: str, scene: str, vary: str, checks: Callable[[Curves], list[Check]]
) -> Reproduced:
    config = published_config(scene, vary, options.episodes or EPISODES, options.seed)
    command = (
        f"cogarch reproduce {name} --episodes {config.episodes} --seed {config.seed} --out {options.out}"
    )
    run_sweep(
        config,
        options.out,
        command,
        jobs=options.jobs,
        on_rows=options.on_progress,
        on_notice=options.on_notice,
    )
    results = write_results(options.out, title=f"{name}: {scene} scene, {vary} varied")
    numbers = {"episodes": config.episodes, "points": results.summary.to_dict("records")}
    return Reproduced(tuple(checks(Curves(results.summary))), numbers, results.files)


def fig58(options: Options) -> Reproduced:
    """The simple scene, both arms equally noisy (Sec. 6.5.2.1)."""
    return _recompute(options, "fig58", "simple", "both", _fig58)


def fig59(options: Options) -> Reproduced:
    """The simple scene, noise of the left arm varied (Sec. 6.5.2.2)."""
    return _recompute(options, "fig59", "simple", "left", _fig59)


def fig60(options: Options) -> Reproduced:
    """The complex scene, both arms equally noisy (Sec. 6.5.2.3)."""
    return _recompute(options, "fig60", "complex", "both", _fig60)


def fig61(options: Options) -> Reproduced:
    """The complex scene, noise of the left arm varied (Sec. 6.5.2.4)."""
    return _recompute(options, "fig61", "complex", "left", _fig61)
