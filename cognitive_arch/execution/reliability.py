"""How reliable the robot is, learned while it works: the heuristic set `reliability`, one of our own.

Each capability (a kind of action, done with one arm) has a Beta posterior of how likely it works. All objects
share it, and it lasts for the whole task. From it follows what every way to the goal is expected to cost, and
so whether to try again, to take another way, or to ask for help.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.execution.heuristics import Event, EventKind
from cognitive_arch.relational.symbols import GroundAction, parse_action
from cognitive_arch.world.observation import HANDS

HELP_COST = 20.0
"""What help costs, in attempted actions."""

LEAST = 1e-6
"""Nothing is believed to be impossible."""

LASTING = frozenset(
    {
        FailureReason.UNKNOWN_SKILL,
        FailureReason.UNKNOWN_OBJECT,
        FailureReason.TOO_WIDE,
        FailureReason.OUT_OF_REACH,
        FailureReason.NOT_A_TOOL,
        FailureReason.CANNOT_PULL,
        FailureReason.BLOCKED,
        FailureReason.OFF_TABLE,
    }
)
"""Reasons that lie in this one action, not in how well the arm does such things."""


class Capability(NamedTuple):
    """A kind of action and the arm that does it."""

    kind: str
    arm: str

    def __str__(self) -> str:
        return f"{self.kind} with {self.arm}" if self.arm else self.kind


@dataclass(frozen=True, slots=True)
class ReliabilitySettings:
    """What is believed beforehand.

    The rule's own probability counts as `strength` attempts. What the other arm did, in actions of the same
    kind, counts `shared` each in what is expected of this one: both may be bad for the same reason. An action
    that something lasting stands in the way of is believed in `refusal` times as much.
    """

    strength: float = 1.2
    shared: float = 0.6
    refusal: float = 0.2
    help_cost: float = HELP_COST


@dataclass
class Reliability:
    """What was tried, and what that says about what will work."""

    settings: ReliabilitySettings = ReliabilitySettings()
    tried: dict[Capability, tuple[int, int]] = field(default_factory=dict)
    refused: dict[GroundAction, int] = field(default_factory=dict)

    def record(self, action: GroundAction, worked: bool, reason: FailureReason, prior: float) -> Event | None:
        """Count one attempt; a failure, or the first success after failures, is worth telling."""
        if not worked and reason in LASTING:
            self.refused[action] = self.refused.get(action, 0) + 1
            why = f"{action} did not work ({reason}), which says nothing about other actions"
            return Event(EventKind.RELIABILITY, why)
        capability = capability_of(action)
        before = self.chance(action, prior)
        good, bad = self.tried.get(capability, (0, 0))
        self.tried[capability] = (good + worked, bad + (not worked))
        if worked and not bad:
            return None
        good, bad = self.tried[capability]
        return Event(
            EventKind.RELIABILITY,
            f"{capability} worked {good} of {good + bad} times: believed to work goes from {before:.2f} "
            f"to {self.chance(action, prior):.2f}",
        )

    def chance(self, action: GroundAction, prior: float) -> float:
        """How likely `action` works, in (0, 1]; `prior` is what its rule says."""
        mine = capability_of(action)
        s = self.settings
        others = [n for other, n in self.tried.items() if other.kind == mine.kind and other.arm != mine.arm]
        seen = s.shared * sum(good + bad for good, bad in others)
        expected = (prior + s.shared * sum(good for good, _ in others)) / (1.0 + seen)
        good, bad = self.tried.get(mine, (0, 0))
        learned = (s.strength * expected + good) / (s.strength + good + bad)
        return max(learned * s.refusal ** self.refused.get(action, 0), LEAST)

    def to_json(self) -> dict[str, Any]:
        """Plain data; `from_json` reads it back."""
        return {
            "tried": [[*capability, *counts] for capability, counts in sorted(self.tried.items())],
            "refused": [[str(action), n] for action, n in sorted(self.refused.items())],
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any], settings: ReliabilitySettings) -> Reliability:
        """The inverse of `to_json`."""
        tried = {Capability(str(kind), str(arm)): (int(g), int(b)) for kind, arm, g, b in data["tried"]}
        return cls(settings, tried, {parse_action(action): int(n) for action, n in data["refused"]})


def capability_of(action: GroundAction) -> Capability:
    """Its kind, and the hand among its arguments, if any."""
    return Capability(action.name, next((arg for arg in action.args if arg in HANDS), ""))
