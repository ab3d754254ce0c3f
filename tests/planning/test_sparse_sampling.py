"""Sparse sampling on problems with known answers; what every planner must do is in the contract suite."""

from __future__ import annotations

import numpy as np
import pytest

from cognitive_arch.errors import PlanningError
from cognitive_arch.planning.base import PlanStatus
from cognitive_arch.planning.problem import compile_problem
from cognitive_arch.planning.sparse_sampling import SparseSampling
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import GroundAction, State
from tests.conftest import literals, state
from tests.planning.problems import renamed, renamed_action, rule

BRANCH = 20


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def action(name: str) -> GroundAction:
    return GroundAction(name, ())


class Even(np.random.Generator):
    """Draws that are spread evenly over every `BRANCH` samples, so that shares of 1/20 come out exactly."""

    def __init__(self) -> None:
        super().__init__(np.random.PCG64(0))

    def random(self, size: int) -> np.ndarray:  # type: ignore[override]
        return np.resize((np.arange(BRANCH) + 0.5) / BRANCH, size)


def test_noise_keeps_the_state_and_scales_what_comes() -> None:
    # One step before the end go is worth 0.95 * 0.8. Two steps before it, success (0.8) holds for two steps,
    # and noise (0.2) leaves three quarters of what a second attempt is worth.
    problem = compile_problem(state(), literals("p()"), [rule("go", (), (0.8, ("p()",)))])
    for scale in (0.75, 1.0):
        planner = SparseSampling(branch=BRANCH, noise_scale=scale)
        last = 0.95 * 0.8
        assert planner.action_values(problem, 1, Even()) == {action("go"): pytest.approx(last)}
        both = 0.95 * (0.8 * (1 + 0.95) + 0.2 * scale * last)
        assert planner.action_values(problem, 2, Even()) == {action("go"): pytest.approx(both)}


def test_the_best_action_counts_not_the_average() -> None:
    # After go (0.9 near) only arrive leads on; wander and doing nothing are worth 0.
    rules = [
        rule("go", (), (0.9, ("near()",)), (0.1, ("lost()",))),
        rule("arrive", ("near()", "not lost()"), (0.7, ("there()",))),
        rule("wander", ("near()",), (1.0, ("lost()",))),
    ]
    problem = compile_problem(state(), literals("there()"), rules)
    values = SparseSampling(branch=BRANCH).action_values(problem, 2, Even())
    assert values[action("go")] == pytest.approx(0.95 * 0.9 * 0.95 * 0.7)


def test_the_better_of_two_ways() -> None:
    rules = [
        rule("straight", ("not lost()",), (0.5, ("there()",)), (0.5, ("lost()",))),
        rule("detour", ("not lost()",), (0.9, ("near()",))),
        rule("arrive", ("near()", "not lost()"), (0.95, ("there()",))),
    ]
    planner = SparseSampling(branch=BRANCH)
    assert [a.name for a in planner.plan(state(), literals("there()"), rules, 4, rng()).actions] == [
        "detour",
        "arrive",
    ]
    assert planner.plan(state(), literals("there()"), rules, 1, rng()).actions == (action("straight"),)


def test_a_stack_of_three(ground: tuple[GroundRule, ...], start: State) -> None:
    goal = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")
    for seed in range(5):
        plan = SparseSampling().plan(start, goal, ground, 6, rng(seed))
        assert len(plan.actions) >= 4
        assert plan.goal_probability == pytest.approx(0.95**2 * 0.7**2)


def test_no_plan_where_doing_nothing_is_as_good(ground: tuple[GroundRule, ...], start: State) -> None:
    held = SparseSampling().plan(start, literals("isClear(LeftHand)"), ground, 3, rng())
    assert held.status is PlanStatus.NO_PLAN
    assert held.value == pytest.approx(1 + 0.95 + 0.95**2 + 0.95**3)
    overlapping = [rule("go", (), (1.0, ("p()",))), rule("go", ("q()",), (1.0, ("p()",)))]
    plan = SparseSampling().plan(state("q()"), literals("p()"), overlapping, 3, rng())
    assert plan.status is PlanStatus.NO_PLAN


def test_same_seed_same_plan_under_any_names(ground: tuple[GroundRule, ...], start: State) -> None:
    goal = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")
    plan = SparseSampling().plan(start, goal, ground, 6, rng(3))
    assert plan == SparseSampling().plan(start, goal, ground, 6, rng(3))
    other = SparseSampling().plan(*renamed(start, goal, ground), 6, rng(3))
    assert other.actions == tuple(map(renamed_action, plan.actions))
    assert (other.value, other.goal_probability) == (plan.value, plan.goal_probability)


def test_the_look_ahead_ends_where_the_samples_do() -> None:
    # Eight switches: step t has all worlds of up to t switches turned. go leads on for four steps.
    rules = [rule(f"switch{i}", (f"not s{i}()",), (1.0, (f"s{i}()",))) for i in range(8)]
    rules += [rule(f"go{i}", (f"at{i}()",), (1.0, (f"at{i + 1}()", f"not at{i}()"))) for i in range(4)]
    for max_nodes, goal, found in (
        (100_000, "at4()", True),
        (100_000, "at2()", True),
        (1000, "at4()", False),
        (1000, "at2()", True),
    ):
        plan = SparseSampling(max_nodes=max_nodes).plan(state("at0()"), literals(goal), rules, 5, rng())
        assert (plan.status is PlanStatus.PLAN) is found
        # Where it is not looked ahead any more nothing is done, so the goal, once reached, goes on to count.
        if found:
            length = int(goal[2])
            assert plan.value == pytest.approx(sum(0.95**t for t in range(length, 6)))
    with pytest.raises(PlanningError, match="max_nodes is 3, which is too low"):
        SparseSampling(max_nodes=3).plan(state("at0()"), literals("at2()"), rules, 5, rng())


def test_the_goal_counts_to_the_horizon_though_the_look_ahead_ends() -> None:
    # go needs 2 samples, and then (not reached, by noise) 2 + 1: with room for 2, one step is looked ahead.
    problem = compile_problem(state(), literals("p()"), [rule("go", (), (1.0, ("p()",)))])
    values = SparseSampling(max_nodes=2).action_values(problem, 3, rng())
    assert values == {action("go"): pytest.approx(0.95 + 0.95**2 + 0.95**3)}


def test_bad_settings() -> None:
    with pytest.raises(PlanningError, match="0 samples per action are too few"):
        SparseSampling(branch=0)
