"""A* with the landmark cut, in numba. Worlds are sets of atoms, packed into 64-bit words."""

from __future__ import annotations

import numba
import numpy as np

from cognitive_arch.planning.relaxed import NEVER

FOUND, NOTHING, EXHAUSTED = 0, 1, 2


@numba.njit(cache=True, nogil=True)
def search(start, pos, neg, add, rem, goal_pos, goal_neg, prices, o, goal, limit, most):  # type: ignore[no-untyped-def]
    """The cheapest sequence of rules from `start` (n_words,) to the goal, and how the search ended.

    `pos`, `neg`, `add`, `rem` are (n_rules, n_words): atoms that must be true or false, that become true or
    false. `o` are the operators of the relaxation, whose costs are the prices of their rules.
    """
    n_words, n_rules = len(start), len(prices)
    n_literals = len(o.user_ptr) - 1
    room = 1024
    world = np.empty((room, n_words), np.uint64)
    g, parent, via = np.empty(room), np.empty(room, np.int64), np.empty(room, np.int64)
    h = np.empty(room)
    known = {np.uint64(0): np.int64(-1)}  # hash of a world -> its number; collisions are chained in `other`
    other = np.full(room, -1, np.int64)
    scratch = _scratch(o, n_literals)
    world[0], g[0], parent[0], via[0] = start, 0.0, -1, -1
    h[0] = landmark_cut(o, goal, start, scratch)
    known[_hash(start)] = 0
    size, done = 1, 0
    heap = [(h[0], h[0], np.int64(0))]
    if h[0] >= NEVER or h[0] > limit:
        return np.empty(0, np.int64), NOTHING
    while len(heap) > 0:
        f, _, node = _pop(heap)
        if f > g[node] + h[node] + 1e-12:
            continue  # a cheaper way to this world was found meanwhile
        here = world[node].copy()
        if _holds(here, goal_pos, goal_neg):
            return _path(parent, via, node), FOUND
        done += 1
        if done > most:
            return np.empty(0, np.int64), EXHAUSTED
        for r in range(n_rules):
            if not _holds(here, pos[r], neg[r]):
                continue
            there = (here & ~rem[r]) | add[r]
            cost = g[node] + prices[r]
            key = _hash(there)
            first = known[key] if key in known else np.int64(-1)
            found = first
            while found >= 0 and not _same(world[found], there):
                found = other[found]
            if found < 0:
                if size == room:
                    room *= 2
                    world, g, h, parent, via, other = _grown(world, g, h, parent, via, other, room)
                found = size
                size += 1
                world[found] = there
                other[found] = first
                known[key] = found
                h[found] = landmark_cut(o, goal, there, scratch)
            elif cost >= g[found] - 1e-12:
                continue
            g[found], parent[found], via[found] = cost, node, r
            if h[found] < NEVER and cost + h[found] <= limit:
                _push(heap, (cost + h[found], h[found], found))
    return np.empty(0, np.int64), NOTHING


@numba.njit(cache=True, nogil=True)
def _path(parent, via, node):  # type: ignore[no-untyped-def]
    """The rules that led to world number `node`, in order."""
    length = 0
    k = node
    while parent[k] >= 0:
        length += 1
        k = parent[k]
    path = np.empty(length, np.int64)
    while parent[node] >= 0:
        length -= 1
        path[length] = via[node]
        node = parent[node]
    return path


@numba.njit(cache=True, nogil=True)
def _grown(world, g, h, parent, via, other, room):  # type: ignore[no-untyped-def]
    n = len(g)
    more = np.empty((room, world.shape[1]), np.uint64)
    more[:n] = world
    g2, h2 = np.empty(room), np.empty(room)
    p2, v2, o2 = np.empty(room, np.int64), np.empty(room, np.int64), np.full(room, -1, np.int64)
    g2[:n], h2[:n], p2[:n], v2[:n], o2[:n] = g, h, parent, via, other
    return more, g2, h2, p2, v2, o2


@numba.njit(cache=True, nogil=True)
def _holds(world, pos, neg):  # type: ignore[no-untyped-def]
    for w in range(len(world)):  # noqa: SIM110 (numba)
        if world[w] & pos[w] != pos[w] or world[w] & neg[w] != 0:
            return False
    return True


@numba.njit(cache=True, nogil=True)
def _same(a, b):  # type: ignore[no-untyped-def]
    for w in range(len(a)):  # noqa: SIM110 (numba)
        if a[w] != b[w]:
            return False
    return True


@numba.njit(cache=True, nogil=True)
def _hash(world):  # type: ignore[no-untyped-def]
    key = np.uint64(1469598103934665603)
    for w in range(len(world)):
        key = (key ^ world[w]) * np.uint64(1099511628211)
        key ^= key >> np.uint64(29)
    return key


