"""Inner loops of PRADA, compiled once per machine.

Beliefs are marginals per atom, held per literal (see `problem`). One step changes only the atoms its rules
affect:  P' = P + sum over rules r of w_r (set_r - change_r P),  which is the published
P' = (1 - w_a) P + sum w_r [set_r + (1 - change_r) P]  without the cancelling terms. After a step only
the rules whose context reads a changed atom are weighed again, each afresh from its context, so that a
sequence has the same value whatever was evaluated before it.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.planning.problem import Arrays

BLOCK = 32
"""Actions per block: the masses of a block are summed again only if one of them changed."""

CLOSURE_CUT = 0.01
"""Chains less likely than this are not followed any further (as in libPRADA)."""

CLOSURE_STEPS = 20_000
"""Nor are more links than this looked at for one pair: among many certain links chains are legion."""

ATOMS, RULES, ACTIONS, ROUND = range(4)
"""Which entry of `Scratch.length` holds the length of which trail, and the running number of the refresh."""


class Scratch(NamedTuple):
    """What one thread needs to propagate beliefs.

    `prob` (2 * n_atoms,) holds the belief per literal; `own` (n_rules,) the context probabilities, `weight`
    (n_rules,) the same times that of no sibling rule applying, `mass` (n_actions,) what an action is
    sampled in proportion to, `block` its sums. The trails list what was changed, and from what, so that
    `undo` can take it back; the stamps say what a refresh has already seen.
    """

    prob: NDArray[np.float64]
    own: NDArray[np.float64]
    weight: NDArray[np.float64]
    mass: NDArray[np.float64]
    block: NDArray[np.float64]
    delta: NDArray[np.float64]
    atoms: NDArray[np.int32]
    atoms_old: NDArray[np.float64]
    rules: NDArray[np.int32]
    rules_old: NDArray[np.float64]
    actions: NDArray[np.int32]
    rule_stamp: NDArray[np.int64]
    action_stamp: NDArray[np.int64]
    length: NDArray[np.int64]


@numba.njit(cache=True, nogil=True)
def make_scratch(p, threshold, horizon):  # type: ignore[no-untyped-def]
    """Scratch space for sequences of `horizon` actions, with everything weighed at step 0."""
    n_atoms, n_rules, n_actions = len(p.start) // 2, len(p.rule_action), len(p.action_ptr) - 1
    s = Scratch(
        p.start.copy(),
        np.empty(n_rules),
        np.empty(n_rules),
        np.empty(n_actions),
        np.empty(n_actions // BLOCK + 1),
        np.zeros(n_atoms),
        np.empty(horizon * n_atoms, np.int32),
        np.empty(horizon * n_atoms),
        np.empty(horizon * n_rules, np.int32),
        np.empty(horizon * n_rules),
        np.empty(horizon * n_actions, np.int32),
        np.zeros(n_rules, np.int64),
        np.zeros(n_actions, np.int64),
        np.zeros(4, np.int64),
    )
    for rule in range(n_rules):
        s.own[rule] = _context_probability(p, s.prob, rule, threshold)
    for action in range(n_actions):
        _weigh_action(p, s, action)
    for b in range(len(s.block)):
        _sum_block(s, b)
    return s


@numba.njit(cache=True, nogil=True, forceinline=True)
def _context_probability(p, prob, rule, threshold):  # type: ignore[no-untyped-def]
    """Product of the context's marginals, cut to 0 below `threshold`."""
    weight = 1.0
    for k in range(p.context_ptr[rule], p.context_ptr[rule + 1]):
        weight *= prob[p.context[k]]
        if weight < threshold:
            return 0.0
    return weight


@numba.njit(cache=True, nogil=True, forceinline=True)
def _weigh_action(p, s, action):  # type: ignore[no-untyped-def]
    """Weights of the action's rules (no sibling applies) and the mass it is sampled with."""
    start, stop = p.action_ptr[action], p.action_ptr[action + 1]
    mass = 0.0
    for i in range(start, stop):
        weight = s.own[i]
        for j in range(start, stop):
            if j != i:
                weight *= 1.0 - s.own[j]
        s.weight[i] = weight
        if p.effect_ptr[i + 1] > p.effect_ptr[i]:
            mass += weight
    s.mass[action] = mass


@numba.njit(cache=True, nogil=True, forceinline=True)
def _sum_block(s, b):  # type: ignore[no-untyped-def]
    total = 0.0
    for action in range(b * BLOCK, min((b + 1) * BLOCK, len(s.mass))):
        total += s.mass[action]
    s.block[b] = total


