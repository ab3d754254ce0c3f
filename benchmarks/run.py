"""Prints the measured budgets: `make bench`. Times are medians; nothing here can fail a test."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.planning.registry import make_planner
from cognitive_arch.runs import run_task
from cognitive_arch.session import RunConfig, Session, Setting
from cognitive_arch.world.anchoring import WorldModel
from sim.environment import DrakeEnvironment
from sim.trials import HAND_PAIRS, attempt

SANDWICH = "make a ham sandwich"


def median(measure: Callable[[], object], repeat: int) -> float:
    """Median wall seconds of `measure`."""
    times = []
    for _ in range(repeat):
        started = time.perf_counter()
        measure()
        times.append(time.perf_counter() - started)
    return statistics.median(times)


def cogarch(*args: str) -> Callable[[], object]:
    """One whole process."""
    command = [sys.executable, "-m", "cognitive_arch.cli", *args]
    return lambda: subprocess.run(command, env=os.environ, capture_output=True, check=True)


def plan_call(scene: str) -> Callable[[], object]:
    """One A-PRADA call (horizon 5, 2000 samples) from the start of a scene."""
    setting = Setting.load(scene)
    goal = setting.understand(SANDWICH).goals[1]
    env = make_environment("symbolic", setting.domain, setting.scene, setting.rules, noise=NoiseLevels())
    state = WorldModel().update(env.reset(0))
    rules = setting.rules.ground(state.entities)
    planner = make_planner("a-prada")
    return lambda: planner.plan(state.atoms(), goal, rules, 5, np.random.default_rng(0))


def episode(scene: str, noise: float, seed: int) -> bool:
    """One symbolic episode; whether it succeeded."""
    setting = Setting.load(scene)
    config = RunConfig(scene=scene, backend="symbolic", seed=seed)
    levels = NoiseLevels(noise, noise, noise, noise)
    env = make_environment("symbolic", setting.domain, setting.scene, setting.rules, noise=levels)
    return Session(config, setting, env).perform(setting.understand(SANDWICH)).success


def main() -> None:
    """Measure and print, quick things first."""
    rows: list[tuple[str, str, str]] = []

    def row(what: str, measured: str, budget: str) -> None:
        rows.append((what, measured, budget))
        print(f"{what:<58} {measured:>12}   {budget}", flush=True)

    row("what", "measured", "budget")
    with tempfile.TemporaryDirectory() as folder:
        row("cogarch --help", f"{median(cogarch('--help'), 5):.2f} s", "< 0.5 s")
        symbolic = cogarch("run", SANDWICH, "--backend", "symbolic", "--store", folder)
        row("cogarch run --backend symbolic, whole process", f"{median(symbolic, 5):.2f} s", "< 3 s")
        for scene in ("simple", "complex"):
            call = plan_call(scene)
            call()
            row(f"A-PRADA, horizon 5, 2000 samples, {scene}", f"{1e3 * median(call, 20):.1f} ms", "")
            row(
                f"symbolic episode, {scene}",
                f"{1e3 * median(lambda s=scene: episode(s, 0, 0), 5):.0f} ms",
                "< 100 ms",
            )
        good = sum(episode("simple", 0.25, seed) for seed in range(100))
        row("successes at noise 0.25 on everything, simple", f"{good} of 100", ">= 90")
        good = sum(episode("complex", 0.25, seed) for seed in range(100))
        row("successes at noise 0.25 on everything, complex", f"{good} of 100", "")
        started = time.perf_counter()
        result = run_task(SANDWICH, RunConfig(), Path(folder))
        row("make demo's run, with recording", f"{time.perf_counter() - started:.1f} s", "< 60 s")
        (html,) = (Path(path) for path in result["artifacts"] if path.endswith(".html"))
        size = html.stat().st_size
        row("its Meshcat recording", f"{size / 1e6:.1f} MB", "< 15 MB")
    setting = Setting.load("simple")
    environment = DrakeEnvironment(setting.domain, setting.scene, jitter=0.02)
    for hand in sorted(HAND_PAIRS):
        started = time.process_time()
        good = sum(attempt(environment, seed, HAND_PAIRS[hand])[0] for seed in range(20))
        cpu = (time.process_time() - started) / 20
        row(f"Drake sandwich, +-2 cm and any yaw, {hand}", f"{good} of 20", ">= 19")
        row("  CPU each", f"{cpu:.1f} s", "< 20 s")


if __name__ == "__main__":
    main()
