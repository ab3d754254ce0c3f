"""The cheapest way: compared with exhaustive search, and with what is plainly so."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.planning.cheapest import cheapest_way
from cognitive_arch.relational.rules import GroundOutcome, GroundRule
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State, satisfied
from cognitive_arch.relational.transition import apply_literals
from tests.conftest import literals

ATOMS = [Atom(name, ()) for name in "abcde"]
signed = st.builds(Literal, st.sampled_from(ATOMS), st.booleans())
conjunctions = st.lists(signed, max_size=3, unique_by=lambda lit: lit.atom).map(tuple)
outcomes = st.lists(signed, min_size=1, max_size=3, unique_by=lambda lit: lit.atom).map(tuple)


@st.composite
def problems(draw: st.DrawFn) -> tuple[State, Goal, tuple[GroundRule, ...], dict[GroundAction, float]]:
    rules, chances = [], {}
    for n in range(draw(st.integers(1, 6))):
        action = GroundAction(f"act{n}", ())
        rules.append(GroundRule(action, draw(conjunctions), (GroundOutcome(0.9, draw(outcomes)),)))
        chances[action] = draw(st.sampled_from([1.0, 0.8, 0.5, 0.1]))
    start = frozenset(draw(st.sets(st.sampled_from(ATOMS))))
    goal = draw(st.lists(signed, min_size=1, max_size=3, unique_by=lambda lit: lit.atom).map(tuple))
    return start, goal, tuple(rules), chances


def least_cost(
    start: State, goal: Goal, rules: tuple[GroundRule, ...], chances: Mapping[GroundAction, float]
) -> float | None:
    """Dijkstra over all worlds."""
    count = itertools.count()
    queue, done = [(0.0, next(count), start)], set()
    while queue:
        cost, _, state = heapq.heappop(queue)
        if state in done:
            continue
        done.add(state)
        if satisfied(goal, state):
            return cost
        for rule in rules:
            if rule.applies(state):
                after = apply_literals(state, rule.outcomes[0].literals)
                heapq.heappush(queue, (cost + 1 / chances[rule.action], next(count), after))
    return None


@settings(max_examples=150, deadline=None)
@given(problems())
def test_no_way_is_cheaper(
    problem: tuple[State, Goal, tuple[GroundRule, ...], dict[GroundAction, float]],
) -> None:
    start, goal, rules, chances = problem
    best = least_cost(start, goal, rules, chances)
    way = cheapest_way(start, goal, rules, chances.__getitem__)
    assert (way is None) == (best is None)
    if way is None or best is None:
        return
    assert way.cost == pytest.approx(best)
    state = start
    for action in way.actions:
        rule = next(rule for rule in rules if rule.action == action)
        assert rule.applies(state)
        state = apply_literals(state, rule.outcomes[0].literals)
    assert satisfied(goal, state)
    assert cheapest_way(start, goal, rules, chances.__getitem__, best + 1e-9) is not None
    if best > 0:
        assert cheapest_way(start, goal, rules, chances.__getitem__, best - 0.01) is None


def test_an_unreliable_hand_is_passed_over(start: State, ground: tuple[GroundRule, ...]) -> None:
    goal = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")
    way = cheapest_way(start, goal, ground, lambda a: 0.3 if "LeftHand" in a.args else 0.9)
    assert way is not None
    assert len(way.actions) == 4
    assert all("RightHand" in action.args for action in way.actions)
    assert way.cost == pytest.approx(4 / 0.9)