@numba.njit(cache=True, nogil=True, forceinline=True)
def goal_probability(p, prob):  # type: ignore[no-untyped-def]
    """Product of the goal literals' marginals."""
    probability = 1.0
    for k in range(len(p.goal)):
        probability *= prob[p.goal[k]]
    return probability


@numba.njit(cache=True, nogil=True, forceinline=True)
def believe(s, atom, new):  # type: ignore[no-untyped-def]
    """Set the marginal of `atom`, leaving a trail."""
    old = s.prob[2 * atom + 1]
    if new != old:
        s.prob[2 * atom + 1] = new
        s.prob[2 * atom] = 1.0 - new
        s.atoms[s.length[ATOMS]] = atom
        s.atoms_old[s.length[ATOMS]] = old
        s.length[ATOMS] += 1


@numba.njit(cache=True, nogil=True, forceinline=True)
def advance(p, s, action):  # type: ignore[no-untyped-def]
    """Propagate the belief through `action`."""
    start, stop = p.action_ptr[action], p.action_ptr[action + 1]
    for rule in range(start, stop):
        if s.weight[rule] > 0.0:
            for k in range(p.effect_ptr[rule], p.effect_ptr[rule + 1]):
                atom = p.effect_atom[k]
                s.delta[atom] += s.weight[rule] * (
                    p.effect_set[k] - p.effect_change[k] * s.prob[2 * atom + 1]
                )
    mark = s.length[ATOMS]
    for k in range(p.effect_ptr[start], p.effect_ptr[stop]):
        atom = p.effect_atom[k]
        if s.delta[atom] != 0.0:
            believe(s, atom, min(1.0, max(0.0, s.prob[2 * atom + 1] + s.delta[atom])))
            s.delta[atom] = 0.0
    if len(p.derived_kind) > 0 and s.length[ATOMS] > mark:
        rederive(p, s)


@numba.njit(cache=True, nogil=True)
def rederive(p, s):  # type: ignore[no-untyped-def]
    """Bring the derived atoms up to date with the belief."""
    for d in range(len(p.derived_kind)):
        row = p.derived[p.derived_ptr[d] : p.derived_ptr[d + 1]]
        if p.derived_kind[d] == 1:
            n = row[0]
            for i in range(n):
                for j in range(n):
                    believe(s, row[1 + n * n + i * n + j], closure_probability(row, s.prob, i, j))
        else:
            believe(s, row[0], derived_probability(p.derived_kind[d], row, s.prob))


@numba.njit(cache=True, nogil=True)
def derived_probability(kind, row, prob):  # type: ignore[no-untyped-def]
    """Marginal of a conjunction or a compared count, its literals taken as independent."""
    if kind == 0:
        none = 1.0
        k = 1
        while k < len(row):
            group = 1.0
            for literal in row[k + 1 : k + 1 + row[k]]:
                group *= prob[literal]
            none *= 1.0 - group
            k += 1 + row[k]
        return 1.0 - none
    comparison, value = row[1], row[2]
    counts = np.zeros(len(row) - 2)  # probability that so many literals hold
    counts[0] = 1.0
    for i in range(3, len(row)):
        q = prob[row[i]]
        for c in range(i - 2, 0, -1):
            counts[c] = counts[c] * (1.0 - q) + counts[c - 1] * q
        counts[0] *= 1.0 - q
    total = 0.0
    for c in range(len(counts)):
        if (
            (comparison == 0 and c == value)
            or (comparison == 1 and c < value)
            or (comparison == 2 and c <= value)
            or (comparison == 3 and c > value)
            or (comparison == 4 and c >= value)
        ):
            total += counts[c]
    return min(1.0, total)


@numba.njit(cache=True, nogil=True)
def closure_probability(row, prob, source, target):  # type: ignore[no-untyped-def]
    """Probability that some chain leads from `source` to `target`, chains taken as independent."""
    n = row[0]
    none = 1.0 - prob[2 * row[1 + source * n + target] + 1]
    path = np.empty(n + 1, np.int32)  # entities of the chain so far
    upto = np.empty(n + 1)  # its probability
    following = np.zeros(n + 1, np.int32)  # which entity to try next at each depth
    used = np.zeros(n, np.bool_)
    path[0], upto[0], used[source], used[target] = source, 1.0, True, True
    depth = steps = 0
    while depth >= 0 and none > 0.0 and steps < CLOSURE_STEPS:
        steps += 1
        nxt = following[depth]
        if nxt == n:
            if depth > 0:
                used[path[depth]] = False
            depth -= 1
            continue
        following[depth] += 1
        chain = upto[depth] * prob[2 * row[1 + path[depth] * n + nxt] + 1]
        if not used[nxt] and chain > 0.0:
            none *= 1.0 - chain * prob[2 * row[1 + nxt * n + target] + 1]
            if chain > CLOSURE_CUT:
                depth += 1
                path[depth], upto[depth], following[depth], used[nxt] = nxt, chain, 0, True
    return 1.0 - none


