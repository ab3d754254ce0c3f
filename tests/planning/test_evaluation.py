"""Exact and sampled evaluation against plain enumeration, and how far PRADA's beliefs are from them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.errors import PlanningError
from cognitive_arch.planning.evaluation import (
    evaluate,
    evaluate_by_sampling,
    evaluate_exactly,
    evaluate_numbers,
)
from cognitive_arch.planning.prada import Prada
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.relational.derived import AnyOf, Closure, Comparison, CountIs, derive
from cognitive_arch.relational.parser import parse_rules
from cognitive_arch.relational.rules import Entity, GroundOutcome, GroundRule, GroundRules, derived_of
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State, satisfied
from cognitive_arch.relational.transition import apply_literals, covering_rule
from tests.conftest import action, literals, state
from tests.planning.problems import rule

PRIMITIVE = [Atom("p", (f"X{i}",)) for i in range(3)] + [
    Atom("on", (pair[0], pair[1])) for pair in ("AB", "BC", "BA")
]
DERIVED = (
    Closure("above", "on", ("A", "B", "C")),
    AnyOf(
        Atom("some", ()),
        (literals("p(X0)", "not p(X1)"), literals("p(X2)", "above(A,C)"), literals("on(B,A)")),
    ),
    CountIs(Atom("two", ()), literals("p(X0)", "p(X1)", "p(X2)", "not some()"), Comparison.GREATER_EQUAL, 2),
)
READABLE = [*PRIMITIVE, *(atom for definition in DERIVED for atom in definition.defines)]


def literal_lists(atoms: list[Atom], least: int, most: int) -> st.SearchStrategy[tuple[Literal, ...]]:
    one = st.builds(Literal, st.sampled_from(atoms), st.booleans())
    return st.lists(one, min_size=least, max_size=most).map(tuple)


@st.composite
def ground_rules(draw: st.DrawFn) -> GroundRule:
    """Rules of three actions; siblings may overlap, an outcome may make an atom both true and false."""
    name = draw(st.sampled_from("abc"))
    tenths = draw(st.lists(st.integers(1, 5), max_size=2))
    outcomes = [GroundOutcome(n / 10, draw(literal_lists(PRIMITIVE, 0, 3))) for n in tenths]
    return GroundRule(GroundAction(name, ()), draw(literal_lists(READABLE, 0, 2)), tuple(outcomes))


ACTIONS = [GroundAction(name, ()) for name in "abc"]
RULES = st.lists(ground_rules(), min_size=1, max_size=6)
STATES = st.frozensets(st.sampled_from(PRIMITIVE))
GOALS = literal_lists(READABLE, 1, 2)
SEQUENCES = st.lists(st.sampled_from(ACTIONS), max_size=4)


def paths(rules: GroundRules, current: State, actions: list[GroundAction]) -> list[tuple[float, list[State]]]:
    """Every course of events with its probability; nothing is merged."""
    if not actions:
        return [(1.0, [current])]
    covering = covering_rule(rules, actions[0], current)
    branches = [(1.0 if covering is None else covering.noise, current)]
    for outcome in () if covering is None else covering.outcomes:
        after = derive(apply_literals(current, outcome.literals), derived_of(rules))
        branches.append((outcome.probability, after))
    return [
        (share * probability, [current, *states])
        for share, after in branches
        for probability, states in paths(rules, after, actions[1:])
    ]


@settings(deadline=None, max_examples=150)
@given(rules=RULES, start=STATES, goal=GOALS, actions=SEQUENCES)
def test_exact_evaluation_is_the_sum_over_all_courses(
    rules: list[GroundRule], start: State, goal: Goal, actions: list[GroundAction]
) -> None:
    carried = GroundRules(rules, DERIVED)
    problem = compile_problem(start, goal, carried)
    result = evaluate(problem, actions, np.random.default_rng(0), known=ACTIONS)
    courses = paths(carried, derive(start, DERIVED), actions)
    held = [(p, [satisfied(goal, current) for current in states]) for p, states in courses]
    steps = [sum(p for p, goals in held if goals[t]) for t in range(len(actions) + 1)]
    assert result.exact
    assert result.steps == pytest.approx(steps, abs=1e-12)
    assert result.final == result.steps[-1]
    assert result.ever == pytest.approx(sum(p for p, goals in held if any(goals)), abs=1e-12)
    assert result.value == pytest.approx(sum(0.95**t * p for t, p in enumerate(steps)), abs=1e-12)


@settings(deadline=None, max_examples=40, derandomize=True)
@given(rules=RULES, start=STATES, goal=GOALS, actions=SEQUENCES)
def test_sampling_comes_near_the_exact_result(
    rules: list[GroundRule], start: State, goal: Goal, actions: list[GroundAction]
) -> None:
    problem = compile_problem(start, goal, GroundRules(rules, DERIVED))
    sequence = [problem.actions.index(a) if a in problem.actions else problem.idle for a in actions]
    exact = evaluate_exactly(problem, sequence)
    sampled = evaluate_by_sampling(problem, sequence, np.random.default_rng(5), 4000)
    assert not sampled.exact
    assert sampled.samples == 4000
    assert abs(sampled.final - exact.final) <= 4 * sampled.standard_error
    assert sampled.steps == pytest.approx(exact.steps, abs=4 * 0.5 / math.sqrt(4000))
    assert sampled.ever == pytest.approx(exact.ever, abs=4 * 0.5 / math.sqrt(4000))
    # The standard deviation of a bounded number is at most half its range.
    most = sum(0.95**t for t in range(len(actions) + 1))
    assert sampled.value == pytest.approx(exact.value, abs=4 * most / 2 / math.sqrt(4000))


def prada_value(problem: Problem, sequence: list[int]) -> tuple[float, float]:
    """Value and peak goal probability by PRADA's beliefs, no weight being cut."""
    return Prada(threshold=0.0)._evaluate(problem, np.array(sequence, dtype=np.int32))


