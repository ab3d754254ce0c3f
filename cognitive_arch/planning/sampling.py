"""Sampling of action sequences: a tree of beliefs, walked depth first."""

from __future__ import annotations

import numba
import numpy as np

from cognitive_arch.planning.guidance import draw_helpful, find_helpful, forget, imagine, intended, make_world
from cognitive_arch.planning.kernels import (
    ACTIONS,
    ATOMS,
    BLOCK,
    RULES,
    advance,
    goal_probability,
    make_scratch,
    refresh,
    undo,
)
from cognitive_arch.planning.relaxed import make_costs


@numba.njit(cache=True, nogil=True, forceinline=True)
def draw_action(s, u, may_idle):  # type: ignore[no-untyped-def]
    """An action in proportion to its mass, by `u` in [0, 1); n_actions if that is to do nothing.

    Doing nothing weighs 1 where it is allowed; where nothing applies it is all that is left.
    """
    n_actions = len(s.mass)
    remaining = u * (np.sum(s.block) + (1.0 if may_idle else 0.0))
    for b in range(len(s.block)):
        if remaining < s.block[b]:
            for action in range(b * BLOCK, min((b + 1) * BLOCK, n_actions)):
                if remaining < s.mass[action]:
                    return action
                remaining -= s.mass[action]
            break
        remaining -= s.block[b]
    if not may_idle:
        # Rounding may leave the draw past the last action.
        for action in range(n_actions - 1, -1, -1):
            if s.mass[action] > 0.0:
                return action
    return n_actions


@numba.njit(cache=True, nogil=True)
def _sort_by(keys, order, first, end):  # type: ignore[no-untyped-def]
    """Sort order[first:end] in place so that its `keys` ascend: shell sort, for mostly it is a handful."""
    gap = 1
    while 3 * gap < end - first:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(first + gap, end):
            item, j = order[i], i
            while j >= first + gap and keys[order[j - gap]] > keys[item]:
                order[j] = order[j - gap]
                j -= gap
            order[j] = item
        gap //= 3


@numba.njit(cache=True, nogil=True)
def sample_sequences(p, guidance, draws, discount, threshold):  # type: ignore[no-untyped-def]
    """Sample one action sequence per column of `draws` (horizon, n_samples), uniform in [0, 1).

    Returns choices (horizon, n_samples) int32; values (n_samples,); and the highest goal probability along
    each (n_samples,). Without `guidance` (None) a choice is an action, n_actions being to do nothing, and is
    drawn in proportion to the weights of its rules that have an effect; doing nothing weighs 1, and 0 at
    the first step. With it, see `Guidance`. Samples that begin alike share the work up to where they part:
    they are the branches of a tree.
    """
    horizon, n_samples = draws.shape
    idle = len(p.action_ptr) - 1
    choices = np.empty((horizon, n_samples), np.int32)
    values, peaks = np.empty(n_samples), np.empty(n_samples)
    s = make_scratch(p, threshold, horizon)
    if guidance is not None:
        world = make_world(p, guidance, horizon)
        costs = make_costs(guidance.operators, len(p.start))
        helpful = np.empty(len(guidance.operators.cost), np.int32)
    order = np.arange(n_samples)
    # One node per depth: its samples still to do are order[lo:hi], sorted by what they do there.
    lo, hi = np.zeros(horizon, np.int64), np.full(horizon, n_samples)
    marks = np.zeros((horizon, 4), np.int64)
    goal, value, peak = np.zeros(horizon + 1), np.zeros(horizon + 1), np.zeros(horizon + 1)
    goal[0] = value[0] = peak[0] = goal_probability(p, s.prob)
    depth, fresh = 0, True
    while True:
        if fresh:
            if guidance is None:
                for i in range(lo[depth], hi[depth]):
                    choices[depth, order[i]] = draw_action(s, draws[depth, order[i]], depth > 0)
            else:
                _choose(p, guidance, s, world, costs, helpful, draws[depth], order, lo[depth], hi[depth],
                        depth > 0, choices[depth])  # fmt: skip
            _sort_by(choices[depth], order, lo[depth], hi[depth])
            fresh = False
        if lo[depth] < hi[depth]:
            first = lo[depth]
            choice = choices[depth, order[first]]
            end = first + 1
            while end < hi[depth] and choices[depth, order[end]] == choice:
                end += 1
            lo[depth] = end
            for trail in range(3):
                marks[depth, trail] = s.length[trail]
            action = choice
            if guidance is not None:
                action = guidance.action[choice]
                marks[depth, 3] = world.length[0]
                if depth + 1 < horizon:
                    imagine(p, guidance, world, choice)
            goal[depth + 1] = goal[depth]
            if action != idle:
                advance(p, s, action)
                if depth + 1 < horizon:
                    refresh(p, s, threshold, marks[depth, ATOMS])
                goal[depth + 1] = goal_probability(p, s.prob)
            value[depth + 1] = value[depth] + discount ** (depth + 1) * goal[depth + 1]
            peak[depth + 1] = max(peak[depth], goal[depth + 1])
            if depth + 1 < horizon:
                depth, fresh = depth + 1, True
                lo[depth], hi[depth] = first, end
                continue
            for i in range(first, end):
                values[order[i]], peaks[order[i]] = value[horizon], peak[horizon]
        else:
            depth -= 1
            if depth < 0:
                return choices, values, peaks
        undo(p, s, marks[depth, ATOMS], marks[depth, RULES], marks[depth, ACTIONS])
        if guidance is not None:
            forget(guidance, world, marks[depth, 3])


@numba.njit(cache=True, nogil=True)
def _choose(p, g, s, world, costs, helpful, draws, order, first, end, may_idle, choices):  # type: ignore[no-untyped-def]
    """Guided choices of the samples order[first:end] at one node.

    A share of them follows the relaxed plan: doing nothing once the goal is reached or lost for good. The
    others are drawn as without guidance.
    """
    idle = len(p.action_ptr) - 1
    n_helpful = -2
    for i in range(first, end):
        u, choice = draws[order[i]], -1
        if u < g.share:
            u /= g.share
            if n_helpful == -2:
                n_helpful = find_helpful(p, g, world, costs, helpful)
            if n_helpful > 0:
                choice = draw_helpful(g, s.mass, helpful, n_helpful, u)
            elif may_idle:
                choice = len(g.operators.cost) + idle
        else:
            u = (u - g.share) / (1.0 - g.share)
        if choice < 0:
            choice = intended(p, g, world, draw_action(s, u, may_idle))
        choices[order[i]] = choice
