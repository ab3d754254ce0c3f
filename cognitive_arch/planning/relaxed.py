"""The delete relaxation: what could become true if nothing that was true ever stopped being so.

Positive and negative literals are facts of their own, every listed outcome of every rule is an operator
that adds its literals, and so is every way in which a derived atom follows from others. What cannot be
reached here cannot be reached at all; what can be, is told at a cost that guides the search (h_add and
relaxed plans: Bonet and Geffner 2001; Hoffmann and Nebel 2001).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numba
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.planning.problem import ANY_OF, CLOSURE, COMPARISONS, Floats, Ints, Problem
from cognitive_arch.relational.derived import Comparison

NEVER = 1e9
"""Cost of what cannot be reached."""

MOST_NEEDS = 500
"""How many ways to make one derived atom true, or false, are told apart."""

Needs: TypeAlias = list[tuple[int, ...]]

SURPRISE = 1.0
"""What an outcome costs beyond one step, per nat of its improbability."""


class Operators(NamedTuple):
    """Operators in sparse rows, as in `Arrays`: operator o needs `need[need_ptr[o]:need_ptr[o + 1]]`."""

    need_ptr: Ints  # (n_operators + 1,)
    need: Ints  # literals
    add_ptr: Ints  # (n_operators + 1,)
    add: Ints  # literals
    cost: Floats  # (n_operators,)
    rule: Ints  # (n_operators,) rule it stands for, -1 where an atom merely follows from others
    outcome: Ints  # (n_operators,) outcome of that rule, counted over all rules, or -1
    user_ptr: Ints  # (2 * n_atoms + 1,)
    user: Ints  # operators that need the literal


def relax(problem: Problem) -> Operators:
    """The operators of `problem`: one per listed outcome with an effect, then those of derived atoms."""
    a = problem.arrays
    n_changes = np.diff(a.change_ptr)
    outcomes = np.flatnonzero((n_changes > 0) & (a.outcome_probability > 0))
    rules = np.repeat(np.arange(len(a.rule_action)), np.diff(a.outcome_ptr))[outcomes]
    needs = [a.context[a.context_ptr[r] : a.context_ptr[r + 1]] for r in rules]
    adds = [a.change[a.change_ptr[o] : a.change_ptr[o + 1]] for o in outcomes]
    axioms = [axiom for d in range(len(a.derived_kind)) for axiom in _axioms(problem, d)]
    needs += [np.array(need, dtype=np.int32) for need, _ in axioms]
    adds += [np.array([add], dtype=np.int32) for _, add in axioms]
    cost = 1.0 - SURPRISE * np.log(a.outcome_probability[outcomes])
    need_ptr, need = _rows(needs)
    add_ptr, add = _rows(adds)
    none = np.full(len(axioms), -1)
    by_literal = np.argsort(need, kind="stable")
    return Operators(
        need_ptr=need_ptr,
        need=need,
        add_ptr=add_ptr,
        add=add,
        cost=np.concatenate([cost, np.zeros(len(axioms))]),
        rule=np.concatenate([rules, none]).astype(np.int32),
        outcome=np.concatenate([outcomes, none]).astype(np.int32),
        user_ptr=np.concatenate([[0], np.cumsum(np.bincount(need, minlength=len(a.start)))]).astype(np.int32),
        user=np.repeat(np.arange(len(needs)), np.diff(need_ptr))[by_literal].astype(np.int32),
    )


def _axioms(problem: Problem, d: int) -> Iterator[tuple[tuple[int, ...], int]]:
    """(needed literals, literal that follows) for one definition.

    Where exact needs would be too many, some that are necessary stand for them: a relaxation may promise
    too much, never too little.
    """
    a = problem.arrays
    row = a.derived[a.derived_ptr[d] : a.derived_ptr[d + 1]].tolist()
    if a.derived_kind[d] == CLOSURE:
        n = row[0]
        base, closed = np.reshape(row[1:], (2, n, n)).tolist()
        for i, j in itertools.product(range(n), repeat=2):
            yield (2 * base[i][j],), 2 * closed[i][j]
            yield (2 * base[i][j] + 1,), 2 * closed[i][j] + 1
            for k in set(range(n)) - {i, j}:
                yield (2 * base[i][k] + 1, 2 * closed[k][j] + 1), 2 * closed[i][j] + 1
        return
    if a.derived_kind[d] == ANY_OF:
        true, false = _any_of(row)
    else:
        true, false = _count(row[1], row[2], row[3:])
    yield from ((need, 2 * row[0] + 1) for need in true)
    yield from ((need, 2 * row[0]) for need in false)


def _any_of(row: list[int]) -> tuple[Needs, Needs]:
    """What makes a disjunction of conjunctions true, and what makes it false."""
    groups, k = [], 1
    while k < len(row):
        groups.append(tuple(row[k + 1 : k + 1 + row[k]]))
        k += 1 + row[k]
    if math.prod(len(group) for group in groups) <= MOST_NEEDS:
        broken = [tuple(lit ^ 1 for lit in chosen) for chosen in itertools.product(*groups)]
    else:  # at least the smallest group must be broken
        broken = [(literal ^ 1,) for literal in min(groups, key=len)]
    return groups, broken


def _count(comparison: int, value: int, literals: list[int]) -> tuple[Needs, Needs]:
    """What makes a compared count true, and what makes it false."""

    def least(wanted: int, among: list[int]) -> Needs:
        """At least `wanted` of `among`."""
        if wanted <= 0:
            return [()]
        if wanted > len(among):
            return []
        if math.comb(len(among), wanted) > MOST_NEEDS:
            return [(literal,) for literal in among]
        return list(itertools.combinations(among, wanted))

    def at_least(n: int) -> Needs:
        return least(n, literals)

    def at_most(n: int) -> Needs:
        return least(len(literals) - n, [literal ^ 1 for literal in literals])

    match COMPARISONS[comparison]:
        case Comparison.GREATER_EQUAL:
            return at_least(value), at_most(value - 1)
        case Comparison.GREATER:
            return at_least(value + 1), at_most(value)
        case Comparison.LESS_EQUAL:
            return at_most(value), at_least(value + 1)
        case Comparison.LESS:
            return at_most(value - 1), at_least(value)
        case Comparison.EQUAL:
            exact = at_least(value)
            if 0 <= value <= len(literals) and math.comb(len(literals), value) <= MOST_NEEDS:
                chosen = itertools.combinations(literals, value)
                exact = [(*some, *(lit ^ 1 for lit in literals if lit not in some)) for some in chosen]
            return exact, at_least(value + 1) + at_most(value - 1)


def _atoms_of(problem: Problem, d: int) -> tuple[Ints, Ints]:
    """The atoms that one definition gives a value to, and those it looks at."""
    a = problem.arrays
    row = a.derived[a.derived_ptr[d] : a.derived_ptr[d + 1]]
    if a.derived_kind[d] == CLOSURE:
        base, closed = np.split(row[1:], 2)
        return closed, base
    if a.derived_kind[d] == ANY_OF:
        literals: list[int] = []
        k = 1
        while k < len(row):
            literals.extend(row[k + 1 : k + 1 + row[k]])
            k += 1 + row[k]
        return row[:1], np.array(literals, dtype=np.int32) >> 1
    return row[:1], row[3:] >> 1


def _rows(rows: list[NDArray[np.int32]]) -> tuple[Ints, Ints]:
    lengths = np.array([len(row) for row in rows], dtype=np.int64)
    ptr = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
    return ptr, np.concatenate([*rows, np.zeros(0, dtype=np.int32)]).astype(np.int32)


@numba.njit(cache=True, nogil=True)
def count_missing(o, holds):  # type: ignore[no-untyped-def]
    """How many needed literals of every operator do not hold in the world `holds` (2 * n_atoms,)."""
    missing = np.zeros(len(o.cost), np.int32)
    for op in range(len(o.cost)):
        for k in range(o.need_ptr[op], o.need_ptr[op + 1]):
            if holds[o.need[k]] < 0.5:
                missing[op] += 1
    return missing


class Costs(NamedTuple):
    """h_add from one world, with the scratch space that it takes.

    `cost` (2 * n_atoms,) is what it takes to make each literal true, NEVER if that cannot be; `maker` the
    operator that does so most cheaply, -1 for what holds already.
    """

    cost: Floats
    maker: Ints
    missing: Ints  # (n_operators,)
    price: Floats  # (n_operators,)
    heap_cost: Floats
    heap_literal: Ints
    needed: NDArray[np.bool_]  # (n_operators,)
    seen: NDArray[np.bool_]  # (2 * n_atoms,)
    stack: Ints  # (2 * n_atoms,)


@numba.njit(cache=True, nogil=True)
def make_costs(o, n_literals):  # type: ignore[no-untyped-def]
    """Room for the costs of one world."""
    n = len(o.cost)
    return Costs(
        np.empty(n_literals),
        np.empty(n_literals, np.int32),
        np.empty(n, np.int32),
        np.empty(n),
        np.empty(len(o.add) + 1),
        np.empty(len(o.add) + 1, np.int32),
        np.zeros(n, np.bool_),
        np.zeros(n_literals, np.bool_),
        np.empty(n_literals, np.int32),
    )


@numba.njit(cache=True, nogil=True)
def literal_costs(o, holds, missing, c):  # type: ignore[no-untyped-def]
    """Fill `c` for the world `holds` (2 * n_atoms,); `missing` as from `count_missing`."""
    size = 0
    for literal in range(len(holds)):
        c.cost[literal] = 0.0 if holds[literal] > 0.5 else NEVER
        c.maker[literal] = -1
    for op in range(len(o.cost)):
        c.missing[op] = missing[op]
        c.price[op] = o.cost[op]
        if missing[op] == 0:
            size = _offer(o, c, op, size)
    while size > 0:
        this, literal = c.heap_cost[0], c.heap_literal[0]
        size -= 1
        _sift_down(c.heap_cost, c.heap_literal, size)
        if this > c.cost[literal]:
            continue  # a cheaper way was found after this one had been put on the heap
        for k in range(o.user_ptr[literal], o.user_ptr[literal + 1]):
            op = o.user[k]
            c.missing[op] -= 1
            c.price[op] += this
            if c.missing[op] == 0:
                size = _offer(o, c, op, size)


@numba.njit(cache=True, nogil=True)
def _offer(o, c, op, size):  # type: ignore[no-untyped-def]
    """Put the literals on the heap that `op` makes more cheaply than was known; returns the heap's size."""
    price = c.price[op]
    for k in range(o.add_ptr[op], o.add_ptr[op + 1]):
        literal = o.add[k]
        if price < c.cost[literal]:
            c.cost[literal], c.maker[literal] = price, op
            i = size
            size += 1
            while i > 0 and c.heap_cost[(i - 1) // 2] > price:
                c.heap_cost[i], c.heap_literal[i] = c.heap_cost[(i - 1) // 2], c.heap_literal[(i - 1) // 2]
                i = (i - 1) // 2
            c.heap_cost[i], c.heap_literal[i] = price, literal
    return size


@numba.njit(cache=True, nogil=True)
def _sift_down(heap_cost, heap_literal, size):  # type: ignore[no-untyped-def]
    """Put the last entry (number `size`) in place of the first."""
    price, literal, i = heap_cost[size], heap_literal[size], 0
    while 2 * i + 1 < size:
        child = 2 * i + 1
        if child + 1 < size and heap_cost[child + 1] < heap_cost[child]:
            child += 1
        if heap_cost[child] >= price:
            break
        heap_cost[i], heap_literal[i] = heap_cost[child], heap_literal[child]
        i = child
    heap_cost[i], heap_literal[i] = price, literal


@numba.njit(cache=True, nogil=True)
def relaxed_plan(o, goal, c, helpful):  # type: ignore[no-untyped-def]
    """Collect in `helpful` the operators of a relaxed plan that can be used at once.

    Returns their number: 0 if the goal holds already, -1 if it cannot be reached.
    """
    c.needed[:] = False
    c.seen[:] = False
    n_stack = n_helpful = 0
    for k in range(len(goal)):
        if c.cost[goal[k]] >= NEVER:
            return -1
        if not c.seen[goal[k]]:
            c.seen[goal[k]] = True
            c.stack[n_stack] = goal[k]
            n_stack += 1
    while n_stack > 0:
        n_stack -= 1
        op = c.maker[c.stack[n_stack]]
        if op < 0 or c.needed[op]:
            continue
        c.needed[op] = True
        ready = True
        for k in range(o.need_ptr[op], o.need_ptr[op + 1]):
            literal = o.need[k]
            if c.cost[literal] > 0.0:
                ready = False
                if not c.seen[literal]:
                    c.seen[literal] = True
                    c.stack[n_stack] = literal
                    n_stack += 1
        if ready and o.rule[op] >= 0:
            helpful[n_helpful] = op
            n_helpful += 1
    return n_helpful


def relevant_rules(problem: Problem, operators: Operators, cost: Floats) -> NDArray[np.bool_]:
    """Which rules (n_rules,) can matter: they can come to apply, and lead towards the goal.

    `cost` is that of `literal_costs` from the start. A rule leads towards the goal if it adds a literal
    that the goal or the context of such a rule asks for, or one that keeps a sibling of such a rule from
    applying, for rules of one action that apply together cancel out.
    """
    o, a = operators, problem.arrays
    owner = np.repeat(np.arange(len(o.cost)), np.diff(o.need_ptr))
    adder = np.repeat(np.arange(len(o.cost)), np.diff(o.add_ptr))
    reader = np.repeat(np.arange(len(a.rule_action)), np.diff(a.context_ptr))
    has_siblings = np.diff(a.action_ptr)[a.rule_action] > 1
    definitions = [_atoms_of(problem, d) for d in range(len(a.derived_kind))]
    reachable = np.ones(len(o.cost), dtype=np.bool_)
    reachable[owner[cost[o.need] >= NEVER]] = False
    wanted = np.zeros(len(a.start), dtype=np.bool_)
    wanted[a.goal] = True
    n_wanted = -1
    used = np.zeros(len(o.cost), dtype=np.bool_)
    actions = np.zeros(len(problem.actions), dtype=np.bool_)
    while True:
        now = np.zeros_like(used)
        now[adder[wanted[o.add]]] = True
        now &= reachable
        if (now == used).all() and wanted.sum() == n_wanted:
            break
        n_wanted = wanted.sum()
        used = now
        wanted[o.need[used[owner]]] = True
        for defined, looked_at in reversed(definitions):
            # Axioms may leave out needs, so whatever bears on a wanted derived atom is wanted, either way.
            if wanted[2 * defined].any() or wanted[2 * defined + 1].any():
                wanted[2 * looked_at] = wanted[2 * looked_at + 1] = True
        actions[a.rule_action[o.rule[used & (o.rule >= 0)]]] = True
        rivals = actions[a.rule_action] & has_siblings
        wanted[a.context[rivals[reader]] ^ 1] = True
    # Sibling rules shape each other's weights, so an action keeps all of its rules or none.
    return actions[a.rule_action]
