"""PRADA's belief propagation and value, against numbers worked out by hand from the definitions."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from cognitive_arch import kernel_cache
from cognitive_arch.planning import kernels
from cognitive_arch.planning.base import PlanResult
from cognitive_arch.planning.compilation import warm_up
from cognitive_arch.planning.prada import APrada, Prada
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.planning.sampling import sample_sequences
from cognitive_arch.relational.derived import Closure
from cognitive_arch.relational.parser import parse_rules
from cognitive_arch.relational.rules import Entity, GroundOutcome, GroundRule, GroundRules
from cognitive_arch.relational.symbols import Atom, GroundAction, Literal, State
from tests.conftest import literals, state

TWO_RULES = """
type t
predicate p(t)
predicate q(t)
predicate r(t)
rule act(x: t)
  context
    p(x)
  outcomes
    0.6 q(x), not p(x)
    0.1 not q(x)
    0.3 noise
rule act(x: t)
  context
    not p(x), r(x)
  outcomes
    0.5 p(x)
    0.5 noise
"""


def toy() -> tuple[GroundRule, ...]:
    return parse_rules(TWO_RULES).ground([Entity("X", "t")])


def evaluate(rules: tuple[GroundRule, ...], start: State, goal: str, steps: int) -> tuple[float, float]:
    problem = compile_problem(start, literals(goal), rules)
    sequence = np.zeros(steps, dtype=np.int32)
    value, peak, _ = kernels.evaluate_sequence(problem.arrays, sequence, 0.95, 0.03)
    return value, peak


def test_one_step() -> None:
    # Only the first rule applies (weight 1): q = 0 + 0.6, p = 1 - 0.6.
    value, peak = evaluate(toy(), state("p(X)", "r(X)"), "q(X)", 1)
    assert peak == pytest.approx(0.6)
    assert value == pytest.approx(0.95 * 0.6)


def test_two_steps_with_two_rules_of_one_action() -> None:
    # Step 1: p = 0.4, q = 0.6, r = 1. Contexts: a = 0.4, b = (1 - 0.4) * 1 = 0.6.
    # Weights: w_a = 0.4 * (1 - 0.6) = 0.16, w_b = 0.6 * (1 - 0.4) = 0.36.
    # q' = (1 - 0.16 - 0.36) 0.6 + 0.16 (0.6 + (1 - 0.7) 0.6) + 0.36 * 0.6 = 0.6288
    # p' = (1 - 0.16 - 0.36) 0.4 + 0.16 (1 - 0.6) 0.4 + 0.36 (0.5 + (1 - 0.5) 0.4)
    problem = compile_problem(state("p(X)", "r(X)"), literals("q(X)"), toy())
    _, peak, belief = kernels.evaluate_sequence(problem.arrays, np.zeros(2, dtype=np.int32), 0.95, 0.03)
    after = dict(zip(map(str, problem.atoms), belief, strict=True))
    assert after["q(X)"] == pytest.approx(0.6288)
    assert peak == pytest.approx(0.6288)
    assert after["p(X)"] == pytest.approx(0.48 * 0.4 + 0.16 * 0.4 * 0.4 + 0.36 * 0.7)


def test_an_inapplicable_action_changes_nothing() -> None:
    value, peak = evaluate(toy(), state("q(X)"), "q(X)", 3)
    assert peak == 1.0
    assert value == pytest.approx(1 + 0.95 + 0.95**2 + 0.95**3)


def test_small_weights_are_cut() -> None:
    rules = parse_rules(
        "type t\npredicate p(t)\npredicate q(t)\n"
        "rule a(x: t)\n  outcomes\n    0.02 p(x)\n    0.98 noise\n"
        "rule b(x: t)\n  context\n    p(x)\n  outcomes\n    1 q(x)\n"
    ).ground([Entity("X", "t")])
    problem = compile_problem(state(), literals("q(X)"), rules)
    sequence = np.array([0, 1], dtype=np.int32)
    _, cut, _ = kernels.evaluate_sequence(problem.arrays, sequence, 0.95, 0.03)
    _, kept, _ = kernels.evaluate_sequence(problem.arrays, sequence, 0.95, 0.0)
    assert (cut, kept) == (0.0, pytest.approx(0.02))


def test_static_literals_are_decided_at_compile_time(ground: tuple[GroundRule, ...], start: State) -> None:
    problem = compile_problem(start, literals("inHand(Ham,LeftHand)"), ground)
    assert len(problem.rules) == len(ground)
    no_hands = frozenset(a for a in start if a.predicate != "isHand")
    # Without isHand no grasp and no drop can ever apply; only the twelve puts do not ask for it.
    assert len(compile_problem(no_hands, literals("inHand(Ham,LeftHand)"), ground).rules) == 12


def test_beliefs_stay_probabilities(ground: tuple[GroundRule, ...], start: State) -> None:
    problem = compile_problem(start, literals("on(Ham,Bun-bottom)"), ground)
    rng = np.random.default_rng(1)
    for _ in range(200):
        sequence = rng.integers(0, len(problem.actions) + 1, 10).astype(np.int32)
        _, peak, belief = kernels.evaluate_sequence(problem.arrays, sequence, 0.95, 0.03)
        assert belief.min() >= 0
        assert belief.max() <= 1
        assert 0 <= peak <= 1


def test_do_nothing_is_never_first(ground: tuple[GroundRule, ...], start: State) -> None:
    problem = compile_problem(start, literals("inHand(Ham,LeftHand)"), ground)
    draws = np.random.default_rng(0).random((4, 500))
    draws[:, 0] = np.nextafter(1.0, 0.0)  # the largest draw there is must not fall off the end of the list
    sequences, values, peaks = sample_sequences(problem.arrays, None, draws, 0.95, 0.03)
    idle = len(problem.actions)
    assert (sequences[0] < idle).all()
    assert (sequences[1:] == idle).any()
    assert np.isfinite(values).all()
    assert (peaks <= 1).all()


def test_sampled_values_are_those_of_their_sequences(ground: tuple[GroundRule, ...], start: State) -> None:
    problem = compile_problem(start, literals("on(Ham,Bun-bottom)"), ground)
    draws = np.random.default_rng(2).random((5, 200))
    sequences, values, peaks = sample_sequences(problem.arrays, None, draws, 0.95, 0.03)
    for sequence, value, peak in zip(sequences.T.copy(), values, peaks, strict=True):
        expected = kernels.evaluate_sequence(problem.arrays, sequence, 0.95, 0.03)
        assert (value, peak) == pytest.approx(expected[:2])


def test_actions_are_drawn_in_proportion_to_their_weights() -> None:
    rules = parse_rules(
        "type t\npredicate p(t)\npredicate q(t)\n"
        "rule a(x: t)\n  outcomes\n    1 p(x)\n"
        "rule b(x: t)\n  outcomes\n    1 q(x)\n"
    ).ground([Entity("X", "t"), Entity("Y", "t"), Entity("Z", "t")])
    problem = compile_problem(state(), literals("p(X)"), rules)
    draws = np.random.default_rng(3).random((1, 12_000))
    sequences, _, _ = sample_sequences(problem.arrays, None, draws, 0.95, 0.03)
    shares = np.bincount(sequences[0], minlength=6) / 12_000
    assert shares == pytest.approx([1 / 6] * 6, abs=0.012)


def test_shortening_raises_the_value(ground: tuple[GroundRule, ...], start: State) -> None:
    goal = literals("on(Ham,Bun-bottom)")
    for seed in range(5):
        plain = Prada(samples=300).plan(start, goal, ground, 8, np.random.default_rng(seed))
        shortened = APrada(samples=300).plan(start, goal, ground, 8, np.random.default_rng(seed))
        assert shortened.value >= plain.value - 1e-12
        assert len(shortened.actions) <= len(plain.actions)


def test_an_outcome_that_says_a_thing_twice_or_both_ways() -> None:
    atom = Atom("p", ())
    for said, chance in (((True, True), 0.5), ((True, False), 0.5), ((False, True), 0.5)):
        outcome = GroundOutcome(0.5, tuple(Literal(atom, sign) for sign in said))
        rule = GroundRule(GroundAction("a", ()), (), (outcome,))
        problem = compile_problem(frozenset(), (Literal(atom),), (rule,))
        _, peak, _ = kernels.evaluate_sequence(problem.arrays, np.zeros(1, np.int32), 0.95, 0.03)
        assert peak == chance


def test_many_certain_links_do_not_take_for_ever() -> None:
    """Thirteen things, each but the last on every other: no chain to the last, and legions of chains."""
    things = tuple(f"t{i:02d}" for i in range(13))
    links = frozenset(Atom("on", (x, y)) for x in things for y in things[:-1] if x != y)
    rule = GroundRule(
        GroundAction("put", ()), (), (GroundOutcome(0.5, (Literal(Atom("on", (things[0], things[-1]))),)),)
    )
    rules = GroundRules([rule], (Closure("above", "on", things),))
    problem = compile_problem(links, (Literal(Atom("above", (things[1], things[-1]))),), rules)
    _, peak, _ = kernels.evaluate_sequence(problem.arrays, np.zeros(1, np.int32), 0.95, 0.03)
    assert 0.4 < peak <= 1


def test_kernels_of_other_sources_lie_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "planning"
    package.mkdir()
    (package / "kernels.py").write_text("a = 1")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    first = kernel_cache.kernel_folder(package)
    assert first == kernel_cache.kernel_folder(package)
    assert first.parent == tmp_path / "cache"
    (package / "kernels.py").write_text("a = 2")
    second = kernel_cache.kernel_folder(package)
    assert second != first
    os.utime(first, (1, 1))
    assert kernel_cache.kernel_folder(package) == second
    assert not first.exists()


def test_kernels_find_a_place_where_nothing_can_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nowhere = tmp_path / "file"
    nowhere.write_text("not a folder")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(nowhere))
    monkeypatch.setenv("XDG_CACHE_HOME", str(nowhere))
    folder = kernel_cache.kernel_folder(tmp_path)
    assert folder.is_dir()
    folder.rmdir()


def test_ctrl_c_waits_for_the_compiler() -> None:
    told: list[str] = []

    class Slow(Prada):
        def solve(self, problem: Problem, horizon: int, rng: np.random.Generator) -> PlanResult:
            signal.raise_signal(signal.SIGINT)
            told.append("solved")
            return super().solve(problem, horizon, rng)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        warm_up(Slow(), told.append)
    assert told == ["stopping when the compiler is done; once more Ctrl-C stops at once ...", "solved"]
    assert signal.getsignal(signal.SIGINT) is before
