"""Running the episodes of a sweep: what a worker does, in this process or another."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from cognitive_arch.evaluation.rows import Row
from cognitive_arch.evaluation.sweep import Cell, Job, SweepConfig
from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.environment import Environment
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.execution.metrics import speed
from cognitive_arch.planning.memory import FixedSeed
from cognitive_arch.planning.registry import make_planner
from cognitive_arch.session import RunConfig, Session, Setting, Task


def run_job(config: SweepConfig, job: Job, remember: bool = True, shared: Path | None = None) -> list[Row]:
    """The rows of one job; they depend on nothing but `config` and `job`, `wall_s` aside.

    Plans are remembered, and shared with other processes through the folder `shared`.
    """
    order = list(range(job.first, job.end))
    # Jobs that run side by side begin with different planning seeds, so as not to plan the same at one time.
    turn = 2 * (job.first // len(order)) % len(order)
    with _environment(config, job.cell) as environment:
        return sorted(
            (
                _episode(config, job.cell, n, environment, _Memory(remember, shared))
                for n in order[turn:] + order[:turn]
            ),
            key=lambda row: row.episode,
        )


class _Memory(NamedTuple):
    """Whether plans are remembered, and where they are shared."""

    remember: bool
    shared: Path | None


def _episode(config: SweepConfig, cell: Cell, episode: int, environment: Environment, memory: _Memory) -> Row:
    started = time.perf_counter()
    setting, task = _task(cell.scene, config.sentence)
    planner = _planner(cell.planner, config.planning_seed(episode), memory)
    seed = config.episode_seed(episode)
    run = RunConfig(
        scene=cell.scene,
        backend=cell.backend,
        noise=cell.levels,
        heuristics=Heuristics.parse(cell.heuristics),
        planner=cell.planner,
        seed=seed,
        jitter=config.jitter,
        record=False,
        affordances="default",  # as in the published sweeps
    )
    result = Session(run, setting, environment, planner).perform(task)
    return Row(
        scene=setting.scene.name,
        backend=cell.backend,
        planner=cell.planner,
        heuristics=cell.heuristics,
        vary=cell.vary,
        left=cell.levels.left,
        right=cell.levels.right,
        pull=cell.levels.pull,
        push=cell.levels.push,
        noise=cell.noise,
        episode=episode,
        seed=seed,
        success=result.success,
        speed=speed(result.total),
        good=result.good,
        total=result.total,
        reason=str(result.reason),
        wall_s=round(time.perf_counter() - started, 4),
    )


@contextmanager
def _environment(config: SweepConfig, cell: Cell) -> Iterator[Environment]:
    setting, _ = _task(cell.scene, config.sentence)
    environment = make_environment(
        cell.backend,
        setting.domain,
        setting.scene,
        setting.rules,
        noise=cell.levels,
        jitter=config.jitter,
        quiet_release=config.coin == "published",
    )
    try:
        yield environment
    finally:
        environment.close()


@lru_cache(maxsize=16)
def _task(scene: str, sentence: str) -> tuple[Setting, Task]:
    setting = Setting.load(scene)
    return setting, setting.understand(sentence)


@lru_cache(maxsize=32)
def _planner(name: str, seed: int, memory: _Memory) -> FixedSeed:
    """One planner for all episodes of a process with this seed, so that they share what it remembers."""
    return FixedSeed(make_planner(name), seed, *memory)