@numba.njit(cache=True, nogil=True, forceinline=True)
def refresh(p, s, threshold, mark):  # type: ignore[no-untyped-def]
    """Weigh again the rules and actions that the atoms on the trail from `mark` on bear on."""
    s.length[ROUND] += 1
    this = s.length[ROUND]
    first = s.length[ACTIONS]
    for i in range(mark, s.length[ATOMS]):
        for k in range(p.watch_ptr[s.atoms[i]], p.watch_ptr[s.atoms[i] + 1]):
            rule = p.watch[k]
            if s.rule_stamp[rule] == this:
                continue
            s.rule_stamp[rule] = this
            own = _context_probability(p, s.prob, rule, threshold)
            if own != s.own[rule]:
                s.rules[s.length[RULES]] = rule
                s.rules_old[s.length[RULES]] = s.own[rule]
                s.length[RULES] += 1
                s.own[rule] = own
                action = p.rule_action[rule]
                if s.action_stamp[action] != this:
                    s.action_stamp[action] = this
                    s.actions[s.length[ACTIONS]] = action
                    s.length[ACTIONS] += 1
    _weigh_actions(p, s, first)


@numba.njit(cache=True, nogil=True, forceinline=True)
def _weigh_actions(p, s, mark):  # type: ignore[no-untyped-def]
    """Weigh the actions on the trail from `mark` on, and sum their blocks."""
    for i in range(mark, s.length[ACTIONS]):
        _weigh_action(p, s, s.actions[i])
    summed = -1
    for i in range(mark, s.length[ACTIONS]):
        if s.actions[i] // BLOCK != summed:  # neighbours mostly share their block
            summed = s.actions[i] // BLOCK
            _sum_block(s, summed)


@numba.njit(cache=True, nogil=True, forceinline=True)
def undo(p, s, atoms, rules, actions):  # type: ignore[no-untyped-def]
    """Go back to where the three trails had these lengths."""
    for i in range(s.length[ATOMS] - 1, atoms - 1, -1):
        s.prob[2 * s.atoms[i] + 1] = s.atoms_old[i]
        s.prob[2 * s.atoms[i]] = 1.0 - s.atoms_old[i]
    for i in range(s.length[RULES] - 1, rules - 1, -1):
        s.own[s.rules[i]] = s.rules_old[i]
    _weigh_actions(p, s, actions)
    s.length[ATOMS], s.length[RULES], s.length[ACTIONS] = atoms, rules, actions


@numba.njit(cache=True, nogil=True)
def evaluate_sequences(p, sequences, discount, threshold):  # type: ignore[no-untyped-def]
    """Values (n,), peak goal probabilities (n,) and final beliefs (n, n_atoms) of sequences (horizon, n)."""
    horizon, n = sequences.shape
    values, peaks, beliefs = np.empty(n), np.empty(n), np.empty((n, len(p.start) // 2))
    s = make_scratch(p, threshold, horizon)
    for i in range(n):
        goal = goal_probability(p, s.prob)
        values[i], peaks[i] = goal, goal
        for t in range(horizon):
            if sequences[t, i] != len(p.action_ptr) - 1:
                mark = s.length[ATOMS]
                advance(p, s, sequences[t, i])
                refresh(p, s, threshold, mark)
                goal = goal_probability(p, s.prob)
            values[i] += discount ** (t + 1) * goal
            peaks[i] = max(peaks[i], goal)
        for atom in range(beliefs.shape[1]):
            beliefs[i, atom] = s.prob[2 * atom + 1]
        undo(p, s, 0, 0, 0)
    return values, peaks, beliefs


def evaluate_sequence(
    p: Arrays, sequence: NDArray[np.int32], discount: float, threshold: float
) -> tuple[float, float, NDArray[np.float64]]:
    """Value, peak goal probability and final belief (n_atoms,) of one sequence of action numbers."""
    column = np.ascontiguousarray(sequence, dtype=np.int32)[:, None]
    values, peaks, beliefs = evaluate_sequences(p, column, discount, threshold)
    return float(values[0]), float(peaks[0]), beliefs[0]
