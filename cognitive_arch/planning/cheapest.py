"""The cheapest way: the sequence of actions with the least expected number of attempts.

Every action is repeated until its rule's first outcome comes true, so with success probability p it costs
1 / p attempts. The search is A* over the worlds that first outcomes lead to. What guides it is the landmark
cut (Helmert and Domshlak 2009), which never promises too little, so the way it finds is the cheapest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.planning.cheapest_kernels import FOUND, search
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.planning.relaxed import relax
from cognitive_arch.relational.rules import GroundRule, GroundRules
from cognitive_arch.relational.symbols import Goal, GroundAction, State

MOST_WORLDS = 20_000
"""A search that has looked at so many worlds gives up."""

KEPT = 20_000
"""Ways that are remembered: the same questions come again in every episode of a sweep."""

Words = NDArray[np.uint64]


class Way(NamedTuple):
    """Actions to the goal, and the attempts that each is expected to take."""

    actions: tuple[GroundAction, ...]
    attempts: tuple[float, ...]

    @property
    def cost(self) -> float:
        """Expected attempts altogether."""
        return sum(self.attempts)


def cheapest_way(
    state: State,
    goal: Goal,
    rules: Sequence[GroundRule],
    chance: Callable[[GroundAction], float],
    limit: float = float("inf"),
) -> Way | None:
    """The cheapest way from `state` to `goal`; None if there is none within `limit` expected attempts.

    `chance` tells how likely an action is to work, in (0, 1]. Rules with derived atoms are none of ours here.
    """
    key = tuple(chance(rule.action) for rule in rules)
    return _search(state, goal, _Same(rules), key, limit)


@lru_cache(maxsize=KEPT)
def _search(state: State, goal: Goal, rules: _Same, chances: tuple[float, ...], limit: float) -> Way | None:
    chance = {rule.action: p for rule, p in zip(rules.rules, chances, strict=True)}
    problem = compile_problem(state, goal, _first_outcomes(rules))
    prices = np.array([1.0 / chance[rule.action] for rule in problem.rules])
    operators = relax(problem)
    operators = operators._replace(cost=prices[operators.rule])
    arrays = problem.arrays
    path, status = search(
        _words(problem, [(np.flatnonzero(arrays.start[1::2] > 0.5) * 2 + 1).astype(np.int32)], 1)[0],
        *(_words(problem, _contexts(problem), sign) for sign in (1, 0)),
        *(_words(problem, _changes(problem), sign) for sign in (1, 0)),
        *(_words(problem, [arrays.goal], sign)[0] for sign in (1, 0)),
        prices,
        operators,
        arrays.goal,
        limit,
        MOST_WORLDS,
    )
    if status != FOUND:
        return None
    chosen = path.tolist()
    return Way(tuple(problem.rules[i].action for i in chosen), tuple(float(prices[i]) for i in chosen))


def _contexts(problem: Problem) -> list[NDArray[np.int32]]:
    a = problem.arrays
    return [a.context[a.context_ptr[r] : a.context_ptr[r + 1]] for r in range(len(problem.rules))]


def _changes(problem: Problem) -> list[NDArray[np.int32]]:
    """The literals of every rule's only outcome."""
    a = problem.arrays
    return [a.change[a.change_ptr[r] : a.change_ptr[r + 1]] for r in range(len(problem.rules))]


def _words(problem: Problem, rows: Sequence[NDArray[np.int32]], sign: int) -> Words:
    """The atoms of the literals of this sign, as bits: (n_rows, n_words)."""
    bits = np.zeros((len(rows), -(-max(len(problem.atoms), 1) // 64) * 64), dtype=np.uint8)
    for n, literals in enumerate(rows):
        bits[n, [literal >> 1 for literal in literals if (literal & 1) == sign]] = 1
    return np.packbits(bits, axis=1, bitorder="little").view(np.uint64)


class _Same:
    """Rules as a key: equal only to themselves."""

    def __init__(self, rules: Sequence[GroundRule]) -> None:
        self.rules = rules

    def __hash__(self) -> int:
        return id(self.rules)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.rules is other.rules


@lru_cache(maxsize=4)
def _first_outcomes(key: _Same) -> GroundRules:
    """The rules with their first outcomes only, those left out that have none or change nothing."""
    useful = (rule for rule in key.rules if rule.outcomes and rule.outcomes[0].literals)
    return GroundRules(GroundRule(rule.action, rule.context, rule.outcomes[:1]) for rule in useful)
