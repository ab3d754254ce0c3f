"""Laws of belief propagation, against the formulas written out in plain Python."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.planning import kernels
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.planning.sampling import sample_sequences
from cognitive_arch.relational.derived import derive
from cognitive_arch.relational.rules import GroundRules
from cognitive_arch.relational.symbols import Atom, Goal, Literal, State
from tests.planning.strategies import Case, problems

THRESHOLD = 0.03
DISCOUNT = 0.95


def product(literals: tuple[Literal, ...], belief: dict[Atom, float]) -> float:
    return math.prod(belief.get(a, 0.0) if positive else 1 - belief.get(a, 0.0) for a, positive in literals)


def reference(state: State, goal: Goal, rules: GroundRules, problem: Problem, sequence: list[int]) -> float:
    """The value of a sequence by the published update, in full at every step; no derived atoms."""
    belief = {atom: float(atom in state) for atom in problem.atoms}
    value = product(goal, belief)
    for t, number in enumerate(sequence, 1):
        if number < len(problem.actions):
            own = [rule for rule in rules if rule.action == problem.actions[number]]
            contexts = [product(rule.context, belief) for rule in own]
            contexts = [w if w >= THRESHOLD else 0.0 for w in contexts]
            weights = [
                w * math.prod(1 - other for j, other in enumerate(contexts) if j != i)
                for i, w in enumerate(contexts)
            ]
            new = {atom: (1 - sum(weights)) * p for atom, p in belief.items()}
            for weight, rule in zip(weights, own, strict=True):
                for atom, p in belief.items():
                    set_ = sum(o.probability for o in rule.outcomes if Literal(atom) in o.literals)
                    unset = sum(o.probability for o in rule.outcomes if Literal(atom, False) in o.literals)
                    new[atom] += weight * (set_ + (1 - set_ - unset) * p)
            belief = new
        value += DISCOUNT**t * product(goal, belief)
    return value


@settings(max_examples=150, deadline=None)
@given(problems(), st.integers(0, 2**32))
def test_the_tree_of_samples_gives_the_published_values(case: Case, seed: int) -> None:
    state, goal, rules = case
    problem = compile_problem(state, goal, rules)
    draws = np.random.default_rng(seed).random((4, 12))
    sequences, values, peaks = sample_sequences(problem.arrays, None, draws, DISCOUNT, THRESHOLD)
    for n in range(12):
        sequence = sequences[:, n].copy()
        again, peak, belief = kernels.evaluate_sequence(problem.arrays, sequence, DISCOUNT, THRESHOLD)
        assert (values[n], peaks[n]) == (again, peak)
        assert np.isclose(again, reference(state, goal, rules, problem, sequence.tolist()), atol=1e-12)
        assert ((belief >= 0) & (belief <= 1)).all()


@settings(max_examples=60, deadline=None)
@given(problems(derived=True), st.integers(0, 2**32))
def test_derived_atoms_along_sampled_sequences(case: Case, seed: int) -> None:
    problem = compile_problem(*case)
    draws = np.random.default_rng(seed).random((3, 8))
    sequences, values, peaks = sample_sequences(problem.arrays, None, draws, DISCOUNT, THRESHOLD)
    for n in range(8):
        again, peak, belief = kernels.evaluate_sequence(
            problem.arrays, sequences[:, n].copy(), DISCOUNT, THRESHOLD
        )
        assert (values[n], peaks[n]) == (again, peak)
        assert ((belief >= -1e-12) & (belief <= 1 + 1e-12)).all()


@settings(max_examples=150, deadline=None)
@given(problems(derived=True, certain=True), st.lists(st.integers(0, 3), max_size=4))
def test_certain_worlds_have_certain_derived_atoms(case: Case, numbers: list[int]) -> None:
    """Where every outcome is certain, the beliefs are the world, derived atoms included."""
    state, goal, rules = case
    problem = compile_problem(state, goal, rules, simplify=False)
    sequence = [n % (len(problem.actions) + 1) for n in numbers]
    _, _, belief = kernels.evaluate_sequence(
        problem.arrays, np.array(sequence, np.int32), DISCOUNT, THRESHOLD
    )
    world = derive(state, rules.derived)
    for number in sequence:
        if number == problem.idle:
            continue
        covering = [r for r in rules if r.action == problem.actions[number] and r.applies(world)]
        if len(covering) == 1:
            changes = covering[0].outcomes[0].literals
            world = world - {a for a, positive in changes if not positive}
            world = derive(world | {a for a, positive in changes if positive}, rules.derived)
    assert {a for a, p in zip(problem.atoms, belief, strict=True) if p > 0.5} == world & set(problem.atoms)
    assert set(np.round(belief, 12)) <= {0.0, 1.0}