@settings(deadline=None)
@given(rules=RULES, start=STATES, goal=GOALS, actions=SEQUENCES)
def test_prada_is_exact_where_nothing_is_uncertain(
    rules: list[GroundRule], start: State, goal: Goal, actions: list[GroundAction]
) -> None:
    # An outcome that names an atom twice is left out: PRADA adds up its effects on the atom.
    sure = [
        GroundRule(r.action, r.context, (GroundOutcome(1.0, r.outcomes[0].literals),))
        for r in rules
        if r.outcomes and len({lit.atom for lit in r.outcomes[0].literals}) == len(r.outcomes[0].literals)
    ]
    problem = compile_problem(start, goal, GroundRules(sure, DERIVED))
    sequence = [problem.actions.index(a) if a in problem.actions else problem.idle for a in actions]
    exact = evaluate_exactly(problem, sequence)
    assert prada_value(problem, sequence) == pytest.approx((exact.value, exact.peak), abs=1e-12)


@settings(deadline=None)
@given(
    flips=st.lists(st.tuples(st.integers(0, 2), st.booleans()), min_size=1, max_size=8),
    reads=st.lists(st.integers(0, 2), unique=True, max_size=3),
    goal=st.sampled_from(["coin(X0)", "coin(X1)", "not coin(X2)", "lamp(X0)", "not lamp(X1)", "lamp(X2)"]),
    data=st.data(),
)
def test_prada_is_exact_where_atoms_are_independent(
    flips: list[tuple[int, bool]], reads: list[int], goal: str, data: st.DataObject
) -> None:
    # Coins are tossed as often as one likes; a lamp that was off looks once at one coin only.
    rules = []
    for i in range(3):
        rules.append(rule(f"heads{i}", (), (0.3 + 0.2 * i, (f"coin(X{i})",))))
        rules.append(rule(f"tails{i}", (), (0.4, (f"not coin(X{i})",)), (0.1, (f"coin(X{i})",))))
        sign = "not " if i == 1 else ""
        rules.append(rule(f"look{i}", (f"{sign}coin(X{i})",), (0.9 - 0.3 * i, (f"lamp(X{i})",))))
    names = [f"{'heads' if up else 'tails'}{i}" for i, up in flips] + [f"look{i}" for i in reads]
    order = data.draw(st.permutations(names))
    problem = compile_problem(state("coin(X1)"), literals(goal), rules)
    sequence = [problem.actions.index(GroundAction(name, ())) for name in order]
    exact = evaluate_exactly(problem, sequence)
    assert prada_value(problem, sequence) == pytest.approx((exact.value, exact.peak), abs=1e-12)


def test_prada_underestimates_what_comes_together() -> None:
    # The put of the thesis: 0.7 on and out of the hand, 0.15 out of the hand only. Marginals are on = 0.7
    # and inHand = 1 - 0.85; their product 0.7 * 0.85 = 0.595 misses that on implies not inHand.
    rules = [
        rule("put", ("inHand()",), (0.7, ("on()", "not inHand()")), (0.15, ("not inHand()",))),
    ]
    problem = compile_problem(state("inHand()"), literals("on()", "not inHand()"), rules)
    assert evaluate_exactly(problem, [0]).final == pytest.approx(0.7)
    assert prada_value(problem, [0])[1] == pytest.approx(0.595)


