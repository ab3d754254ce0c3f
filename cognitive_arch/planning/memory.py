"""A planner that remembers its plans: for evaluations, where the same questions come again and again.

Each call gets a fresh generator with one fixed seed, as in the published system. So a plan depends on the
question alone, and to remember the answer changes nothing.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from cognitive_arch.planning.base import Planner, PlanResult, PlanStatus
from cognitive_arch.relational.rules import GroundRule, derived_of
from cognitive_arch.relational.symbols import Goal, State, parse_action

MOST_PLANS = 100_000
"""Kept at a time; those not asked for longest go first."""

Key: TypeAlias = tuple[State, Goal, int, tuple[int, ...]]


class FixedSeed:
    """Wraps `planner`; the generator it is called with is ignored in favour of `seed`.

    Without `remember` every call plans anew, and finds the same. Processes that are given the same folder
    `shared` tell each other what they found.
    """

    def __init__(
        self, planner: Planner, seed: int, remember: bool = True, shared: Path | None = None
    ) -> None:
        self._planner = planner
        self._seed = seed
        self._remember = remember
        self._plans: OrderedDict[Key, PlanResult] = OrderedDict()
        self._rules = _Numbers()
        self._shared = shared
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
            self._plans[key] = self._find(key, rules)
            if len(self._plans) > MOST_PLANS:
                self._plans.popitem(last=False)
        self._plans.move_to_end(key)
        return self._plans[key]

    def _find(self, key: Key, rules: Sequence[GroundRule]) -> PlanResult:
        """The plan that another process has found, or else our own, told to the others."""
        state, goal, horizon, numbers = key
        if self._shared is None:
            return self._plan(state, goal, rules, horizon)
        question = hashlib.sha256()
        parts = [self.name, self._seed, horizon, *map(str, goal), *sorted(map(str, state))]
        for part in (*map(str, parts), *map(self._rules.digest, numbers)):
            question.update(part.encode() + b"\n")
        path = self._shared / question.hexdigest()
        if path.exists():
            return _from_json(json.loads(path.read_text(encoding="utf-8")))
        plan = self._plan(state, goal, rules, horizon)
        draft = path.with_suffix(f".{os.getpid()}")
        with suppress(OSError):  # whoever cannot read it plans himself
            draft.write_text(json.dumps(_to_json(plan)), encoding="utf-8")
            draft.replace(path)
        return plan

    def _plan(self, state: State, goal: Goal, rules: Sequence[GroundRule], horizon: int) -> PlanResult:
        self.planned += 1
        return self._planner.plan(state, goal, rules, horizon, np.random.default_rng(self._seed))


def _to_json(plan: PlanResult) -> dict[str, Any]:
    return {
        "status": str(plan.status),
        "actions": [str(action) for action in plan.actions],
        "value": plan.value,
        "goal_probability": plan.goal_probability,
    }


def _from_json(data: Mapping[str, Any]) -> PlanResult:
    actions = tuple(map(parse_action, data["actions"]))
    return PlanResult(PlanStatus(data["status"]), actions, data["value"], data["goal_probability"])


class _Numbers:
    """One number for equal rules.

    To hash a rule takes long. Rules that nothing has changed are the same objects from call to call, so a
    rule that was met is known by its identity; it is kept, lest another one take its place in memory.
    """

    def __init__(self) -> None:
        self._by_identity: dict[int, tuple[GroundRule, int]] = {}
        self._by_value: dict[GroundRule, int] = {}
        self._digests: list[str] = []

    def number(self, rule: GroundRule) -> int:
        known = self._by_identity.get(id(rule))
        if known is not None:
            return known[1]
        first = rule not in self._by_value
        number = self._by_value.setdefault(rule, len(self._by_value))
        if number == len(self._digests):
            self._digests.append(hashlib.sha256(repr(rule).encode()).hexdigest())
        if first:  # a rule made again and again, with another probability, is known by its value only
            self._by_identity[id(rule)] = (rule, number)
        return number

    def digest(self, number: int) -> str:
        """The same for equal rules in every process."""
        return self._digests[number]
