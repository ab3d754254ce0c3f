"""Kernels on single worlds: what an action really does in a state in which every atom is true or false.

Beliefs are in `kernels`; here nothing is approximated. The rules' own semantics hold: the one rule of an
action whose context holds decides, without a unique one nothing changes, and the mass that no listed
outcome takes (noise) leaves the world as it is.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.planning.kernels import derived_probability

NOTHING = -1
"""No rule covers the action; no listed outcome happened; no such entry."""

CLOSURE_KIND = 1
"""`problem.CLOSURE`, written out because kernels keep constants as they were when they were compiled."""


class World(NamedTuple):
    """One world, changed in place.

    `literal` (2 * n_atoms,) is 1.0 or 0.0, coded like `Arrays.start`. `key` (n_words + 1,) holds the same as
    one bit per atom, and last a tag that the user of the world sets (the step, say); worlds are the same if
    their keys are. `trail` lists the atoms changed since `length` was last 0, so that `undo` can take them
    back.
    """

    literal: NDArray[np.float64]
    key: NDArray[np.uint64]
    trail: NDArray[np.int32]
    length: NDArray[np.int64]


class Table(NamedTuple):
    """Worlds by number: an open hash table over `keys` (capacity, n_words + 1), of which `size[0]` are used.

    Whole keys are compared, so that no two worlds are ever taken for one, whatever they hash to.
    """

    slots: NDArray[np.int32]
    keys: NDArray[np.uint64]
    size: NDArray[np.int64]


@numba.njit(cache=True, nogil=True)
def make_world(p):  # type: ignore[no-untyped-def]
    """The world at the start, tag 0."""
    n_atoms = len(p.start) // 2
    key = np.zeros((n_atoms + 63) // 64 + 1, np.uint64)
    # An atom flips at most three times a step: made false, made true, set by its definition.
    w = World(p.start.copy(), key, np.empty(3 * n_atoms, np.int32), np.zeros(1, np.int64))
    for atom in range(n_atoms):
        if w.literal[2 * atom + 1] != 0.0:
            key[atom >> 6] |= np.uint64(1) << np.uint64(atom & 63)
    return w


@numba.njit(cache=True, nogil=True)
def make_table(capacity, width):  # type: ignore[no-untyped-def]
    """An empty table for at most `capacity` keys of `width` numbers."""
    n_slots = 16
    while n_slots < 2 * capacity:
        n_slots *= 2
    slots = np.full(n_slots, NOTHING, np.int32)
    return Table(slots, np.empty((capacity, width), np.uint64), np.zeros(1, np.int64))


@numba.njit(cache=True, nogil=True)
def find(table, key):  # type: ignore[no-untyped-def]
    """The slot in which the number of `key` stands, or the free one that it belongs in."""
    h = np.uint64(0)
    for i in range(len(key)):
        h = (h ^ key[i]) * np.uint64(0x9E3779B97F4A7C15)
        h ^= h >> np.uint64(29)
    mask = len(table.slots) - 1
    slot = np.int64(h & np.uint64(mask))
    while True:
        number = table.slots[slot]
        if number == NOTHING:
            return slot
        same = True
        for i in range(len(key)):
            if table.keys[number, i] != key[i]:
                same = False
                break
        if same:
            return slot
        slot = (slot + 1) & mask


@numba.njit(cache=True, nogil=True)
def number_of(table, key):  # type: ignore[no-untyped-def]
    """The number of `key`, which is entered if it is new; NOTHING if there is no room for it."""
    slot = find(table, key)
    number = table.slots[slot]
    if number == NOTHING and table.size[0] < len(table.keys):
        number = np.int32(table.size[0])
        table.slots[slot] = number
        table.size[0] += 1
        for i in range(len(key)):
            table.keys[number, i] = key[i]
    return number


@numba.njit(cache=True, nogil=True)
def flip(w, atom):  # type: ignore[no-untyped-def]
    """Make `atom` what it is not, without a trail."""
    true = w.literal[2 * atom + 1]
    w.literal[2 * atom + 1] = w.literal[2 * atom]
    w.literal[2 * atom] = true
    w.key[atom >> 6] ^= np.uint64(1) << np.uint64(atom & 63)


@numba.njit(cache=True, nogil=True)
def load(w, key):  # type: ignore[no-untyped-def]
    """Turn `w` into the world of `key`; its trail starts anew."""
    last = len(key) - 1
    for word in range(last):
        different = w.key[word] ^ key[word]
        atom = 64 * word
        while different != np.uint64(0):
            if different & np.uint64(1):
                flip(w, atom)
            different >>= np.uint64(1)
            atom += 1
    w.key[last] = key[last]
    w.length[0] = 0


@numba.njit(cache=True, nogil=True)
def undo(w):  # type: ignore[no-untyped-def]
    """Take back what was changed since the trail began."""
    for i in range(w.length[0] - 1, -1, -1):
        flip(w, np.int64(w.trail[i]))
    w.length[0] = 0


@numba.njit(cache=True, nogil=True)
def _set(w, atom, value):  # type: ignore[no-untyped-def]
    """Give `atom` the value 0.0 or 1.0, leaving a trail."""
    if w.literal[2 * atom + 1] != value:
        flip(w, atom)
        w.trail[w.length[0]] = atom
        w.length[0] += 1


@numba.njit(cache=True, nogil=True)
def goal_holds(p, w):  # type: ignore[no-untyped-def]
    """Whether every literal of the goal is true."""
    holds = True
    for k in range(len(p.goal)):
        holds = holds and w.literal[p.goal[k]] != 0.0
    return holds


@numba.njit(cache=True, nogil=True)
def covering(p, w, action):  # type: ignore[no-untyped-def]
    """The one rule of `action` whose context holds, or NOTHING."""
    found = NOTHING
    for rule in range(p.action_ptr[action], p.action_ptr[action + 1]):
        applies = True
        for k in range(p.context_ptr[rule], p.context_ptr[rule + 1]):
            if w.literal[p.context[k]] == 0.0:
                applies = False
                break
        if applies:
            if found != NOTHING:
                return NOTHING
            found = rule
    return found


@numba.njit(cache=True, nogil=True)
def covered_actions(p, w, may_idle, actions):  # type: ignore[no-untyped-def]
    """Write the actions that a unique rule covers to `actions` (n_actions + 1,); returns how many.

    Doing nothing comes last, where it is allowed.
    """
    n = 0
    for action in range(len(p.action_ptr) - 1):
        if covering(p, w, action) != NOTHING:
            actions[n] = action
            n += 1
    if may_idle:
        actions[n] = len(p.action_ptr) - 1
        n += 1
    return n


@numba.njit(cache=True, nogil=True)
def draw_outcome(p, rule, u):  # type: ignore[no-untyped-def]
    """The outcome that `u` in [0, 1) falls on, or NOTHING for noise."""
    for outcome in range(p.outcome_ptr[rule], p.outcome_ptr[rule + 1]):
        u -= p.outcome_probability[outcome]
        if u < 0.0:
            return outcome
    return NOTHING


@numba.njit(cache=True, nogil=True)
def likeliest_outcome(p, rule):  # type: ignore[no-untyped-def]
    """The listed outcome with the highest probability, or NOTHING if none is listed."""
    best = NOTHING
    for outcome in range(p.outcome_ptr[rule], p.outcome_ptr[rule + 1]):
        if best == NOTHING or p.outcome_probability[outcome] > p.outcome_probability[best]:
            best = outcome
    return best


@numba.njit(cache=True, nogil=True)
def apply_outcome(p, w, outcome):  # type: ignore[no-untyped-def]
    """Make the literals of `outcome` true and bring derived atoms up to date, leaving a trail.

    Of an atom that is to be both, true wins, as in `transition.apply_literals`.
    """
    before = w.length[0]
    for sign in range(2):
        for k in range(p.change_ptr[outcome], p.change_ptr[outcome + 1]):
            if p.change[k] & 1 == sign:
                _set(w, np.int64(p.change[k] >> 1), float(sign))
    if len(p.derived_kind) > 0 and w.length[0] > before:
        _derive(p, w)


@numba.njit(cache=True, nogil=True)
def _derive(p, w):  # type: ignore[no-untyped-def]
    """Set every derived atom as its definition says."""
    for d in range(len(p.derived_kind)):
        row = p.derived[p.derived_ptr[d] : p.derived_ptr[d + 1]]
        if p.derived_kind[d] == CLOSURE_KIND:
            _derive_closure(w, row)
        else:
            # On certain literals the marginal of a conjunction or a count is exactly 0 or 1.
            _set(w, np.int64(row[0]), derived_probability(p.derived_kind[d], row, w.literal))


@numba.njit(cache=True, nogil=True)
def _derive_closure(w, row):  # type: ignore[no-untyped-def]
    """Warshall's algorithm: to follow all chains one by one takes for ever where there are many."""
    n = row[0]
    leads = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            leads[i, j] = w.literal[2 * row[1 + i * n + j] + 1]
    for via in range(n):
        for i in range(n):
            if leads[i, via] != 0.0:
                for j in range(n):
                    if leads[via, j] != 0.0:
                        leads[i, j] = 1.0
    for i in range(n):
        for j in range(n):
            _set(w, np.int64(row[1 + n * n + i * n + j]), leads[i, j])
