"""Why there is no plan: which goal literals cannot be reached, and what stands in the way.

The answer comes from the delete relaxation (see `relaxed`), so "cannot be reached" is certain, while
"could be reached" only means that nothing is known to forbid it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from cognitive_arch.planning.problem import Ints, Problem, compile_problem
from cognitive_arch.planning.relaxed import (
    NEVER,
    Costs,
    Operators,
    count_missing,
    literal_costs,
    make_costs,
    relax,
    relaxed_plan,
)
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import Goal, GroundAction, Literal, State


class Verdict(StrEnum):
    """Why a planner finds no plan for a goal."""

    HOLDS = "holds"  # there is nothing to plan for
    UNREACHABLE = "unreachable"  # some literal can never become true
    TOO_FAR = "too_far"  # even if nothing got undone it would take more actions than the horizon
    UNLIKELY = "unlikely"  # nothing forbids it, but no sequence makes it likely enough


class LiteralStatus(StrEnum):
    """How a literal stands that does not hold."""

    REACHABLE = "reachable"
    BLOCKED = "blocked"  # rules would make it true, but none of them can ever apply
    NO_RULE = "no_rule"  # no rule makes it true


@dataclass(frozen=True, slots=True)
class LiteralDiagnosis:
    """One goal literal that does not hold.

    `action` is what would make it true with the least trouble; `unmet` are the preconditions of that action
    which cannot be reached, or, if all can, those that do not hold yet. `roots` are the literals behind
    that in the end: what no rule makes true, or only rules that need it themselves.
    """

    literal: Literal
    status: LiteralStatus
    action: GroundAction | None
    unmet: tuple[Literal, ...]
    roots: tuple[Literal, ...]

    def __str__(self) -> str:
        unmet = ", ".join(map(str, self.unmet))
        if self.status is LiteralStatus.NO_RULE:
            return f"{self.literal} (no rule makes it true with what is here)"
        way = f"{self.action} would do it" if self.action else "it follows from other literals"
        if self.status is LiteralStatus.REACHABLE:
            return f"{self.literal} ({way}{f', but needs {unmet}' if unmet else ''})"
        deeper = [str(root) for root in self.roots if root not in self.unmet]
        because = f"; that fails for want of {', '.join(deeper)}" if deeper else ""
        return f"{self.literal} ({way}, but cannot get {unmet}{because})"

    def to_json(self) -> dict[str, Any]:
        """Plain data, literals written out."""
        return {
            "literal": str(self.literal),
            "status": str(self.status),
            "action": str(self.action) if self.action else None,
            "unmet": list(map(str, self.unmet)),
            "roots": list(map(str, self.roots)),
        }


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Why there is no plan; `steps` is how many actions it takes at least as far as the relaxation sees."""

    verdict: Verdict
    steps: int
    literals: tuple[LiteralDiagnosis, ...]

    def __str__(self) -> str:
        parts = [str(literal) for literal in self.literals]
        match self.verdict:
            case Verdict.UNREACHABLE:
                parts = [str(lit) for lit in self.literals if lit.status is not LiteralStatus.REACHABLE]
                return f"cannot be reached: {'; '.join(parts)}"
            case Verdict.TOO_FAR:
                return f"it takes about {self.steps} actions, more than the horizon: {'; '.join(parts)}"
            case Verdict.UNLIKELY:
                return f"no sequence of actions makes it likely enough: {'; '.join(parts)}"
            case Verdict.HOLDS:
                return "the goal holds already"

    def to_json(self) -> dict[str, Any]:
        """Plain data, literals written out."""
        return {
            "verdict": str(self.verdict),
            "steps": self.steps,
            "literals": [literal.to_json() for literal in self.literals],
        }