def test_prada_overestimates_a_second_attempt() -> None:
    # The key is found with 0.8 and, if so, opens with 0.7. A second turn helps only where there is a key:
    # 0.8 (1 - 0.3^2) = 0.728. PRADA has the key anew for the second turn: 0.56 + (1 - 0.56) 0.56 = 0.8064.
    rules = [rule("find", (), (0.8, ("key()",))), rule("turn", ("key()",), (0.7, ("open()",)))]
    problem = compile_problem(state(), literals("open()"), rules)
    assert evaluate_exactly(problem, [0, 1, 1]).final == pytest.approx(0.728)
    assert prada_value(problem, [0, 1, 1])[1] == pytest.approx(0.8064)


def test_prada_takes_exclusive_siblings_for_independent() -> None:
    # Either rule applies, whatever the coin shows, and both make the goal true: 1. PRADA weighs each by
    # its context and by the other one's not applying, 0.6 * (1 - 0.4) and 0.4 * (1 - 0.6): 0.36 + 0.16.
    rules = [
        rule("toss", (), (0.6, ("coin()",))),
        rule("go", ("coin()",), (1.0, ("there()",))),
        rule("go", ("not coin()",), (1.0, ("there()",))),
    ]
    problem = compile_problem(state(), literals("there()"), rules)
    assert evaluate_exactly(problem, [0, 1]).final == pytest.approx(1.0)
    assert prada_value(problem, [0, 1])[1] == pytest.approx(0.52)


def test_of_two_applying_siblings_none_acts() -> None:
    rules = [rule("go", (), (1.0, ("p()",))), rule("go", ("q()",), (1.0, ("p()",)))]
    for start, expected in ((state(), 1.0), (state("q()"), 0.0)):
        problem = compile_problem(start, literals("p()"), rules)
        sampled = evaluate_by_sampling(problem, [0], np.random.default_rng(0), 50)
        assert evaluate_exactly(problem, [0]).final == sampled.final == expected


def test_noise_keeps_the_state() -> None:
    # p is lost with 0.3 and kept with 0.5 + 0.2 noise.
    rules = [rule("shake", (), (0.5, ("q()",)), (0.3, ("not p()",)))]
    problem = compile_problem(state("p()"), literals("p()"), rules)
    result = evaluate_exactly(problem, [0, 0])
    assert result.steps == pytest.approx((1.0, 0.7, 0.49))
    assert result.ever == 1.0


def test_derived_atoms_follow_each_world() -> None:
    # Both links are needed for the chain, and the count is 2 in the same worlds: 0.8 * 0.5.
    rules = GroundRules(
        [rule("low", (), (0.5, ("on(B,C)",))), rule("high", (), (0.8, ("on(A,B)",)))],
        (
            Closure("above", "on", ("A", "B", "C")),
            CountIs(Atom("both", ()), literals("on(A,B)", "on(B,C)"), Comparison.EQUAL, 2),
        ),
    )
    problem = compile_problem(state(), literals("above(A,C)", "both()"), rules)
    assert evaluate_exactly(problem, [0, 1]).final == pytest.approx(0.4)
    # PRADA multiplies the two, which are one: 0.4 * 0.4.
    assert prada_value(problem, [0, 1])[1] == pytest.approx(0.16)


def test_a_closure_with_very_many_chains_is_quick() -> None:
    # 12 entities all on each other: there are more than 12! chains, too many to follow one by one.
    names = tuple(f"X{i}" for i in range(12))
    links = [f"on({a},{b})" for a in names for b in names if a != b]
    rules = GroundRules(
        [rule("all", (), (1.0, tuple(links[1:]))), rule("first", (), (1.0, (links[0],)))],
        (Closure("above", "on", names),),
    )
    problem = compile_problem(state(), literals("above(X0,X1)", "above(X3,X3)"), rules)
    assert evaluate_exactly(problem, [0]).final == 1.0


