"""Why a task could not be finished, in a form a person can act on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum

from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import Goal, GroundAction, Literal, State


class EndReason(StrEnum):
    """How an episode ended."""

    GOAL_REACHED = "goal_reached"
    NO_PLAN = "no_plan"  # the planner sees no way from here
    MISSING_OBJECT = "missing_object"  # the goal speaks of something that is not there
    ACTION_LIMIT = "action_limit"  # too many actions were attempted


@dataclass(frozen=True, slots=True)
class MissingLiteral:
    """One goal literal that is not true, and what stands in the way of making it so.

    `action` is the action that comes closest to it, `unmet` those of its preconditions that do not hold,
    `tried` whether it was attempted; without any such action the rules know no way at all.
    """

    literal: str
    action: str | None
    unmet: tuple[str, ...]
    tried: bool = False


@dataclass(frozen=True, slots=True)
class FailureReport:
    """Which sub-goal was not reached, what was tried for it, what is missing."""

    reason: EndReason
    subgoal: int
    missing: tuple[MissingLiteral, ...]
    tried: tuple[str, ...]

    def __str__(self) -> str:
        parts = [f"sub-goal {self.subgoal} was not reached ({self.reason})"]
        parts.append("tried: " + (", ".join(self.tried) or "nothing, for nothing promised to help"))
        for item in self.missing:
            parts.append(f"missing: {item.literal} ({_way(item)})")
        return "; ".join(parts)


def _way(item: MissingLiteral) -> str:
    if item.action is None:
        return "no rule makes it true with what is here"
    if item.unmet:
        return f"{item.action} would do it, but needs {', '.join(item.unmet)}"
    if item.tried:
        return f"{item.action} should do it, but did not work"
    return f"{item.action} would do it, but does not lead to the rest of the goal"


def explain_failure(
    reason: EndReason,
    subgoal: int,
    goal: Goal,
    state: State,
    rules: Sequence[GroundRule],
    tried: Sequence[tuple[GroundAction, bool]],
) -> FailureReport:
    """Report on `goal` (number `subgoal`, from 1) in `state`; `tried` are the attempts made for it."""
    missing = tuple(
        _missing(literal, state, rules, {action for action, _ in tried})
        for literal in goal
        if not literal.holds(state)
    )
    attempts: Counter[GroundAction] = Counter(action for action, _ in tried)
    worked: Counter[GroundAction] = Counter(action for action, ok in tried if ok)
    lines = tuple(f"{a} ({worked[a]} of {n} worked)" for a, n in sorted(attempts.items()))
    return FailureReport(reason, subgoal, missing, lines)


def _missing(
    literal: Literal, state: State, rules: Sequence[GroundRule], tried: Collection[GroundAction]
) -> MissingLiteral:
    makers = [rule for rule in rules if rule.outcomes and literal in rule.outcomes[0].literals]
    if not makers:
        return MissingLiteral(str(literal), None, ())
    best = min(makers, key=lambda rule: (len(_unmet(rule, state)), rule.action not in tried, rule.action))
    unmet = tuple(map(str, _unmet(best, state)))
    return MissingLiteral(str(literal), str(best.action), unmet, best.action in tried)


def _unmet(rule: GroundRule, state: State) -> list[Literal]:
    return [literal for literal in rule.context if not literal.holds(state)]


def absent_entities(goal: Goal, known: Sequence[str]) -> tuple[str, ...]:
    """Names that literals of `goal` must be true of, but that are not among `known`."""
    return tuple(sorted({arg for lit in goal if lit.positive for arg in lit.atom.args} - set(known)))
