"""UCT on problems with known answers; what every planner must do is in the contract suite."""

from __future__ import annotations

import numpy as np
import pytest

from cognitive_arch.errors import PlanningError
from cognitive_arch.planning import worlds
from cognitive_arch.planning.base import PlanStatus
from cognitive_arch.planning.evaluation import evaluate_exactly
from cognitive_arch.planning.problem import compile_problem
from cognitive_arch.planning.uct import Uct
from cognitive_arch.relational.derived import Closure
from cognitive_arch.relational.rules import GroundRule, GroundRules
from cognitive_arch.relational.symbols import GroundAction, State
from tests.conftest import literals, state
from tests.planning.problems import renamed, renamed_action, rule


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def action(name: str) -> GroundAction:
    return GroundAction(name, ())


def test_the_better_of_two_ways() -> None:
    # Straight on reaches the goal with 0.5, and all is lost if not; the detour takes a step more and
    # reaches it with 0.9 * 0.95 or better. With a single step left there is no time for it.
    rules = [
        rule("straight", ("not lost()",), (0.5, ("there()",)), (0.5, ("lost()",))),
        rule("detour", ("not lost()",), (0.9, ("near()",))),
        rule("arrive", ("near()", "not lost()"), (0.95, ("there()",))),
    ]
    plan = Uct().plan(state(), literals("there()"), rules, 4, rng())
    assert [a.name for a in plan.actions] == ["detour", "arrive"]
    plan = Uct().plan(state(), literals("there()"), rules, 1, rng())
    assert [a.name for a in plan.actions] == ["straight"]


def test_a_stack_of_three(ground: tuple[GroundRule, ...], start: State) -> None:
    # At best two grasps and two puts succeed: 0.95^2 * 0.7^2.
    goal = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")
    for seed in range(5):
        plan = Uct().plan(start, goal, ground, 6, rng(seed))
        assert len(plan.actions) >= 4
        assert plan.goal_probability == pytest.approx(0.95**2 * 0.7**2)


def test_the_result_is_what_the_plan_achieves(ground: tuple[GroundRule, ...], start: State) -> None:
    goal = literals("on(Ham,Bun-bottom)")
    plan = Uct().plan(start, goal, ground, 5, rng())
    problem = compile_problem(start, goal, ground)
    sequence = [problem.actions.index(a) for a in plan.actions]
    exact = evaluate_exactly(problem, sequence, horizon=5)
    assert (plan.value, plan.goal_probability) == (exact.value, exact.peak)


def test_noise_keeps_the_state_and_scales_what_comes() -> None:
    # The goal is lost with 0.6; noise (0.4) keeps it, at 0.75 of its worth: Q = 0.95 * 0.4 * 0.75.
    rules = [rule("shake", (), (0.6, ("not p()",)))]
    problem = compile_problem(state("p()"), literals("p()"), rules)
    share = rng().random((20_000, 1, 2))[:, 0, 1] >= 0.6  # the draws that the planner will make
    for scale in (0.75, 1.0):
        values = Uct(samples=20_000, noise_scale=scale).action_values(problem, 1, rng())
        assert values == {action("shake"): pytest.approx(0.95 * share.mean() * scale)}
        assert values[action("shake")] == pytest.approx(0.95 * 0.4 * scale, abs=0.015)


def test_returns_are_discounted_sums_over_the_steps() -> None:
    # Nothing but go is allowed first; whatever comes after it, the goal holds: 0.95 + 0.95^2 + 0.95^3.
    problem = compile_problem(state(), literals("p()"), [rule("go", (), (1.0, ("p()",)))])
    values = Uct(samples=50).action_values(problem, 3, rng())
    assert values == {action("go"): pytest.approx(0.95 + 0.95**2 + 0.95**3)}


def test_an_action_with_two_applying_rules_is_no_choice() -> None:
    rules = [rule("go", (), (1.0, ("p()",))), rule("go", ("q()",), (1.0, ("p()",)))]
    assert Uct().plan(state("q()"), literals("p()"), rules, 3, rng()).status is PlanStatus.NO_PLAN
    assert Uct().plan(state(), literals("p()"), rules, 3, rng()).actions == (action("go"),)


def test_what_holds_already_needs_no_plan(ground: tuple[GroundRule, ...], start: State) -> None:
    plan = Uct().plan(start, literals("isClear(LeftHand)"), ground, 3, rng())
    assert plan.status is PlanStatus.NO_PLAN
    assert plan.goal_probability == 1.0
    assert plan.value == pytest.approx(1 + 0.95 + 0.95**2 + 0.95**3)


def test_waiting_is_a_choice_after_the_first_step() -> None:
    # Once the light is on there is nothing good left to do, and the value is that of leaving it at that.
    rules = [rule("light", (), (1.0, ("lit()",))), rule("smash", (), (1.0, ("broken()",)))]
    plan = Uct().plan(state(), literals("lit()", "not broken()"), rules, 4, rng())
    assert plan.actions == (action("light"),)
    assert plan.value == pytest.approx(0.95 + 0.95**2 + 0.95**3 + 0.95**4)


def test_derived_atoms_open_the_way() -> None:
    rules = GroundRules(
        [
            rule("low", (), (1.0, ("on(B,C)",))),
            rule("high", ("on(B,C)",), (1.0, ("on(A,B)",))),
            rule("finish", ("above(A,C)",), (1.0, ("done()",))),
        ],
        (Closure("above", "on", ("A", "B", "C")),),
    )
    plan = Uct().plan(state(), literals("done()"), rules, 4, rng())
    assert [a.name for a in plan.actions] == ["low", "high", "finish"]


def test_same_seed_same_plan_under_any_names(ground: tuple[GroundRule, ...], start: State) -> None:
    goal = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")
    plan = Uct().plan(start, goal, ground, 6, rng(3))
    assert plan == Uct().plan(start, goal, ground, 6, rng(3))
    other = Uct().plan(*renamed(start, goal, ground), 6, rng(3))
    assert other.actions == tuple(map(renamed_action, plan.actions))
    assert (other.value, other.goal_probability) == (plan.value, plan.goal_probability)


def test_bad_settings() -> None:
    with pytest.raises(PlanningError, match="0 episodes are too few"):
        Uct(samples=0)
    with pytest.raises(PlanningError, match="exploration constant is -1"):
        Uct(exploration=-1)


def test_worlds_are_told_apart_by_their_whole_keys() -> None:
    keys = rng().integers(0, 3, (2000, 3)).astype(np.uint64)  # few distinct ones, many near each other
    table = worlds.make_table(27, 3)
    numbers: dict[tuple[int, ...], int] = {}
    for key in keys:
        number = worlds.number_of(table, key)
        assert numbers.setdefault(tuple(key.tolist()), number) == number
    assert sorted(numbers.values()) == list(range(27))
    assert worlds.number_of(table, np.array([7, 7, 7], dtype=np.uint64)) == worlds.NOTHING
