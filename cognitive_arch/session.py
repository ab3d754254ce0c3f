"""From a sentence to a finished, logged episode: the parts put together."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cognitive_arch.domain import Domain, Scene
from cognitive_arch.errors import ConfigError, RuleError, one_line, unknown
from cognitive_arch.execution.backends import BACKENDS, affordance_source, perception_source, reach_model
from cognitive_arch.execution.cycle import PlanningCycle
from cognitive_arch.execution.environment import Environment
from cognitive_arch.execution.episode import CycleSettings, CycleState, EpisodeResult, Step
from cognitive_arch.execution.grounding import make_grounding
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.execution.saving import SavedState, restore_rng, restoring, save_rng
from cognitive_arch.language.goals import GoalCompiler
from cognitive_arch.language.instruction import parse_instruction
from cognitive_arch.language.semantic_memory import SemanticInstruction, SemanticMemory
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.planning.base import Planner
from cognitive_arch.planning.registry import DEFAULT_PLANNER, make_planner
from cognitive_arch.relational.parser import load_rules
from cognitive_arch.relational.rules import Entity, RuleSet
from cognitive_arch.relational.symbols import ALL, OTHERHAND, Goal, GroundAction
from cognitive_arch.scenes import domain_of, load_scene, scene_paths
from cognitive_arch.world.anchoring import WorldModel
from cognitive_arch.world.observation import HANDS, Observation

FORMAT = 1  # of saved states
CORE_PREDICATES = {
    "isHand": 1,
    "isClear": 1,
    "inHand": 2,
    "on": 2,
    "reachableWith": 2,
    "pullableWith": 2,
}
"""What the world state tells of every scene, and with how many arguments."""


@dataclass(frozen=True, slots=True)
class Task:
    """An instruction worked out: what to do in words, and what has to be true after each part."""

    instruction: str
    semantic: tuple[SemanticInstruction, ...]
    goals: tuple[Goal, ...]
    alternatives: tuple[tuple[Goal, ...], ...] = ()
    actions: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The fields of `parse --json`."""
        subgoals = [[str(lit) for lit in goal] for goal in self.goals]
        return {
            "instruction": self.instruction,
            "semantic": [list(triple) for triple in self.semantic],
            "subgoals": subgoals,
            "goal": subgoals[-1],
        }


@dataclass(frozen=True, slots=True)
class Setting:
    """Where a task is to be done: the scene, what is known of its domain, and the rules."""

    scene: Scene
    domain: Domain
    rules: RuleSet

    @classmethod
    def load(cls, scene: str, rules: str | None = None, events: tuple[OutsideEvent, ...] = ()) -> Setting:
        """Read scene, domain and rules; `rules` is a file that replaces the domain's own.

        `events` happen besides those of the scene file.
        """
        loaded = load_scene(scene)
        domain = domain_of(loaded)
        loaded = loaded.with_events(events, domain)
        path = domain.rules_path if rules is None else Path(rules)
        setting = cls(loaded, domain, load_rules(path))
        setting._check_rules()
        return setting

    def fingerprint(self) -> str:
        """Changes with all that means something in the files of scene, domain and rules, and with what was
        learnt of how the domain's objects look."""
        parts = [self.scene.model_dump_json(), self.domain.model_dump_json(), repr(self.rules.rules)]
        learnt = self.domain.recogniser_path
        if learnt.is_file():
            parts.append(hashlib.sha256(learnt.read_bytes()).hexdigest())
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]

    def _check_rules(self) -> None:
        """The predicates that observation fills must be the rules' own; constants must be known things."""
        rules = self.rules
        for name, arity in CORE_PREDICATES.items():
            if name in rules.predicates and len(rules.predicates[name].types) != arity:
                raise RuleError(f"{rules.source}: predicate {name} must have {arity} arguments")
        known = {*self.domain.objects, *HANDS, ALL, OTHERHAND}
        for rule in rules.rules:
            bound = {parameter.name for parameter in rule.parameters}
            literals = [*rule.context, *(lit for outcome in rule.outcomes for lit in outcome.literals)]
            for name in (arg for literal in literals for arg in literal.args):
                if name not in bound | known:
                    line = f"{rules.source}, line {rule.line}"
                    raise RuleError(f"{line}: {unknown('entity', name, known)}")

    def understand(self, sentence: str, held: Mapping[str, str] | None = None) -> Task:
        """Sentence -> semantic instructions -> sub-goals, given the objects of the scene.

        `held` maps an object to the hand that holds it. Raises `InstructionError`.
        """
        names = sorted(self.scene.objects)
        entities = [Entity(hand, "hand") for hand in HANDS]
        entities += [Entity(name, self.domain.objects[name].kind) for name in names]
        instruction = parse_instruction(sentence, self.domain, names)
        semantic = SemanticMemory(self.domain).expand(instruction, names, held or {})
        compiler = GoalCompiler(self.rules)
        goals = compiler.compile(semantic, entities, held)
        alternatives = compiler.alternatives(semantic, entities, held)
        return Task(instruction.sentence, semantic, goals, alternatives, compiler.actions(semantic))


