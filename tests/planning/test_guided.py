"""Guided search: what it prefers, what it leaves out, and that it is still PRADA."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.planning import kernels
from cognitive_arch.planning.base import PlanStatus
from cognitive_arch.planning.evaluation import evaluate
from cognitive_arch.planning.guidance import make_guidance
from cognitive_arch.planning.guided import GuidedPrada
from cognitive_arch.planning.prada import APrada, Prada
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.planning.relaxed import (
    NEVER,
    count_missing,
    literal_costs,
    make_costs,
    relax,
    relevant_rules,
)
from cognitive_arch.planning.sampling import sample_sequences
from cognitive_arch.relational.derived import derive
from cognitive_arch.relational.rules import GroundOutcome, GroundRule, GroundRules
from cognitive_arch.relational.symbols import Atom, GroundAction, Literal, State
from cognitive_arch.relational.transition import apply_literals
from tests.conftest import literals
from tests.planning.strategies import Case, problems

STACK = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")


def costs_of(problem: Problem) -> np.ndarray:
    operators = relax(problem)
    start = problem.arrays.start
    costs = make_costs(operators, len(start))
    literal_costs(operators, start, count_missing(operators, start), costs)
    return costs.cost


@settings(max_examples=150, deadline=None)
@given(problems(derived=True))
def test_what_the_relaxation_cannot_reach_no_world_reaches(case: Case) -> None:
    state, goal, rules = case
    problem = compile_problem(state, goal, rules)
    cost = dict(zip(range(len(problem.arrays.start)), costs_of(problem), strict=True))
    start = derive(state, rules.derived)
    seen, frontier = {start}, [start]
    while frontier and len(seen) < 200:
        world = frontier.pop()
        for rule, outcome in itertools.chain.from_iterable(
            ((r, o) for o in r.outcomes) for r in rules if r.applies(world)
        ):
            assert rule.action in problem.actions
            after = derive(apply_literals(world, outcome.literals), rules.derived)
            if after not in seen:
                seen.add(after)
                frontier.append(after)
    for code in cost:
        if any(problem.literal(code).holds(world) for world in seen):
            assert cost[code] < NEVER


@settings(max_examples=60, deadline=None)
@given(problems(derived=True), st.integers(0, 2**32))
def test_guided_values_are_those_of_prada(case: Case, seed: int) -> None:
    problem = compile_problem(*case)
    guidance = make_guidance(problem, relax(problem), 0.75)
    draws = np.random.default_rng(seed).random((4, 20))
    choices, values, peaks = sample_sequences(problem.arrays, guidance, draws, 0.95, 0.03)
    for n in range(20):
        sequence = guidance.action[choices[:, n]]
        value, peak, _ = kernels.evaluate_sequence(problem.arrays, sequence, 0.95, 0.03)
        assert (values[n], peaks[n]) == (value, peak)


@settings(max_examples=60, deadline=None)
@given(st.booleans().flatmap(lambda derived: problems(derived=derived)), st.integers(0, 2**32))
def test_no_plan_is_missed_that_plain_sampling_finds(case: Case, seed: int) -> None:
    """Small problems, where plain sampling sees nearly every sequence; what PRADA imagines does not count."""
    rng = np.random.default_rng(seed)
    problem = compile_problem(*case)
    plain = APrada(samples=300).solve(problem, 3, rng)
    guided = GuidedPrada(samples=2000).solve(problem, 3, rng)
    if guided.status is not plain.status:
        better = plain if plain.status is PlanStatus.PLAN else guided
        truth = evaluate(problem, better.actions, rng)
        illusion = truth.peak <= truth.steps[0] + 0.05
        assert illusion if better is plain else not illusion


def test_rules_that_lead_nowhere_are_left_out(ground: tuple[GroundRule, ...], start: State) -> None:
    problem = compile_problem(start, literals("inHand(Ham,LeftHand)"), ground)
    kept = problem.keep(relevant_rules(problem, relax(problem), costs_of(problem)))
    names = {str(action) for action in kept.actions}
    assert "graspWith(Ham,LeftHand)" in names
    assert not any(name.startswith(("push", "pull")) for name in names)  # there is no tool
    assert kept.arrays.start is problem.arrays.start


def test_what_cannot_be_reached_takes_no_sample(ground: tuple[GroundRule, ...], start: State) -> None:
    rng = np.random.default_rng(0)
    before = rng.bit_generator.state
    result = GuidedPrada().plan(start, literals("on(Ham,Unicorn)"), ground, 5, rng)
    assert result.status is PlanStatus.NO_PLAN
    assert rng.bit_generator.state == before


@pytest.mark.parametrize("planner", [Prada, APrada, GuidedPrada])
def test_serial_and_parallel_give_the_same(
    planner: type[Prada], ground: tuple[GroundRule, ...], start: State
) -> None:
    results = [
        planner(workers=workers).plan(start, STACK, ground, 6, np.random.default_rng(5))
        for workers in (1, 2, 3, None)
    ]
    assert results[0].actions
    assert results.count(results[0]) == 4


def test_long_plans_are_found(ground: tuple[GroundRule, ...], start: State) -> None:
    """Both hands full of the wrong things first: six actions that have to be found."""
    full = start | {a for a, _ in literals("inHand(Bun-top,LeftHand)", "inHand(Bun-bottom,RightHand)")}
    full -= {a for a, _ in literals("isClear(LeftHand)", "isClear(RightHand)")}
    goal = (*STACK, *literals("inHand(Bun-bottom,RightHand)"))
    found = [
        GuidedPrada().plan(full, goal, ground, 8, np.random.default_rng(seed)).status for seed in range(20)
    ]
    assert found.count(PlanStatus.PLAN) == 20


def test_what_may_fail_is_tried_again(ground: tuple[GroundRule, ...], start: State) -> None:
    hard = GroundRules(
        rule.with_first_probability(0.05) if str(rule.action) == "graspWith(Ham,LeftHand)" else rule
        for rule in ground
    )
    result = GuidedPrada().plan(start, literals("inHand(Ham,LeftHand)"), hard, 5, np.random.default_rng(0))
    assert [str(action) for action in result.actions].count("graspWith(Ham,LeftHand)") >= 4


def test_an_action_that_silences_a_rival_rule_is_relevant() -> None:
    """Two rules of `go` apply at once and cancel out until `settle` keeps one of them from applying."""
    undecided, done = Atom("undecided", ()), Atom("done", ())
    rules = (
        GroundRule(GroundAction("settle", ()), (), (GroundOutcome(1.0, (Literal(undecided, False),)),)),
        GroundRule(GroundAction("go", ()), (Literal(undecided),), (GroundOutcome(1.0, ()),)),
        GroundRule(GroundAction("go", ()), (), (GroundOutcome(1.0, (Literal(done),)),)),
    )
    result = GuidedPrada().plan(frozenset({undecided}), (Literal(done),), rules, 2, np.random.default_rng(0))
    assert [action.name for action in result.actions] == ["settle", "go"]