def test_padding_does_nothing_to_the_horizon() -> None:
    problem = compile_problem(state(), literals("p()"), [rule("go", (), (0.5, ("p()",)))])
    short, padded = evaluate_exactly(problem, [0]), evaluate_exactly(problem, [0], horizon=3)
    idle = evaluate_exactly(problem, [0, problem.idle, problem.idle])
    assert short.steps == (0.0, 0.5)
    assert padded == idle
    assert padded.value == pytest.approx(0.5 * (0.95 + 0.95**2 + 0.95**3))
    sampled = evaluate_by_sampling(problem, [0], np.random.default_rng(0), 100, horizon=3)
    assert len(sampled.steps) == 4
    assert sampled.steps[1] == sampled.steps[3]


def test_ever_counts_a_goal_that_was_lost_again() -> None:
    rules = [rule("gain", (), (0.5, ("p()",))), rule("lose", (), (1.0, ("not p()",)))]
    problem = compile_problem(state(), literals("p()"), rules)
    result = evaluate_exactly(problem, [0, 1, 0])
    assert result.steps == pytest.approx((0.0, 0.5, 0.0, 0.5))
    assert (result.ever, result.peak) == pytest.approx((0.75, 0.5))
    sampled = evaluate_by_sampling(problem, [0, 1, 0], np.random.default_rng(0), 4000)
    assert sampled.ever == pytest.approx(0.75, abs=0.03)


def test_too_many_worlds() -> None:
    rules = [rule(f"toss{i}", (), (0.5, (f"coin(X{i})",))) for i in range(8)]
    problem = compile_problem(state(), literals("coin(X0)", "coin(X7)"), rules)
    sequence = list(range(8))
    worlds = sum(2**t for t in range(9))
    assert evaluate_exactly(problem, sequence, max_worlds=worlds).final == pytest.approx(0.25)
    with pytest.raises(PlanningError, match="8 actions lead to more than 510 worlds"):
        evaluate_exactly(problem, sequence, max_worlds=worlds - 1)
    sampled = evaluate_numbers(problem, sequence, np.random.default_rng(0), max_worlds=worlds - 1)
    assert not sampled.exact
    assert sampled.final == pytest.approx(0.25, abs=4 * sampled.standard_error)


def test_equal_worlds_are_merged() -> None:
    # 40 tosses of one coin: 2 worlds a step, 4 with the goal's history, not 2^40.
    rules = [rule("toss", (), (0.5, ("coin()",)), (0.5, ("not coin()",)))]
    problem = compile_problem(state(), literals("coin()"), rules)
    result = evaluate_exactly(problem, [0] * 40, max_worlds=200)
    assert result.final == pytest.approx(0.5)
    assert result.ever == pytest.approx(1 - 0.5**40, abs=1e-12)


def test_bad_arguments(ground: tuple[GroundRule, ...], start: State) -> None:
    problem = compile_problem(start, literals("inHand(Ham,LeftHand)"), ground)
    rng = np.random.default_rng(0)
    with pytest.raises(
        PlanningError, match=r"unknown action 'graspWith\(Hem,LeftHand\)'; valid: graspWith\(Ham,"
    ):
        evaluate(problem, [action("graspWith(Hem,LeftHand)")], rng)
    with pytest.raises(PlanningError, match="do not fit a horizon of 0"):
        evaluate(problem, [action("graspWith(Ham,LeftHand)")], rng, horizon=0)
    with pytest.raises(PlanningError, match="no action number -1"):
        evaluate_exactly(problem, [-1])
    with pytest.raises(PlanningError, match="no action number 99"):
        evaluate_by_sampling(problem, [99], rng)
    with pytest.raises(PlanningError, match="0 samples are too few"):
        evaluate_by_sampling(problem, [0], rng, 0)
    with pytest.raises(PlanningError, match="limit of 0 worlds"):
        evaluate_exactly(problem, [0], max_worlds=0)


def test_an_action_that_can_never_apply_changes_nothing() -> None:
    rules = parse_rules(
        "type t\npredicate p(t)\npredicate never(t)\n"
        "rule go(x: t)\n  outcomes\n    0.5 p(x)\n    0.5 noise\n"
        "rule fly(x: t)\n  context\n    never(x)\n  outcomes\n    1 p(x)\n"
    ).ground([Entity("X", "t")])
    problem = compile_problem(state(), literals("p(X)"), rules)
    plan = [action("fly(X)"), action("doNothing()"), action("go(X)")]
    result = evaluate(problem, plan, np.random.default_rng(0), known={r.action for r in rules})
    assert result.steps == (0.0, 0.0, 0.0, 0.5)
    with pytest.raises(PlanningError, match="unknown action"):
        evaluate(problem, plan, np.random.default_rng(0))
