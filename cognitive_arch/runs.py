"""Runs: an episode from sentence to result that is kept in the store, and can be gone on with."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cognitive_arch.errors import BackendError, StoreError
from cognitive_arch.execution.backends import BACKENDS, make_environment, perception_source, reach_model
from cognitive_arch.execution.environment import Environment
from cognitive_arch.execution.episode import EpisodeResult, Step
from cognitive_arch.execution.grounding import judge_of
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.execution.metrics import speed
from cognitive_arch.planning.compilation import warm_up, warm_up_search
from cognitive_arch.planning.registry import make_planner
from cognitive_arch.relational.symbols import State, satisfied
from cognitive_arch.runlog.records import action_record, result_record, versions
from cognitive_arch.runlog.store import Checkpoint, Run, RunStore, RunWriter
from cognitive_arch.session import Progress, RunConfig, Session, Setting, Task
from cognitive_arch.world.anchoring import WorldModel
from cognitive_arch.world.observation import Observation
from cognitive_arch.world.state import StateChange


class RunInterrupted(KeyboardInterrupt):
    """Ctrl-C while a run goes on that `resume_task` can take up again."""

    def __init__(self, run_id: str) -> None:
        super().__init__(f"run {run_id} was interrupted")
        self.run_id = run_id


def run_task(
    sentence: str,
    config: RunConfig,
    store_folder: Path,
    progress: Progress = Progress(),
) -> dict[str, Any]:
    """Run one sentence from start to end and keep it in the store; returns the fields of `run --json`.

    Raises a `CogArchError` for anything wrong with the input, before anything is written, and
    `RunInterrupted` on Ctrl-C.
    """
    started = time.perf_counter()
    setting = Setting.load(config.scene, config.rules, config.events)
    task = setting.understand(sentence)
    manifest = {"instruction": task.instruction, **config.to_json(), **task.to_json()}
    manifest |= {"events": [str(event) for event in setting.scene.events], "versions": versions()}
    manifest |= {"config": config.to_json(), "setting": setting.fingerprint()}
    manifest |= {"learned": _learned(config)}
    with _prepared(task, config, setting) as environment, RunStore(store_folder, create=True) as store:
        started += _compile(config, progress)
        name = f"{setting.scene.name}-{config.backend}-{config.seed}"
        manifest["physical_noise"] = list(environment.noise_told)
        session = Session(config, setting, environment)  # what cannot be set up leaves no run behind
        with store.begin(name, manifest) as run:
            episode = _Episode(config, setting, task, store, run, environment, session, started)
            return episode.perform(progress, None)


def resume_task(name: str, store_folder: Path, progress: Progress = Progress()) -> dict[str, Any]:
    """Go on with an interrupted run after its last finished step, as if nothing had happened.

    `name` is as for `RunStore.find`. Returns what `run_task` would have returned; raises `StoreError` for a
    run that cannot be gone on with.
    """
    started = time.perf_counter()
    with RunStore(store_folder) as store:
        run = store.find(name)
        with store.resume(run) as writer:
            config, setting, task = _as_begun(run)
            with _prepared(task, config, setting) as environment:
                started += _compile(config, progress)
                checkpoint = writer.rewind()
                after = f"after step {checkpoint.step}" if checkpoint else "from the start"
                progress.on_notice(f"going on with {run.run_id} {after}")
                session = Session(config, setting, environment)
                episode = _Episode(config, setting, task, store, writer, environment, session, started)
                return episode.perform(progress, checkpoint)


def _as_begun(run: Run) -> tuple[RunConfig, Setting, Task]:
    """Configuration, setting and task of a run; raises `StoreError` if they are not to be had any more."""
    then, now = run.manifest.get("versions", {}), versions()
    changed = [key for key in sorted({*then, *now}) if then.get(key) != now.get(key)]
    again = "it cannot go on exactly as it began; run it anew"
    if changed or "config" not in run.manifest:
        old, new = (", ".join(f"{key} {which.get(key)}" for key in changed) for which in (then, now))
        raise StoreError(
            f"run {run.run_id} was begun with {old or 'an older version'}, this is {new}: {again}"
        )
    config = RunConfig.from_json(run.manifest["config"])
    setting = Setting.load(config.scene, config.rules, config.events)
    if setting.fingerprint() != run.manifest["setting"]:
        raise StoreError(f"scene, domain or rules have changed since run {run.run_id} was begun: {again}")
    if _learned(config) != run.manifest.get("learned"):
        raise StoreError(f"what was learned of tools has changed since run {run.run_id} was begun: {again}")
    return config, setting, setting.understand(run.manifest["instruction"])


def _learned(config: RunConfig) -> dict[str, object] | None:
    """What the robot has learned of tools and uses, for the manifest."""
    judge = judge_of(config.affordance_source)
    return None if judge is None else judge.told()


@contextmanager
def _prepared(task: Task, config: RunConfig, setting: Setting) -> Iterator[Environment]:
    environment = make_environment(
        config.backend,
        setting.domain,
        setting.scene,
        setting.rules,
        noise=config.noise,
        jitter=config.jitter,
        record=config.record,
        video=config.video,
        reach=config.reach,
        perception=config.perception,
        shapes_seen=judge_of(config.affordance_source) is not None,
    )
    try:
        _check_skills(task, config.backend, environment)
        yield environment
    finally:
        environment.close()


def prepare(planner: str, heuristics: Heuristics, on_notice: Callable[[str], None]) -> None:
    """Compile, or load, what an episode with these will need."""
    if heuristics.reliability:
        warm_up_search(on_notice)
    else:
        warm_up(make_planner(planner), on_notice)


def _compile(config: RunConfig, progress: Progress) -> float:
    """Seconds that went into compiling: once on a machine, and no part of the run."""
    began = time.perf_counter()
    prepare(config.planner, config.heuristics, progress.on_notice)
    return time.perf_counter() - began


@dataclass(frozen=True, slots=True)
class _Episode:
    """One run of one task, kept in the store; `started` is when its work began (`time.perf_counter`)."""

    config: RunConfig
    setting: Setting
    task: Task
    store: RunStore
    run: RunWriter
    environment: Environment
    session: Session
    started: float

    def perform(self, progress: Progress, checkpoint: Checkpoint | None) -> dict[str, Any]:
        """Do the task, or the rest of it; returns the fields of `run --json`."""
        try:
            return self._perform(progress, checkpoint)
        except KeyboardInterrupt:
            raise RunInterrupted(self.run.run_id) from None

    def _perform(self, progress: Progress, checkpoint: Checkpoint | None) -> dict[str, Any]:
        session = self.session
        progress.on_task(self.task)
        for line in self.environment.noise_told:
            progress.on_notice(f"noise        {line}")
        spent = 0.0 if checkpoint is None else checkpoint.wall_s

        def wall() -> float:
            return spent + time.perf_counter() - self.started

        def on_step(step: Step) -> None:
            state = None  # the last step, which tells how it ended, is done again on resuming
            if step.action is not None:
                self.environment.keep_step(step.number)
                state = session.save()
            self.run.add_step(step, state, wall(), self._misbelief(step))
            progress.on_step(step)

        listening = Progress(on_act=progress.on_act, on_step=on_step)
        self.environment.record_into(self.run.folder)
        if checkpoint is None:
            result = session.perform(self.task, listening)
        else:
            result = session.resume(self.task, checkpoint.state, listening)
        artifacts = [str(self.run.folder / name) for name in self.environment.save_artifacts()]
        outcome = result_record(result, speed(result.total)) | {"wall_s": round(wall(), 3)}
        outcome |= {"goal_holds": self._goal_holds(result)}
        self.run.finish(outcome | {"artifacts": artifacts})
        steps = self.store.steps(self.run.run_id)
        return {
            "run_id": self.run.run_id,
            "instruction": self.task.instruction,
            "scene": self.setting.scene.name,
            "backend": self.config.backend,
            "seed": self.config.seed,
            "planner": self.config.planner,
            "heuristics": str(self.config.heuristics),
            "noise": str(self.config.noise),
            "reach": reach_model(self.config.backend, self.config.reach),
            "perception": perception_source(self.config.backend, self.config.perception),
            "affordances": self.config.affordance_source,
            "physical_noise": list(self.environment.noise_told),
            "events": [str(event) for event in self.setting.scene.events],
            **outcome,
            "subgoals": self.task.to_json()["subgoals"],
            "actions": [action_record(record) for record in steps if record["action"]],
            "misbeliefs": sum(len(atoms) for r in steps for atoms in (r["misbelief"] or {}).values()),
            "artifacts": artifacts,
            "store": str(self.store.folder),
        }

    def _misbelief(self, step: Step) -> StateChange | None:
        """What the robot takes for true after a step and is not, and what it overlooks."""
        truth = self.environment.truth()
        return None if truth is None else StateChange.between(self._atoms(truth), step.after.atoms())

    def _goal_holds(self, result: EpisodeResult) -> bool:
        """Whether the goal, in one of the ways to it, really holds in the end."""
        truth = self.environment.truth()
        atoms = result.final.atoms() if truth is None else self._atoms(truth)
        return any(satisfied(ways[-1], atoms) for ways in (self.task.goals, *self.task.alternatives))

    def _atoms(self, truth: Observation) -> State:
        return WorldModel().update(self.session.perceive(truth)).atoms()


def _check_skills(task: Task, backend: str, environment: Environment) -> None:
    """Refuse at once what the robot of this backend can never do."""
    missing = [name for name in task.actions if name not in environment.skills]
    if missing:
        raise BackendError(
            f"the {backend} backend has no skill for {', '.join(missing)}; "
            f"it has {', '.join(sorted(environment.skills))}; other backends: "
            f"{', '.join(b for b in BACKENDS if b != backend)}"
        )