@dataclass(frozen=True, slots=True)
class RunConfig:
    """How to run a task; the defaults are those of the command line."""

    scene: str = "simple"
    backend: str = "drake"
    noise: NoiseLevels = NoiseLevels()
    heuristics: Heuristics = Heuristics()
    planner: str = DEFAULT_PLANNER
    seed: int = 0
    jitter: float = 0.0
    rules: str | None = None
    record: bool = True
    events: tuple[OutsideEvent, ...] = ()
    reach: str | None = None
    perception: str | None = None
    affordances: str | None = None
    video: bool = False

    def __post_init__(self) -> None:
        # Files are found again wherever the run is gone on with.
        for field in ("scene", "rules", "affordances"):
            name = getattr(self, field)
            if name is not None and Path(name).is_file() and name not in scene_paths():
                object.__setattr__(self, field, str(Path(name).absolute()))
        if not 0 <= self.seed < 2**63:
            raise ConfigError(f"seed {one_line(self.seed, 30)} is out of range; valid: 0 to {2**63 - 1}")
        if not 0 <= self.jitter <= 0.05:
            raise ConfigError(f"jitter {self.jitter:g} m is out of range; valid: 0 to 0.05")
        if self.backend not in BACKENDS:
            raise ConfigError(unknown("backend", self.backend, BACKENDS))
        reach_model(self.backend, self.reach)
        perception_source(self.backend, self.perception)
        affordance_source(self.backend, self.perception, self.affordances)
        if self.video and not (self.record and self.backend == "drake"):
            raise ConfigError("a video needs physics and a recording: --backend drake, without --no-record")
        make_planner(self.planner)

    @property
    def affordance_source(self) -> str:
        """Where the robot knows from what tools are good for (`backends.affordance_source`)."""
        return affordance_source(self.backend, self.perception, self.affordances)

    def to_json(self) -> dict[str, Any]:
        """Plain data for the manifest."""
        texts = {
            "noise": str(self.noise),
            "heuristics": str(self.heuristics),
            "reach": reach_model(self.backend, self.reach),
            "perception": perception_source(self.backend, self.perception),
            "affordances": self.affordance_source,
        }
        return asdict(self) | texts | {"events": [str(event) for event in self.events]}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> RunConfig:
        """The inverse of `to_json`; raises `ConfigError` for what another version has written."""
        try:
            parsed = {
                "noise": NoiseLevels.parse(data["noise"]),
                "heuristics": Heuristics.parse(data["heuristics"]),
                "events": tuple(map(OutsideEvent.parse, data["events"])),
            }
            return cls(**{**data, **parsed})
        except (KeyError, TypeError, AttributeError) as error:
            raise ConfigError(f"this run's configuration cannot be read: {one_line(error)}") from None


@dataclass(frozen=True, slots=True)
class Progress:
    """What a caller may want to hear while an episode goes on."""

    on_task: Callable[[Task], None] = lambda task: None
    on_act: Callable[[GroundAction], None] = lambda action: None
    on_step: Callable[[Step], None] = lambda step: None
    on_notice: Callable[[str], None] = lambda text: None


class Session:
    """One robot in one world, given one instruction after another.

    The world model lasts from one instruction to the next, and so does what the hands hold. The outside
    events of the scene happen during the first instruction. `planner` replaces the one that `config` names.
    """

    def __init__(
        self, config: RunConfig, setting: Setting, environment: Environment, planner: Planner | None = None
    ) -> None:
        self._setting = setting
        self._environment = environment
        self._heuristics = config.heuristics
        self._planner = make_planner(config.planner) if planner is None else planner
        # The environment draws from `seed` itself, the planner from a stream of its own.
        self._rng = np.random.default_rng(np.random.SeedSequence(config.seed).spawn(1)[0])
        self._world = WorldModel()
        self._observation = environment.reset(config.seed)
        self._world.update(self._observation)
        self._events = setting.scene.events
        self._grounding = make_grounding(config.affordance_source, setting.rules, environment.skills)

    @property
    def world(self) -> WorldModel:
        return self._world

    def perceive(self, observation: Observation) -> Observation:
        """What the robot would take its things to be good for if it saw just that."""
        return self._grounding.perceive(observation)

    def understand(self, sentence: str) -> Task:
        """The sentence as a task, given what is in the hands now."""
        return self._setting.understand(sentence, self._world.state.held)

    def perform(
        self,
        task: Task,
        progress: Progress = Progress(),
        settings: CycleSettings = CycleSettings(),
    ) -> EpisodeResult:
        """Do `task`; returns when its goal holds or nothing is left to try."""
        self._world.begin_instruction()
        events, self._events = self._events, ()
        cycle = self._begin(progress, settings, events)
        return cycle.run(task.goals, self._environment.observe(), task.alternatives)

    def save(self) -> SavedState:
        """All that the rest of the present task depends on, as plain data; for use while it goes on."""
        return {
            "kind": "session",
            "format": FORMAT,
            "environment": self._environment.save(),
            "world": self._world.to_json(),
            "rng": save_rng(self._rng),
            "cycle": self._cycle.state.to_json(),
        }

    def resume(
        self,
        task: Task,
        saved: SavedState,
        progress: Progress = Progress(),
        settings: CycleSettings = CycleSettings(),
    ) -> EpisodeResult:
        """Go on with `task` where it was when `saved` was; raises `StateError` if it does not fit."""
        with restoring(saved, "session", FORMAT):
            self._environment.restore(saved["environment"])
            self._world = WorldModel.from_json(saved["world"])
            self._rng = restore_rng(saved["rng"])
            state = CycleState.from_json(saved["cycle"], settings)
        self._events = ()
        return self._begin(progress, settings).resume(state, task.goals, task.alternatives)

    def _begin(
        self, progress: Progress, settings: CycleSettings, events: tuple[OutsideEvent, ...] = ()
    ) -> PlanningCycle:
        self._cycle = PlanningCycle(
            self._environment,
            self._world,
            self._planner,
            self._setting.rules,
            self._rng,
            heuristics=self._heuristics,
            settings=settings,
            outside=events,
            grounding=self._grounding,
            on_act=progress.on_act,
            on_step=progress.on_step,
        )
        return self._cycle
