"""What a given sequence of actions achieves: by enumeration of its outcomes, or by trying it many times.

PRADA estimates the same numbers from products of marginals; these evaluators do not, so that plans of any
planner can be compared by one measure.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PlanningError, one_line
from cognitive_arch.planning import worlds
from cognitive_arch.planning.problem import Problem
from cognitive_arch.relational.symbols import DO_NOTHING, GroundAction

DISCOUNT = 0.95
MAX_WORLDS = 100_000
SAMPLES = 10_000
LISTED = 5
"""How many valid actions an error message names."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What a sequence achieves.

    `steps` are the probabilities that the goal holds at step 0, 1, ... up to the horizon; `ever` that it
    holds at one of them; `value` is their discounted sum, which compares with `PlanResult.value`. `samples`
    is 0 and `standard_error`, that of `final`, is 0 if the numbers are exact.
    """

    steps: tuple[float, ...]
    ever: float
    value: float
    exact: bool
    samples: int
    standard_error: float

    @property
    def final(self) -> float:
        """The probability that the goal holds after the last action."""
        return self.steps[-1]

    @property
    def peak(self) -> float:
        """The highest probability of the goal along the sequence, as in `PlanResult.goal_probability`."""
        return max(self.steps)


def evaluate(
    problem: Problem,
    actions: Sequence[GroundAction],
    rng: np.random.Generator,
    *,
    horizon: int | None = None,
    discount: float = DISCOUNT,
    known: Collection[GroundAction] = (),
    max_worlds: int = MAX_WORLDS,
    samples: int = SAMPLES,
) -> Evaluation:
    """Evaluate `actions`, exactly if there are at most `max_worlds` worlds on the way, else by `samples`.

    `known` are further actions that exist: those whose rules can never apply are not in `problem`, and they
    change nothing. Raises `PlanningError` for any other action, and as `evaluate_exactly` does.
    """
    sequence = [_number(problem, action, known) for action in actions]
    return evaluate_numbers(
        problem, sequence, rng, horizon=horizon, discount=discount, max_worlds=max_worlds, samples=samples
    )


def evaluate_numbers(
    problem: Problem,
    sequence: Sequence[int],
    rng: np.random.Generator,
    *,
    horizon: int | None = None,
    discount: float = DISCOUNT,
    max_worlds: int = MAX_WORLDS,
    samples: int = SAMPLES,
) -> Evaluation:
    """`evaluate` for actions given by their numbers in `problem`."""
    exact = _enumerate(problem, sequence, max_worlds, horizon, discount)
    if exact is not None:
        return exact
    return evaluate_by_sampling(problem, sequence, rng, samples, horizon, discount)


def evaluate_exactly(
    problem: Problem,
    sequence: Sequence[int],
    max_worlds: int = MAX_WORLDS,
    horizon: int | None = None,
    discount: float = DISCOUNT,
) -> Evaluation:
    """Enumerate all outcomes of the actions numbered `sequence`; worlds that are equal are merged.

    After the sequence nothing is done up to `horizon`. Raises `PlanningError` if there are more than
    `max_worlds` worlds, summed over the steps, or if `sequence` does not fit `horizon` or `problem`.
    """
    evaluation = _enumerate(problem, sequence, max_worlds, horizon, discount)
    if evaluation is None:
        raise PlanningError(
            f"{len(sequence)} actions lead to more than {max_worlds} worlds; raise the limit or sample them"
        )
    return evaluation


def evaluate_by_sampling(
    problem: Problem,
    sequence: Sequence[int],
    rng: np.random.Generator,
    samples: int = SAMPLES,
    horizon: int | None = None,
    discount: float = DISCOUNT,
) -> Evaluation:
    """Carry out the actions numbered `sequence` `samples` times; `horizon` as in `evaluate_exactly`."""
    if samples < 1:
        raise PlanningError(f"{samples} samples are too few; valid: 1 or more")
    numbers, idle_steps = _checked(problem, sequence, horizon)
    counts, ever = _sample_worlds(problem.arrays, numbers, rng.random((samples, len(numbers))))
    # One success and one failure more, lest a handful of equal samples claim certainty.
    share = (counts[-1] + 1) / (samples + 2)
    error = math.sqrt(share * (1 - share) / samples)
    return _evaluation(counts / samples, ever / samples, idle_steps, discount, samples, error)


def _enumerate(
    problem: Problem, sequence: Sequence[int], max_worlds: int, horizon: int | None, discount: float
) -> Evaluation | None:
    """See `evaluate_exactly`; None if there are too many worlds."""
    if max_worlds < 1:
        raise PlanningError(f"the limit of {max_worlds} worlds is too low; valid: 1 or more")
    numbers, idle_steps = _checked(problem, sequence, horizon)
    fits, goal, ever = _enumerate_worlds(problem.arrays, numbers, max_worlds)
    return _evaluation(goal, ever, idle_steps, discount, 0, 0.0) if fits else None


def _checked(problem: Problem, sequence: Sequence[int], horizon: int | None) -> tuple[NDArray[np.int32], int]:
    """The sequence as an array, and for how many steps nothing is done after it."""
    bad = [number for number in sequence if not 0 <= number <= problem.idle]
    if bad:
        raise PlanningError(f"there is no action number {bad[0]}; valid: 0 to {problem.idle}")
    if horizon is not None and horizon < len(sequence):
        raise PlanningError(f"{len(sequence)} actions do not fit a horizon of {horizon}")
    idle_steps = 0 if horizon is None else horizon - len(sequence)
    return np.array(sequence, dtype=np.int32), idle_steps


def _evaluation(
    goal: NDArray[np.float64], ever: float, idle_steps: int, discount: float, samples: int, error: float
) -> Evaluation:
    steps = np.append(goal, np.full(idle_steps, goal[-1])).clip(0.0, 1.0)
    value = float(steps @ discount ** np.arange(len(steps)))
    return Evaluation(tuple(steps.tolist()), min(1.0, float(ever)), value, samples == 0, samples, error)


def _number(problem: Problem, action: GroundAction, known: Collection[GroundAction]) -> int:
    """The number of `action`; that of doing nothing if it can never apply."""
    if action in problem.actions:
        return problem.actions.index(action)
    if action == DO_NOTHING or action in known:
        return problem.idle
    names = [str(valid) for valid in dict.fromkeys((*problem.actions, *known, DO_NOTHING))]
    near = difflib.get_close_matches(str(action)[:200], names, n=LISTED, cutoff=0.0)
    more = f" and {len(names) - len(near)} more" if len(names) > len(near) else ""
    raise PlanningError(f"unknown action '{one_line(action, 60)}'; valid: {', '.join(near)}{more}")


@numba.njit(cache=True, nogil=True)
def _enumerate_worlds(p, sequence, max_worlds):  # type: ignore[no-untyped-def]
    """Whether the worlds fit, goal probability per step (len + 1,), and probability that it ever holds.

    Worlds of a step have consecutive numbers. The tag of a world is the step, doubled, plus 1 if the goal
    has held on the way: histories that differ in this must not be merged.
    """
    w = worlds.make_world(p)
    tag = len(w.key) - 1
    table = worlds.make_table(max_worlds, len(w.key))
    probability = np.zeros(max_worlds)
    w.key[tag] = np.uint64(1 if worlds.goal_holds(p, w) else 0)
    probability[worlds.number_of(table, w.key)] = 1.0
    goal = np.zeros(len(sequence) + 1)
    first = 0
    for t in range(len(sequence)):
        end = table.size[0]
        for i in range(first, end):
            worlds.load(w, table.keys[i])
            held = w.key[tag] & np.uint64(1)
            if worlds.goal_holds(p, w):
                goal[t] += probability[i]
            if not _branch(p, w, np.int64(sequence[t]), probability, i, table, t, held):
                return False, goal, 0.0
        first = end
    ever = 0.0
    for i in range(first, table.size[0]):
        worlds.load(w, table.keys[i])
        if worlds.goal_holds(p, w):
            goal[-1] += probability[i]
        if w.key[tag] & np.uint64(1):
            ever += probability[i]
    return True, goal, ever


@numba.njit(cache=True, nogil=True)
def _branch(p, w, action, probability, i, table, t, held):  # type: ignore[no-untyped-def]
    """Pass the probability of world `i` on to what `action` makes of it; False if there is no room."""
    rule = worlds.NOTHING
    if action < len(p.action_ptr) - 1:
        rule = worlds.covering(p, w, action)
    kept = 1.0
    if rule != worlds.NOTHING:
        for outcome in range(p.outcome_ptr[rule], p.outcome_ptr[rule + 1]):
            share = p.outcome_probability[outcome]
            kept -= share
            worlds.apply_outcome(p, w, np.int64(outcome))
            room = _pass_on(p, w, table, probability, i, share, t, held)
            worlds.undo(w)
            if not room:
                return False
    if kept > 1e-12:  # what is left of 1 after the listed outcomes, but for rounding
        return _pass_on(p, w, table, probability, i, kept, t, held)
    return True


@numba.njit(cache=True, nogil=True)
def _pass_on(p, w, table, probability, i, share, t, held):  # type: ignore[no-untyped-def]
    """Add `share` of the probability of world `i` to what `w` is at step `t + 1`."""
    if share <= 0.0:
        return True
    ever = np.uint64(1) if worlds.goal_holds(p, w) else held
    w.key[-1] = np.uint64(2 * (t + 1)) | ever
    number = worlds.number_of(table, w.key)
    if number == worlds.NOTHING:
        return False
    probability[number] += share * probability[i]
    return True


@numba.njit(cache=True, nogil=True)
def _sample_worlds(p, sequence, draws):  # type: ignore[no-untyped-def]
    """In how many runs, one per row of `draws` (n_samples, len), the goal held at each step, and ever."""
    w = worlds.make_world(p)
    start = w.key.copy()
    counts = np.zeros(len(sequence) + 1)
    ever = 0
    idle = len(p.action_ptr) - 1
    for i in range(len(draws)):
        worlds.load(w, start)
        goal = worlds.goal_holds(p, w)
        counts[0] += goal
        held = goal
        for t in range(len(sequence)):
            rule = worlds.NOTHING
            if sequence[t] < idle:
                rule = worlds.covering(p, w, np.int64(sequence[t]))
            if rule != worlds.NOTHING:
                outcome = worlds.draw_outcome(p, rule, draws[i, t])
                if outcome != worlds.NOTHING:
                    worlds.apply_outcome(p, w, outcome)
                    w.length[0] = 0
                    goal = worlds.goal_holds(p, w)
            counts[t + 1] += goal
            held |= goal
        ever += held
    return counts, ever
