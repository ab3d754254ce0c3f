"""One suite for every planner: problems with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from cognitive_arch.errors import PlanningError
from cognitive_arch.planning.base import Planner, PlanStatus
from cognitive_arch.planning.registry import PLANNERS, make_planner
from cognitive_arch.relational.parser import parse_rules
from cognitive_arch.relational.rules import Entity, GroundOutcome, GroundRule
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State
from cognitive_arch.relational.transition import apply_literals, covering_rule
from tests.conftest import literals, state


@pytest.fixture(params=sorted(PLANNERS))
def planner(request: pytest.FixtureRequest) -> Planner:
    return make_planner(request.param)


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def certain(rules: tuple[GroundRule, ...]) -> tuple[GroundRule, ...]:
    return tuple(
        rule.with_first_probability(1.0 - sum(o.probability for o in rule.outcomes[1:])) for rule in rules
    )


def test_names_are_those_the_command_line_uses() -> None:
    assert {name: make_planner(name).name for name in PLANNERS} == {name: name for name in PLANNERS}


@pytest.mark.parametrize(
    ("goal", "first"),
    [
        (literals("inHand(Ham,LeftHand)"), "graspWith(Ham,LeftHand)"),
        (literals("not isClear(RightHand)", "inHand(Bun-top,RightHand)"), "graspWith(Bun-top,RightHand)"),
    ],
)
def test_one_step_goals(
    planner: Planner, ground: tuple[GroundRule, ...], start: State, goal: Goal, first: str
) -> None:
    result = planner.plan(start, goal, ground, 3, rng())
    assert result.status is PlanStatus.PLAN
    assert str(result.action) == first
    assert 0.9 <= result.goal_probability <= 1


def test_a_plan_reaches_its_goal_when_all_goes_well(
    planner: Planner, ground: tuple[GroundRule, ...], start: State
) -> None:
    goal = literals("on(Ham,Bun-bottom)", "isClear(LeftHand)")
    result = planner.plan(start, goal, certain(ground), 5, rng())
    current, reached = start, False
    for step in result.actions:
        rule = covering_rule(ground, step, current)
        if rule is not None:
            current = apply_literals(current, rule.outcomes[0].literals)
        reached = reached or all(lit.holds(current) for lit in goal)
    assert reached


def test_deterministic_chain_is_solved_exactly(planner: Planner) -> None:
    text = "type t\n" + "".join(f"predicate p{i}(t)\n" for i in range(4))
    for i in range(3):
        text += f"rule go{i}(x: t)\n  context\n    p{i}(x)\n  outcomes\n    1 p{i + 1}(x), not p{i}(x)\n"
    result = planner.plan(
        state("p0(X)"), literals("p3(X)"), parse_rules(text).ground([Entity("X", "t")]), 3, rng()
    )
    assert [a.name for a in result.actions] == ["go0", "go1", "go2"]
    assert result.goal_probability == pytest.approx(1.0)
    assert result.value == pytest.approx(0.95**3)


def test_impossible_goal(planner: Planner, ground: tuple[GroundRule, ...], start: State) -> None:
    result = planner.plan(start, literals("on(Ham,Unicorn)"), ground, 5, rng())
    assert result.status is PlanStatus.NO_PLAN
    assert result.actions == ()
    assert result.action is None


def test_a_horizon_too_short(planner: Planner, ground: tuple[GroundRule, ...], start: State) -> None:
    goal = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")
    assert planner.plan(start, goal, ground, 3, rng()).status is PlanStatus.NO_PLAN
    assert planner.plan(start, goal, ground, 6, rng()).status is PlanStatus.PLAN


def test_nothing_applies(planner: Planner, ground: tuple[GroundRule, ...]) -> None:
    assert planner.plan(state(), literals("inHand(Ham,LeftHand)"), ground, 5, rng()).action is None
    assert planner.plan(state(), literals("inHand(Ham,LeftHand)"), (), 5, rng()).action is None


def test_same_seed_same_plan(planner: Planner, ground: tuple[GroundRule, ...], start: State) -> None:
    goal = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")
    assert planner.plan(start, goal, ground, 6, rng()) == planner.plan(start, goal, ground, 6, rng())


def test_names_do_not_matter(planner: Planner) -> None:
    # One object, so that the order of the actions is the same under any names.
    text = "type t\npredicate p(t)\npredicate q(t)\nrule a(x: t)\n  outcomes\n    0.8 p(x)\n    0.2 noise\n"
    text += "rule b(x: t)\n  context\n    p(x)\n  outcomes\n    0.5 q(x)\n    0.5 noise\n"
    results = []
    for name in ("Ham", "Zebra"):
        rules = parse_rules(text).ground([Entity(name, "t")])
        results.append(planner.plan(state(), literals(f"q({name})"), rules, 4, rng()))
    assert [a.name for a in results[0].actions] == [a.name for a in results[1].actions]
    assert results[0].value == results[1].value


def renamed(rules: tuple[GroundRule, ...], names: dict[str, str]) -> tuple[GroundRule, ...]:
    """The same rules in the same order, about things of other names."""

    def literal(lit: Literal) -> Literal:
        return Literal(Atom(lit.atom.predicate, tuple(names[a] for a in lit.atom.args)), lit.positive)

    return tuple(
        GroundRule(
            GroundAction(rule.action.name, tuple(names[a] for a in rule.action.args)),
            tuple(map(literal, rule.context)),
            tuple(GroundOutcome(o.probability, tuple(map(literal, o.literals))) for o in rule.outcomes),
        )
        for rule in rules
    )


def test_permuted_names_change_nothing(
    planner: Planner, ground: tuple[GroundRule, ...], start: State, entities: tuple[Entity, ...]
) -> None:
    old = [entity.name for entity in entities]
    names = dict(zip(old, reversed(old), strict=True))
    goal = literals("on(Ham,Bun-bottom)", "isClear(LeftHand)")
    other = tuple(Literal(Atom(a.predicate, tuple(names[x] for x in a.args)), sign) for a, sign in goal)
    there = frozenset(Atom(a.predicate, tuple(names[x] for x in a.args)) for a in start)
    first = planner.plan(start, goal, ground, 5, rng())
    second = planner.plan(there, other, renamed(ground, names), 5, rng())
    assert second.value == first.value
    assert [a.name for a in second.actions] == [a.name for a in first.actions]
    assert [a.args for a in second.actions] == [tuple(names[x] for x in a.args) for a in first.actions]


def test_bad_problems(planner: Planner, ground: tuple[GroundRule, ...], start: State) -> None:
    with pytest.raises(PlanningError, match="horizon is 0"):
        planner.plan(start, literals("isClear(LeftHand)"), ground, 0, rng())
    with pytest.raises(PlanningError, match="goal is empty"):
        planner.plan(start, (), ground, 5, rng())
    with pytest.raises(PlanningError, match="did you mean a-prada"):
        make_planner("aprada")
