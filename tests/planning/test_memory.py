"""A planner that remembers: the same plans, found once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cognitive_arch.planning.memory import FixedSeed
from cognitive_arch.planning.registry import make_planner
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import State
from tests.conftest import literals

GOAL = literals("on(Ham,Bun-bottom)")


@pytest.mark.parametrize("name", ["a-prada", "guided-prada"])
def test_remembering_changes_nothing(name: str, start: State, ground: tuple[GroundRule, ...]) -> None:
    rng = np.random.default_rng(1)
    remembering, forgetful = (FixedSeed(make_planner(name), 7, remember) for remember in (True, False))
    for factor in (1.0, 0.2, 1.0, 0.2):
        rules = tuple(
            rule.with_first_probability(rule.outcomes[0].probability * factor)
            if "LeftHand" in rule.action.args
            else rule
            for rule in ground
        )
        for horizon in (2, 5, 2):
            found = [p.plan(start, GOAL, rules, horizon, rng) for p in (remembering, forgetful)]
            assert found[0] == found[1]
    assert (remembering.asked, remembering.planned) == (12, 4)
    assert (forgetful.asked, forgetful.planned) == (12, 12)


def test_what_differs_is_planned_for_anew(start: State, ground: tuple[GroundRule, ...]) -> None:
    planner = FixedSeed(make_planner("prada"), 0)
    rng = np.random.default_rng(0)
    planner.plan(start, GOAL, ground, 3, rng)
    planner.plan(start, GOAL, ground, 4, rng)
    planner.plan(start, literals("on(Bun-top,Ham)"), ground, 3, rng)
    planner.plan(start - {next(iter(sorted(start)))}, GOAL, ground, 3, rng)
    planner.plan(start, GOAL, ground[1:], 3, rng)
    assert planner.planned == 5
    planner.plan(frozenset(start), GOAL, tuple(ground), 3, rng)
    assert planner.planned == 5


def test_plans_are_shared_through_a_folder(
    start: State, ground: tuple[GroundRule, ...], tmp_path: Path
) -> None:
    one, other = (FixedSeed(make_planner("a-prada"), 3, shared=tmp_path) for _ in range(2))
    rng = np.random.default_rng(0)
    for goal in (GOAL, literals("inHand(Cheese,LeftHand)")):  # the second has no plan
        assert one.plan(start, goal, ground, 4, rng) == other.plan(start, goal, ground, 4, rng)
    assert (one.planned, other.planned) == (2, 0)
    stranger = FixedSeed(make_planner("a-prada"), 4, shared=tmp_path)
    stranger.plan(start, GOAL, ground, 4, rng)
    assert stranger.planned == 1
