"""What an episode is made of: its settings, its steps, its result, and the state of the cycle in between."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from cognitive_arch.execution.beliefs import Belief
from cognitive_arch.execution.environment import FailureReason, Outcome
from cognitive_arch.execution.explain import EndReason, FailureReport
from cognitive_arch.execution.heuristics import Adaptation, Event, EventKind
from cognitive_arch.execution.reliability import Reliability, ReliabilitySettings
from cognitive_arch.outside import OutsideEvent, Schedule
from cognitive_arch.planning.base import PlanResult
from cognitive_arch.relational.symbols import Goal, GroundAction, parse_action
from cognitive_arch.world.state import StateChange, WorldState


@dataclass(frozen=True, slots=True)
class CycleSettings:
    """Horizon 5 up to 10 and decay 0.2 as published; at most 50 attempted actions (t of Sec. 6.4.6.2).

    The goal must still hold after `confirm_seconds` in which the robot does nothing.
    """

    horizon: int = 5
    max_horizon: int = 10
    decay: float = 0.2
    max_actions: int = 50
    confirm_seconds: float = 1.0
    reliability: ReliabilitySettings = ReliabilitySettings()


@dataclass(frozen=True, slots=True)
class Step:
    """One pass of the cycle: what was true, what was decided and why, what came of it.

    `before` and `after` are the world states around the action (the same one if nothing was done);
    `subgoal` counts from 1. `outcome` is judged from the observation after the action. `probabilities` are
    those of the plan's actions, and of what else they were weighed against.
    """

    number: int
    before: WorldState
    subgoal: int
    goal: Goal
    horizon: int
    events: tuple[Event, ...]
    plan: PlanResult | None
    action: GroundAction | None
    outcome: Outcome | None
    reason: FailureReason
    effect: dict[str, float]
    after: WorldState
    probabilities: tuple[Belief, ...] = ()

    @property
    def change(self) -> StateChange:
        """What the action changed in the world state."""
        return StateChange.between(self.before.atoms(), self.after.atoms())


@dataclass(frozen=True, slots=True)
class EpisodeResult:
    """How the episode ended; `good` and `total` count actions as in Sec. 6.4.6.2."""

    success: bool
    reason: EndReason
    good: int
    total: int
    failure: FailureReport | None
    final: WorldState


@dataclass
class CycleState:
    """All that the cycle knows between two steps, besides the world model and the random generator.

    `way` counts the lists of sub-goals: 0 is the task's own, then come its alternatives. `events` have
    happened since the last step and are told with the next one.
    """

    horizon: int
    adaptation: Adaptation
    outside: Schedule
    reliability: Reliability = field(default_factory=Reliability)
    way: int = 0
    index: int = 0
    reached: set[int] = field(default_factory=set)
    tried: list[tuple[GroundAction, bool]] = field(default_factory=list)
    good: int = 0
    total: int = 0
    events: list[Event] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Plain data; `from_json` reads it back."""
        return {
            "horizon": self.horizon,
            "failures": [[str(action), n] for action, n in sorted(self.adaptation.failures.items())],
            "outside": [str(event) for event in self.outside.pending],
            "reliability": self.reliability.to_json(),
            "way": self.way,
            "index": self.index,
            "reached": sorted(self.reached),
            "tried": [[str(action), worked] for action, worked in self.tried],
            "good": self.good,
            "total": self.total,
            "events": [[str(event.kind), event.why] for event in self.events],
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any], settings: CycleSettings) -> CycleState:
        """The inverse of `to_json`; `settings` are the cycle's."""
        failures = {parse_action(action): int(n) for action, n in data["failures"]}
        return cls(
            horizon=int(data["horizon"]),
            adaptation=Adaptation(settings.decay, failures),
            outside=Schedule(map(OutsideEvent.parse, data["outside"])),
            reliability=Reliability.from_json(data["reliability"], settings.reliability),
            way=int(data["way"]),
            index=int(data["index"]),
            reached=set(map(int, data["reached"])),
            tried=[(parse_action(action), bool(worked)) for action, worked in data["tried"]],
            good=int(data["good"]),
            total=int(data["total"]),
            events=[Event(EventKind(kind), str(why)) for kind, why in data["events"]],
        )