@numba.njit(cache=True, nogil=True)
def _push(heap, item):  # type: ignore[no-untyped-def]
    heap.append(item)
    i = len(heap) - 1
    while i > 0 and heap[i] < heap[(i - 1) // 2]:
        heap[i], heap[(i - 1) // 2] = heap[(i - 1) // 2], heap[i]
        i = (i - 1) // 2


@numba.njit(cache=True, nogil=True)
def _pop(heap):  # type: ignore[no-untyped-def]
    top = heap[0]
    last = heap.pop()
    if len(heap) == 0:
        return top
    i = 0
    heap[0] = last
    while 2 * i + 1 < len(heap):
        child = 2 * i + 1
        if child + 1 < len(heap) and heap[child + 1] < heap[child]:
            child += 1
        if not heap[child] < heap[i]:
            break
        heap[i], heap[child] = heap[child], heap[i]
        i = child
    return top


@numba.njit(cache=True, nogil=True)
def _scratch(o, n_literals):  # type: ignore[no-untyped-def]
    """Room for one landmark cut."""
    n = len(o.cost)
    return (
        np.empty(n_literals),  # value: h_max of every literal
        np.empty(n),  # cost that is left of every operator
        np.empty(n, np.int32),  # how many needs are still missing
        np.empty(n, np.int32),  # supporter: the dearest need, -1 for none
        np.empty(n_literals, np.bool_),  # zone: leads to the goal at no cost
        np.empty(n_literals, np.bool_),  # reached before the zone
    )


@numba.njit(cache=True, nogil=True)
def landmark_cut(o, goal, world, scratch):  # type: ignore[no-untyped-def]
    """A lower bound of the cost from `world` to the goal; NEVER if it cannot be reached.

    Again and again the operators are found of which every relaxed plan must use one, the least of their costs
    is paid, and taken off all of them.
    """
    value, left, missing, supporter, zone, reached = scratch
    left[:] = o.cost
    total = 0.0
    while True:
        _h_max(o, world, value, left, missing, supporter)
        dearest = goal[0]
        for k in range(len(goal)):
            if value[goal[k]] > value[dearest]:
                dearest = goal[k]
        if value[dearest] >= NEVER:
            return NEVER
        if value[dearest] <= 1e-9:
            return total
        _mark_zone(o, dearest, left, missing, supporter, zone)
        # What can be reached without crossing into it; the operators that cross are the cut.
        reached[:] = False
        for literal in range(len(value)):
            bit = (world[(literal >> 1) // 64] >> np.uint64((literal >> 1) % 64)) & np.uint64(1)
            if bit == np.uint64(literal & 1):
                reached[literal] = True
        least = np.inf
        changed = True
        while changed:
            changed = False
            for op in range(len(left)):
                if missing[op] != 0 or (supporter[op] >= 0 and not reached[supporter[op]]):
                    continue
                crosses = False
                for k in range(o.add_ptr[op], o.add_ptr[op + 1]):
                    if zone[o.add[k]]:
                        crosses = True
                if crosses:
                    continue
                for k in range(o.add_ptr[op], o.add_ptr[op + 1]):
                    if not reached[o.add[k]]:
                        reached[o.add[k]] = True
                        changed = True
        for turn in range(2):
            for op in range(len(left)):
                if missing[op] != 0 or (supporter[op] >= 0 and not reached[supporter[op]]):
                    continue
                for k in range(o.add_ptr[op], o.add_ptr[op + 1]):
                    if zone[o.add[k]]:
                        if turn == 0:
                            least = min(least, left[op])
                        else:
                            left[op] -= least
                        break
        total += least


@numba.njit(cache=True, nogil=True)
def _mark_zone(o, dearest, left, missing, supporter, zone):  # type: ignore[no-untyped-def]
    """Mark in `zone` the literals from which `dearest` follows at no cost, along supporters."""
    zone[:] = False
    zone[dearest] = True
    changed = True
    while changed:
        changed = False
        for op in range(len(left)):
            if left[op] <= 1e-9 and supporter[op] >= 0 and not zone[supporter[op]] and missing[op] == 0:
                for k in range(o.add_ptr[op], o.add_ptr[op + 1]):
                    if zone[o.add[k]]:
                        zone[supporter[op]] = True
                        changed = True
                        break


@numba.njit(cache=True, nogil=True)
def _h_max(o, world, value, left, missing, supporter):  # type: ignore[no-untyped-def]
    """Fill `value` (n_literals,) with h_max from `world`, `supporter` with each operator's dearest need.

    `missing` is 0 afterwards for the operators that can be reached.
    """
    for literal in range(len(value)):
        bit = (world[(literal >> 1) // 64] >> np.uint64((literal >> 1) % 64)) & np.uint64(1)
        value[literal] = 0.0 if bit == np.uint64(literal & 1) else NEVER
    changed = True
    while changed:
        changed = False
        for op in range(len(left)):
            most, which = 0.0, -1
            for k in range(o.need_ptr[op], o.need_ptr[op + 1]):
                literal = o.need[k]
                if which < 0 or value[literal] > most:
                    most, which = value[literal], literal
                if most >= NEVER:
                    break
            supporter[op] = which
            missing[op] = 1 if most >= NEVER else 0
            if most < NEVER:
                price = most + left[op]
                for k in range(o.add_ptr[op], o.add_ptr[op + 1]):
                    if price < value[o.add[k]] - 1e-12:
                        value[o.add[k]] = price
                        changed = True
