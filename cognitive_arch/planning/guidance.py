"""What makes guided search guided: the actions that begin a relaxed plan are sampled more often.

Along every sampled sequence an imagined world is kept in which an action either has the outcome it was
chosen for or, the more often the less likely that is, changes nothing. In that world a relaxed plan to the
goal is made (see `relaxed`), and its first actions are preferred. So what may fail is planned for once as
if it worked and once to be tried again. Beliefs and values are not touched by any of this: they remain
those of PRADA.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.planning.kernels import believe, rederive
from cognitive_arch.planning.problem import Floats, Ints, Problem
from cognitive_arch.planning.relaxed import (
    Operators,
    count_missing,
    literal_costs,
    relaxed_plan,
)


class Guidance(NamedTuple):
    """Choices are numbered: operators first, then plain actions, doing nothing last."""

    operators: Operators
    action: Ints  # (n_operators + n_actions + 1,) the action behind each choice
    hope: Floats  # (n_operators,) how often the intended outcome is imagined to happen
    rule_operator: Ints  # (n_rules,) the operator of a rule's most likely outcome with an effect, or -1
    share: float  # of the draws that follow the relaxed plan where there is one


LEAST_HOPE = 0.5
"""However unlikely an outcome is, this often the search looks at what would follow."""


class World(NamedTuple):
    """The imagined world: `prob` (2 * n_atoms,) of 0 and 1, and a trail as in `kernels.Scratch`."""

    prob: Floats
    atoms: Ints
    atoms_old: Floats
    length: NDArray[np.int64]
    missing: Ints  # (n_operators,) how many of its needed literals do not hold


def make_guidance(problem: Problem, operators: Operators, share: float) -> Guidance:
    """Guidance for `problem`, whose relaxation is `operators`."""
    a = problem.arrays
    n_actions = len(problem.actions)
    real = operators.rule >= 0
    action = np.full(len(operators.rule), n_actions, dtype=np.int32)
    action[real] = a.rule_action[operators.rule[real]]
    rule_operator = np.full(len(a.rule_action), -1, dtype=np.int32)
    likely_last = np.argsort(-operators.cost[real], kind="stable")
    rule_operator[operators.rule[real][likely_last]] = np.flatnonzero(real)[likely_last]
    choices = np.concatenate([action, np.arange(n_actions + 1, dtype=np.int32)])
    hope = np.full(len(operators.rule), LEAST_HOPE)
    hope[real] = np.maximum(LEAST_HOPE, a.outcome_probability[operators.outcome[real]])
    return Guidance(operators, choices.astype(np.int32), hope, rule_operator, share)


@numba.njit(cache=True, nogil=True)
def make_world(p, g, horizon):  # type: ignore[no-untyped-def]
    """The imagined world at step 0."""
    n_atoms = len(p.start) // 2
    return World(
        p.start.copy(),
        np.empty((horizon + 1) * n_atoms, np.int32),
        np.empty((horizon + 1) * n_atoms),
        np.zeros(1, np.int64),
        count_missing(g.operators, p.start),
    )


@numba.njit(cache=True, nogil=True)
def imagine(p, g, w, choice):  # type: ignore[no-untyped-def]
    """Let the imagined world go on as `choice` intends."""
    o = g.operators
    if choice >= len(o.cost):
        return
    mark = w.length[0]
    for k in range(o.add_ptr[choice], o.add_ptr[choice + 1]):
        believe(w, o.add[k] >> 1, float(o.add[k] & 1))
    if len(p.derived_kind) > 0:
        rederive(p, w)
    for i in range(mark, w.length[0]):
        _flipped(o, w, w.atoms[i])


@numba.njit(cache=True, nogil=True)
def forget(g, w, length):  # type: ignore[no-untyped-def]
    """Go back to where the world's trail had this length."""
    for i in range(w.length[0] - 1, length - 1, -1):
        atom = w.atoms[i]
        w.prob[2 * atom + 1] = w.atoms_old[i]
        w.prob[2 * atom] = 1.0 - w.atoms_old[i]
        _flipped(g.operators, w, atom)
    w.length[0] = length


@numba.njit(cache=True, nogil=True)
def _flipped(o, w, atom):  # type: ignore[no-untyped-def]
    for literal in (2 * atom, 2 * atom + 1):
        change = -1 if w.prob[literal] > 0.5 else 1
        for k in range(o.user_ptr[literal], o.user_ptr[literal + 1]):
            w.missing[o.user[k]] += change


@numba.njit(cache=True, nogil=True)
def find_helpful(p, g, w, c, helpful):  # type: ignore[no-untyped-def]
    """Operators that begin a relaxed plan from the imagined world, in `helpful`; as `relaxed_plan`."""
    literal_costs(g.operators, w.prob, w.missing, c)
    return relaxed_plan(g.operators, p.goal, c, helpful)


@numba.njit(cache=True, nogil=True)
def draw_helpful(g, mass, helpful, n_helpful, u):  # type: ignore[no-untyped-def]
    """A choice among the helpful operators in proportion to the mass of their actions.

    It is the operator itself if it is imagined to work, else its bare action; -1 if none has any mass.
    """
    total = 0.0
    for i in range(n_helpful):
        total += mass[g.action[helpful[i]]]
    remaining = u * total
    chosen = -1
    for i in range(n_helpful):
        own = mass[g.action[helpful[i]]]
        if own > 0.0:
            # What is left of the draw is uniform again, and decides whether it works.
            works = remaining < own * g.hope[helpful[i]]
            chosen = helpful[i] if works else len(g.hope) + g.action[helpful[i]]
            if remaining < own:
                break
            remaining -= own
    return chosen


@numba.njit(cache=True, nogil=True)
def intended(p, g, w, action):  # type: ignore[no-untyped-def]
    """The choice that stands for `action` when nothing in particular is intended by it."""
    n_operators = len(g.operators.cost)
    if action < len(p.action_ptr) - 1:
        for rule in range(p.action_ptr[action], p.action_ptr[action + 1]):
            op = g.rule_operator[rule]
            if op >= 0 and w.missing[op] == 0:
                return op
    return n_operators + action
