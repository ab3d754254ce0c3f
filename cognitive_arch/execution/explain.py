"""Why a task could not be finished, in a form a person can act on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from cognitive_arch.planning.diagnosis import Diagnosis, LiteralDiagnosis, Verdict, diagnose
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import Goal, GroundAction, State


class EndReason(StrEnum):
    """How an episode ended."""

    GOAL_REACHED = "goal_reached"
    NO_PLAN = "no_plan"  # the planner sees no way from here
    MISSING_OBJECT = "missing_object"  # the goal speaks of something that is not there
    ACTION_LIMIT = "action_limit"  # too many actions were attempted
    HELP_ASKED = "help_asked"  # to go on is expected to cost more than help


@dataclass(frozen=True, slots=True)
class Attempts:
    """How often an action was tried for a sub-goal, and how often it worked."""

    action: str
    tried: int
    worked: int

    def __str__(self) -> str:
        return f"{self.action} ({self.worked} of {self.tried} worked)"


@dataclass(frozen=True, slots=True)
class FailureReport:
    """Which sub-goal was not reached, what was tried for it, what stands in the way, what is not there."""

    reason: EndReason
    subgoal: int
    attempts: tuple[Attempts, ...]
    diagnosis: Diagnosis
    absent: tuple[str, ...] = ()

    def __str__(self) -> str:
        tried = ", ".join(map(str, self.attempts)) or "nothing, for nothing promised to help"
        parts = [f"sub-goal {self.subgoal} was not reached ({self.reason})"]
        if self.absent:
            parts.append(f"it takes {' and '.join(self.absent)}, which I do not see any more")
        parts.append(f"tried: {tried}")
        if self.diagnosis.verdict is not Verdict.HOLDS:
            parts += [f"missing: {self._missing(literal)}" for literal in self.diagnosis.literals]
        return "; ".join(parts)

    def _missing(self, item: LiteralDiagnosis) -> str:
        """The plain truth about what was tried goes before what the rules promise."""
        if not item.unmet and any(a.action == str(item.action) for a in self.attempts):
            return f"{item.literal} ({item.action} should do it, but did not work)"
        return str(item)

    def to_json(self) -> dict[str, Any]:
        """Plain data, literals written out."""
        return {
            "reason": str(self.reason),
            "subgoal": self.subgoal,
            "absent": list(self.absent),
            "tried": [{"action": a.action, "tried": a.tried, "worked": a.worked} for a in self.attempts],
            **self.diagnosis.to_json(),
        }


def explain_failure(
    reason: EndReason,
    subgoal: int,
    goal: Goal,
    state: State,
    rules: Sequence[GroundRule],
    tried: Sequence[tuple[GroundAction, bool]],
    horizon: int,
    absent: tuple[str, ...] = (),
) -> FailureReport:
    """Report on `goal` (number `subgoal`, from 1) in `state`; `tried` are the attempts made for it.

    `absent` are objects that the goal needs and that are not there.
    """
    count: Counter[GroundAction] = Counter(action for action, _ in tried)
    worked: Counter[GroundAction] = Counter(action for action, ok in tried if ok)
    attempts = tuple(Attempts(str(a), n, worked[a]) for a, n in sorted(count.items()))
    return FailureReport(reason, subgoal, attempts, diagnose(state, goal, rules, horizon), absent)


def absent_entities(goal: Goal, known: Sequence[str]) -> tuple[str, ...]:
    """Names that literals of `goal` must be true of, but that are not among `known`."""
    return tuple(sorted({arg for lit in goal if lit.positive for arg in lit.atom.args} - set(known)))
