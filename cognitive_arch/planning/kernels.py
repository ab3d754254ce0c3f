"""Inner loops of PRADA, compiled once per machine.

All kernels take the arrays of `Problem.arrays()` first. Beliefs are marginals per atom; one step changes
only the atoms its rules affect:  P' = P + sum over rules r of w_r (set_r - change_r P),  which is the
published  P' = (1 - w_a) P + sum w_r [set_r + (1 - change_r) P]  without the cancelling terms.
"""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def _rule_weights(action_ptr, context_ptr, context_atom, context_sign, belief, threshold, weights):  # type: ignore[no-untyped-def]
    """Fill `weights` (n_rules,): context probability, cut below `threshold`, and no sibling applies."""
    for rule in range(len(context_ptr) - 1):
        weight = 1.0
        for k in range(context_ptr[rule], context_ptr[rule + 1]):
            p = belief[context_atom[k]]
            weight *= p if context_sign[k] == 1 else 1.0 - p
            if weight < threshold:
                weight = 0.0
                break
        weights[rule] = weight
    for action in range(len(action_ptr) - 1):
        start, stop = action_ptr[action], action_ptr[action + 1]
        if stop - start > 1:
            own = weights[start:stop].copy()
            for i in range(stop - start):
                for j in range(stop - start):
                    if j != i:
                        weights[start + i] *= 1.0 - own[j]


@numba.njit(cache=True, nogil=True)
def _advance(action, action_ptr, effect_ptr, effect_atom, effect_set, effect_change, weights, belief, delta):  # type: ignore[no-untyped-def]
    """Propagate `belief` (n_atoms,) in place through `action`; `delta` is scratch of the same shape."""
    start, stop = action_ptr[action], action_ptr[action + 1]
    for rule in range(start, stop):
        for k in range(effect_ptr[rule], effect_ptr[rule + 1]):
            delta[effect_atom[k]] = 0.0
    for rule in range(start, stop):
        if weights[rule] > 0.0:
            for k in range(effect_ptr[rule], effect_ptr[rule + 1]):
                atom = effect_atom[k]
                delta[atom] += weights[rule] * (effect_set[k] - effect_change[k] * belief[atom])
    for rule in range(start, stop):
        for k in range(effect_ptr[rule], effect_ptr[rule + 1]):
            atom = effect_atom[k]
            belief[atom] = min(1.0, max(0.0, belief[atom] + delta[atom]))
            delta[atom] = 0.0


@numba.njit(cache=True, nogil=True)
def _goal_probability(goal_atom, goal_sign, belief):  # type: ignore[no-untyped-def]
    probability = 1.0
    for k in range(len(goal_atom)):
        p = belief[goal_atom[k]]
        probability *= p if goal_sign[k] == 1 else 1.0 - p
    return probability


@numba.njit(cache=True, nogil=True)
def sample_sequences(  # type: ignore[no-untyped-def]
    action_ptr, context_ptr, context_atom, context_sign, effect_ptr, effect_atom, effect_set, effect_change,
    goal_atom, goal_sign, belief0, draws, discount, threshold,
):  # fmt: skip
    """Sample one action sequence per row of `draws` (n_samples, horizon), uniform in [0, 1).

    Returns sequences (n_samples, horizon) int32, with n_actions for doNothing; values (n_samples,); and
    the highest goal probability after the first step (n_samples,). An action is drawn in proportion to the
    weights of its rules that have an effect; doNothing weighs 1, and 0 at the first step. Where nothing
    applies at the first step, the sequence is doNothing throughout.
    """
    n_samples, horizon = draws.shape
    n_actions = len(action_ptr) - 1
    sequences = np.full((n_samples, horizon), n_actions, dtype=np.int32)
    values = np.empty(n_samples)
    peaks = np.empty(n_samples)
    weights = np.empty(len(context_ptr) - 1)
    delta = np.zeros(len(belief0))
    belief = np.empty(len(belief0))
    start_probability = _goal_probability(goal_atom, goal_sign, belief0)
    for n in range(n_samples):
        belief[:] = belief0
        value, peak, factor = start_probability, start_probability, 1.0
        for t in range(horizon):
            _rule_weights(action_ptr, context_ptr, context_atom, context_sign, belief, threshold, weights)
            total = 0.0 if t == 0 else 1.0
            for rule in range(len(weights)):
                if effect_ptr[rule + 1] > effect_ptr[rule]:
                    total += weights[rule]
            remaining = draws[n, t] * total
            chosen = n_actions
            for action in range(n_actions):
                mass = 0.0
                for rule in range(action_ptr[action], action_ptr[action + 1]):
                    if effect_ptr[rule + 1] > effect_ptr[rule]:
                        mass += weights[rule]
                if mass > 0.0 and remaining < mass:
                    chosen = action
                    break
                remaining -= mass
            if chosen < n_actions:
                _advance(
                    chosen, action_ptr, effect_ptr, effect_atom, effect_set, effect_change,
                    weights, belief, delta,
                )  # fmt: skip
            elif t == 0 and total > 0.0:
                # Rounding may leave the draw past the last action; doNothing is not allowed first.
                chosen = sequences[n, 0] = _last_positive(action_ptr, effect_ptr, weights)
                _advance(
                    chosen, action_ptr, effect_ptr, effect_atom, effect_set, effect_change,
                    weights, belief, delta,
                )  # fmt: skip
            sequences[n, t] = chosen
            factor *= discount
            probability = _goal_probability(goal_atom, goal_sign, belief)
            value += factor * probability
            peak = max(peak, probability)
        values[n] = value
        peaks[n] = peak
    return sequences, values, peaks


@numba.njit(cache=True, nogil=True)
def _last_positive(action_ptr, effect_ptr, weights):  # type: ignore[no-untyped-def]
    for action in range(len(action_ptr) - 2, -1, -1):
        for rule in range(action_ptr[action], action_ptr[action + 1]):
            if weights[rule] > 0.0 and effect_ptr[rule + 1] > effect_ptr[rule]:
                return action
    return len(action_ptr) - 1


@numba.njit(cache=True, nogil=True)
def evaluate_sequence(  # type: ignore[no-untyped-def]
    action_ptr, context_ptr, context_atom, context_sign, effect_ptr, effect_atom, effect_set, effect_change,
    goal_atom, goal_sign, belief0, sequence, discount, threshold,
):  # fmt: skip
    """Value, peak goal probability and final belief (n_atoms,) of one sequence of action indices."""
    n_actions = len(action_ptr) - 1
    weights = np.empty(len(context_ptr) - 1)
    delta = np.zeros(len(belief0))
    belief = belief0.copy()
    peak = _goal_probability(goal_atom, goal_sign, belief)
    value, factor = peak, 1.0
    for t in range(len(sequence)):
        if sequence[t] < n_actions:
            _rule_weights(action_ptr, context_ptr, context_atom, context_sign, belief, threshold, weights)
            _advance(
                sequence[t], action_ptr, effect_ptr, effect_atom, effect_set, effect_change,
                    weights, belief, delta,
            )  # fmt: skip
        factor *= discount
        probability = _goal_probability(goal_atom, goal_sign, belief)
        value += factor * probability
        peak = max(peak, probability)
    return value, peak, belief
