"""The planner protocol and what a planning call returns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np

from cognitive_arch.errors import PlanningError
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import DO_NOTHING, Goal, GroundAction, State


class PlanStatus(StrEnum):
    """How a planning call ended."""

    PLAN = "plan"
    NO_PLAN = "no_plan"


@dataclass(frozen=True, slots=True)
class PlanResult:
    """The best sequence found; it may hold `DO_NOTHING`, but not at its end.

    `value` is the discounted sum of goal probabilities over steps 0..horizon, `goal_probability` the
    highest probability of the goal along the sequence, both as the planner estimates them. Without a plan
    `actions` is empty and the numbers are those of doing nothing.
    """

    status: PlanStatus
    actions: tuple[GroundAction, ...]
    value: float
    goal_probability: float

    @property
    def action(self) -> GroundAction | None:
        """The action to take now."""
        return self.actions[0] if self.actions else None


class Planner(Protocol):
    """Anything that chooses the next actions.

    Law: same arguments and a generator in the same state give the same result.
    """

    @property
    def name(self) -> str:
        """What `--planner` calls it."""
        ...

    def plan(
        self,
        state: State,
        goal: Goal,
        rules: Sequence[GroundRule],
        horizon: int,
        rng: np.random.Generator,
    ) -> PlanResult:
        """Find a sequence of at most `horizon` actions that makes `goal` likely, starting from `state`.

        Derived atoms of `state` are worked out from the definitions that `rules` carry, if any.
        Raises `PlanningError` if `horizon` is below 1 or `goal` is empty.
        """
        ...


class ArrayPlanner(ABC):
    """A planner that works on a compiled `Problem`; all of ours do.

    Whoever plans more than once for one state and goal compiles the problem himself and calls `solve`.
    """

    def plan(
        self,
        state: State,
        goal: Goal,
        rules: Sequence[GroundRule],
        horizon: int,
        rng: np.random.Generator,
    ) -> PlanResult:
        """See `Planner.plan`."""
        check_problem(goal, horizon)
        return self.solve(compile_problem(state, goal, rules), horizon, rng)

    @abstractmethod
    def solve(self, problem: Problem, horizon: int, rng: np.random.Generator) -> PlanResult:
        """Plan in a compiled problem."""


def check_problem(goal: Goal, horizon: int) -> None:
    """Reject what no planner can work on; every planner calls this first."""
    if horizon < 1:
        raise PlanningError(f"the horizon is {horizon}; valid: 1 or more")
    if not goal:
        raise PlanningError("the goal is empty; a goal has at least one literal")
    for literal in goal:
        if literal.negated() in goal:
            raise PlanningError(f"the goal contradicts itself: it asks for {literal.atom} both ways")


def named_actions(problem: Problem, sequence: Sequence[int]) -> tuple[GroundAction, ...]:
    """The actions behind their numbers, without doing nothing at the end."""
    names = [*problem.actions, DO_NOTHING]
    actions = [names[i] for i in sequence]
    while actions and actions[-1] == DO_NOTHING:
        actions.pop()
    return tuple(actions)