def diagnose(state: State, goal: Goal, rules: Sequence[GroundRule], horizon: int) -> Diagnosis:
    """Say why no plan of at most `horizon` actions leads from `state` to `goal`."""
    problem = compile_problem(state, goal, rules, simplify=False)
    a = problem.arrays
    operators = relax(problem)
    costs = make_costs(operators, len(a.start))
    literal_costs(operators, a.start, count_missing(operators, a.start), costs)
    inquiry = _Inquiry(problem, operators, costs)
    missing = [inquiry.literal(int(code)) for code in a.goal if a.start[code] == 0]
    reachable = relaxed_plan(operators, a.goal, costs, np.empty(len(operators.cost), np.int32)) >= 0
    used = operators.rule[costs.needed & (operators.rule >= 0)]
    steps = len(np.unique(a.rule_action[used])) if reachable else 0
    if not missing:
        verdict = Verdict.HOLDS
    elif not reachable:
        verdict = Verdict.UNREACHABLE
    else:
        verdict = Verdict.TOO_FAR if steps > horizon else Verdict.UNLIKELY
    return Diagnosis(verdict, steps, tuple(missing))


@dataclass(frozen=True)
class _Inquiry:
    """Questions to one relaxation."""

    problem: Problem
    operators: Operators
    costs: Costs

    def literal(self, code: int) -> LiteralDiagnosis:
        """How one literal of the goal stands that does not hold."""
        makers = self._makers(code)
        literal = self.problem.literal(code)
        if not len(makers):
            return LiteralDiagnosis(literal, LiteralStatus.NO_RULE, None, (), (literal,))
        best = self._best(makers)
        lost = self._unreachable(best)
        if len(lost):
            names = self._names(lost)
            return LiteralDiagnosis(
                literal, LiteralStatus.BLOCKED, self._action(best), names, self._names(self._roots(code))
            )
        needs = self._needs(best)
        open_ = needs[self.problem.arrays.start[needs] == 0]
        return LiteralDiagnosis(literal, LiteralStatus.REACHABLE, self._action(best), self._names(open_), ())

    def _makers(self, code: int) -> Ints:
        """The operators that add a literal."""
        o = self.operators
        owner = np.repeat(np.arange(len(o.cost), dtype=np.int32), np.diff(o.add_ptr))
        return owner[o.add == code]

    def _best(self, makers: Ints) -> int:
        """The maker that the least is missing for: first what can never be had, then what it costs."""
        cost = self.costs.cost

        def trouble(op: int) -> tuple[int, float]:
            needs = cost[self._needs(op)]
            return int((needs >= NEVER).sum()), float(needs[needs < NEVER].sum() + self.operators.cost[op])

        return min(makers.tolist(), key=trouble)

    def _needs(self, op: int) -> Ints:
        o = self.operators
        return o.need[o.need_ptr[op] : o.need_ptr[op + 1]]

    def _unreachable(self, op: int) -> Ints:
        needs = self._needs(op)
        return needs[self.costs.cost[needs] >= NEVER]

    def _roots(self, code: int) -> Ints:
        """Follow what cannot be reached down to where no rule helps, or where it goes round in circles."""
        roots: dict[int, None] = {}
        seen = {code}
        stack = [code]
        while stack:
            here = stack.pop()
            makers = self._makers(here)
            straight = np.array([op for op in makers if not self._circular(op, here)], dtype=np.int32)
            choice = straight if len(straight) else makers
            behind = self._unreachable(self._best(choice)).tolist() if len(choice) else []
            fresh = [literal for literal in behind if literal not in seen]
            if not fresh:
                roots[here] = None
            seen.update(fresh)
            stack.extend(fresh)
        return np.array(list(roots), dtype=np.int32)

    def _circular(self, op: int, code: int) -> bool:
        """Whether some need of `op` can itself only be had by means of the literal `code`."""
        return any(
            all(code in self._needs(maker) for maker in self._makers(need)) for need in self._unreachable(op)
        )

    def _names(self, codes: Ints) -> tuple[Literal, ...]:
        return tuple(self.problem.literal(int(code)) for code in codes)

    def _action(self, op: int) -> GroundAction | None:
        """The action behind an operator; none where an atom merely follows from others."""
        rule = self.operators.rule[op]
        return None if rule < 0 else self.problem.rules[rule].action
