"""A planner that remembers its plans: for evaluations, where the same questions come again and again.

Each call gets a fresh generator with one fixed seed, as in the published system. So a plan depends on the
question alone, and to remember the answer changes nothing.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from cognitive_arch.planning.base import Planner, PlanResult
from cognitive_arch.relational.rules import GroundRule, derived_of
from cognitive_arch.relational.symbols import Goal, State

MOST_PLANS = 100_000
"""Kept at a time; those not asked for longest go first."""

Key: TypeAlias = tuple[State, Goal, int, tuple[int, ...]]


class FixedSeed:
    """Wraps `planner`; the generator it is called with is ignored in favour of `seed`.

    Without `remember` every call plans anew, and finds the same.
    """

    def __init__(self, planner: Planner, seed: int, remember: bool = True) -> None:
        self._planner = planner
        self._seed = seed
        self._remember = remember
        self._plans: OrderedDict[Key, PlanResult] = OrderedDict()
        self._rules = _Numbers()
        self.asked = 0
        self.planned = 0

    @property
    def name(self) -> str:
        return self._planner.name

    def plan(
        self,
        state: State,
        goal: Goal,
        rules: Sequence[GroundRule],
        horizon: int,
        rng: np.random.Generator,
    ) -> PlanResult:
        """See `Planner.plan`."""
        self.asked += 1
        if not self._remember or derived_of(rules):
            return self._plan(state, goal, rules, horizon)
        key = (state, goal, horizon, tuple(map(self._rules.number, rules)))
        if key not in self._plans:
            self._plans[key] = self._plan(state, goal, rules, horizon)
            if len(self._plans) > MOST_PLANS:
                self._plans.popitem(last=False)
        self._plans.move_to_end(key)
        return self._plans[key]

    def _plan(self, state: State, goal: Goal, rules: Sequence[GroundRule], horizon: int) -> PlanResult:
        self.planned += 1
        return self._planner.plan(state, goal, rules, horizon, np.random.default_rng(self._seed))


class _Numbers:
    """One number for equal rules.

    To hash a rule takes long. Rules that nothing has changed are the same objects from call to call, so a
    rule that was met is known by its identity; it is kept, lest another one take its place in memory.
    """

    def __init__(self) -> None:
        self._by_identity: dict[int, tuple[GroundRule, int]] = {}
        self._by_value: dict[GroundRule, int] = {}

    def number(self, rule: GroundRule) -> int:
        known = self._by_identity.get(id(rule))
        if known is not None:
            return known[1]
        first = rule not in self._by_value
        number = self._by_value.setdefault(rule, len(self._by_value))
        if first:  # a rule made again and again, with another probability, is known by its value only
            self._by_identity[id(rule)] = (rule, number)
        return number
