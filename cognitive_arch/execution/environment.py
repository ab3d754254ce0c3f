"""The environment protocol: the planning cycle's only door to a world, simulated or real."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Protocol, runtime_checkable

from cognitive_arch.execution.saving import SavedState
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.world.observation import Observation


class Outcome(StrEnum):
    """How an attempted action ended, as far as the executing side can tell."""

    SUCCESS = "success"
    FAILURE = "failure"


class FailureReason(StrEnum):
    """Why an action failed; counted in logs and metrics."""

    NONE = "none"
    NOISE = "noise"  # the coin of the symbolic environment said no
    UNKNOWN_SKILL = "unknown_skill"  # this environment cannot perform the action
    UNKNOWN_OBJECT = "unknown_object"  # an argument is not in the world (any more)
    HAND_BUSY = "hand_busy"
    HAND_EMPTY = "hand_empty"
    TOO_WIDE = "too_wide"  # the fingers do not open far enough
    COVERED = "covered"  # something lies on the object or the target
    OUT_OF_REACH = "out_of_reach"  # no arm posture reaches the place
    NOT_GRASPED = "not_grasped"  # the fingers closed, the object did not come along
    SLIPPED = "slipped"  # it was held and got lost on the way
    NOT_A_TOOL = "not_a_tool"  # what the hand holds is no tool
    CANNOT_PULL = "cannot_pull"  # the tool has nothing to get behind an object with
    BLOCKED = "blocked"  # something is in the way of the hand or of the object
    OFF_TABLE = "off_table"  # the object would fall off the table, or did
    NO_CONTACT = "no_contact"  # the hand never touched the object
    MISPLACED = "misplaced"  # it was released and does not rest where it should
    NO_EFFECT = "no_effect"  # carried out, nothing observable changed
    UNEXPECTED_EFFECT = "unexpected_effect"  # something changed, but not what the rule's first outcome says


@dataclass(frozen=True, slots=True)
class SkillResult:
    """What one action did.

    `outcome` is judged from what was observed afterwards, never asserted by the skill. `effect` holds
    numbers measured in the meantime; an environment may leave out what it cannot measure:

    - `displacement_x`, `displacement_y`, `displacement_z`: how far the first argument came, m;
    - `duration`: how long the action took, s;
    - `contact_duration`: how long the manipulator (the hand, or the tool it holds) touched the first
      argument, s; `object_contact_duration`: how long other objects touched it, s;
    - `lift`: how much higher the first argument was while it was held up, m (only `lift`);
    - `hand_speed`, `object_speed`: how fast hand and first argument were at most, m/s.
    """

    outcome: Outcome
    reason: FailureReason = FailureReason.NONE
    effect: Mapping[str, float] = field(default_factory=dict)


@runtime_checkable
class Environment(Protocol):
    """A world that can be looked at and acted in.

    Law: for one construction and one `seed`, `reset` and the same sequence of actions give the same
    observations and results, to the last bit, in any process.
    """

    skills: frozenset[str]
    """Names of the actions this environment can perform, e.g. `graspWith`."""

    noise_told: tuple[str, ...]
    """What noise is injected, one line each with units; none without noise."""

    def reset(self, seed: int) -> Observation:
        """Set the scene up anew and look at it."""
        ...

    def observe(self) -> Observation:
        """Look at the world; changes nothing."""
        ...

    def truth(self) -> Observation | None:
        """What there really is, for those who judge the robot and never for itself; None where `observe`
        tells it anyway."""
        ...

    def execute(self, action: GroundAction) -> SkillResult:
        """Attempt `action`. An impossible one returns a failure with its reason, it never raises."""
        ...

    def disturb(self, event: OutsideEvent) -> tuple[str, ...]:
        """Let something happen that the robot does not do; its `step` does not matter here.

        Returns the objects it changed, none if there was nothing to change. Where a place is taken, a
        free one nearby is used. An object to be added must be one of the scene's `things`, for a
        simulator builds its world beforehand.
        """
        ...

    def settle(self, seconds: float) -> None:
        """Let the world go on for a while without acting."""
        ...

    def save(self) -> SavedState:
        """All that decides what happens next, as plain data for JSON.

        Law: restored, in any process and also before any `reset`, it gives the same observations and
        results for the same actions, to the last bit, and the same state to save.
        """
        ...

    def restore(self, saved: SavedState) -> Observation:
        """Go back to where `save` was called, in an environment of the same construction, and look.

        Raises `StateError` for a state that does not fit.
        """
        ...

    def record_into(self, folder: Path) -> None:
        """Keep what can be kept of the episode (pictures, trajectory) in `folder` from now on.

        A later `restore` takes up what `folder` holds of the same episode up to that time. Does nothing
        in an environment that was not built to record.
        """
        ...

    def keep_step(self, number: int) -> None:
        """Bring the folder up to date after action `number`; a killed run has what was kept so far."""
        ...

    def save_artifacts(self) -> tuple[str, ...]:
        """Finish what is kept of the episode; returns the names of all files, none without recording."""
        ...

    def close(self) -> None:
        """Release what the environment holds; idempotent."""
        ...
