"""Ground rules as flat arrays, the form in which the numba kernels read them.

A literal is coded as one number, `2 * atom + (1 if positive else 0)`, so that one array of probabilities
per literal serves both signs without a branch. Rules are encoded once (`_encode`); what depends on state
and goal is a few array operations on top of that.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.relational.derived import AnyOf, Closure, Comparison, Definition, derive
from cognitive_arch.relational.rules import GroundRule, derived_of
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State

Ints: TypeAlias = NDArray[np.int32]
Floats: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]

ANY_OF, CLOSURE, COUNT = range(3)
COMPARISONS = tuple(Comparison)


class Arrays(NamedTuple):
    """What every kernel takes first.

    Rows are sparse: row i of `x` spans `x_ptr[i]:x_ptr[i + 1]`. Rules of action a are rows
    `action_ptr[a]:action_ptr[a + 1]`; outcomes of rule r are rows `outcome_ptr[r]:outcome_ptr[r + 1]` of
    the changes. `effect_set` is the probability that a rule makes the atom true, `effect_change` that it
    sets it either way.
    """

    action_ptr: Ints  # (n_actions + 1,)
    rule_action: Ints  # (n_rules,)
    context_ptr: Ints  # (n_rules + 1,)
    context: Ints  # literals, those that are false at the start first: they end the product early
    watch_ptr: Ints  # (n_atoms + 1,)
    watch: Ints  # rules whose context reads the atom
    effect_ptr: Ints  # (n_rules + 1,)
    effect_atom: Ints
    effect_set: Floats
    effect_change: Floats
    outcome_ptr: Ints  # (n_rules + 1,)
    outcome_probability: Floats  # (n_outcomes,) listed ones; the rest of a rule's mass is noise
    change_ptr: Ints  # (n_outcomes + 1,)
    change: Ints  # literals
    goal: Ints  # literals
    start: Floats  # (2 * n_atoms,) probability of every literal at step 0
    derived_kind: Ints  # (n_definitions,) ANY_OF, CLOSURE or COUNT, each after those it needs
    derived_ptr: Ints  # (n_definitions + 1,)
    derived: Ints  # see `_definition`


@dataclass(frozen=True)
class Problem:
    """A planning problem compiled for one state and goal; numbers count along the tuples."""

    atoms: tuple[Atom, ...]
    actions: tuple[GroundAction, ...]
    rules: tuple[GroundRule, ...]
    arrays: Arrays

    @property
    def idle(self) -> int:
        """The number that stands for doing nothing."""
        return len(self.actions)

    def literal(self, code: int) -> Literal:
        """The literal behind a code."""
        return Literal(self.atoms[code >> 1], bool(code & 1))

    def keep(self, rules: Mask) -> Problem:
        """The same problem without the rules that `rules` (n_rules,) is false for."""
        return _select(self, rules, np.ones(len(self.arrays.context), dtype=np.bool_))


def compile_problem(state: State, goal: Goal, rules: Sequence[GroundRule], simplify: bool = True) -> Problem:
    """Flatten `rules` for one state and goal; derived atoms are worked out here.

    To `simplify`, literals over atoms that no rule changes are decided here: a true one is a factor 1, a
    false one makes its rule's weight 0 for ever, so both can be left out without changing any belief. Atoms
    and actions are numbered in the order in which the rules name them, so that names have no influence.
    """
    encoded, changing = _encode(_Same(rules))
    state = derive(state, derived_of(rules))
    index = {atom: i for i, atom in enumerate(encoded.atoms)}
    for literal in goal:
        index.setdefault(literal.atom, len(index))
    true = np.fromiter((atom in state for atom in index), np.bool_, len(index))
    start = np.empty(2 * len(index))
    start[1::2], start[0::2] = true, ~true
    everything = replace(
        encoded,
        atoms=tuple(index),
        arrays=encoded.arrays._replace(start=start, goal=_ints(_code(lit, index) for lit in goal)),
    )
    a = everything.arrays
    if not simplify:
        return everything.keep(np.ones(len(a.rule_action), dtype=np.bool_))
    live = changing[a.context >> 1]
    impossible = ~live & (start[a.context] == 0)
    dead = np.bincount(_row_numbers(a.context_ptr)[impossible], minlength=len(a.rule_action)) > 0
    return _select(everything, ~dead, live)


class _Same:
    """Rules as a key: equal only to themselves, for to compare thousands of them takes longer than work."""

    def __init__(self, rules: Sequence[GroundRule]) -> None:
        self.rules = rules

    def __hash__(self) -> int:
        return id(self.rules)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.rules is other.rules


@lru_cache(maxsize=4)
def _encode(key: _Same) -> tuple[Problem, Mask]:
    """All rules with all their literals, without state and goal, and which atoms can change (n_atoms,)."""
    by_action: dict[GroundAction, list[GroundRule]] = {}
    for rule in key.rules:
        by_action.setdefault(rule.action, []).append(rule)
    rules = tuple(itertools.chain.from_iterable(by_action.values()))
    definitions = derived_of(key.rules)
    coder = _Coder()
    contexts = [coder.codes(rule.context) for rule in rules]
    outcomes = [outcome for rule in rules for outcome in rule.outcomes]
    changes = [_consistent(coder.codes(outcome.literals)) for outcome in outcomes]
    for definition in definitions:
        for atom in (*_looked_at(definition), *definition.defines):
            coder.index.setdefault(atom, len(coder.index))
    index = coder.index
    context_ptr, context = _rows(contexts)
    change_ptr, change = _rows(changes)
    derived_ptr, derived = _rows([_definition(d, index) for d in definitions])
    nothing = np.zeros(0)
    arrays = Arrays(
        action_ptr=_offsets(map(len, by_action.values())),
        rule_action=_ints(i for i, own in enumerate(by_action.values()) for _ in own),
        context_ptr=context_ptr,
        context=context,
        watch_ptr=_ints(()),
        watch=_ints(()),
        effect_ptr=_ints(()),
        effect_atom=_ints(()),
        effect_set=nothing,
        effect_change=nothing,
        outcome_ptr=_offsets(len(rule.outcomes) for rule in rules),
        outcome_probability=np.array([o.probability for o in outcomes], dtype=np.float64),
        change_ptr=change_ptr,
        change=change,
        goal=_ints(()),
        start=nothing,
        derived_kind=_ints(_kind(definition) for definition in definitions),
        derived_ptr=derived_ptr,
        derived=derived,
    )
    changing = np.zeros(len(index), dtype=np.bool_)
    changing[change >> 1] = True
    for definition in definitions:
        if any(changing[index[atom]] for atom in definition.needs):
            changing[[index[atom] for atom in definition.defines]] = True
    return Problem(tuple(index), tuple(by_action), rules, arrays), changing


class _Coder:
    """Literals -> codes, atoms being numbered as they come.

    Ground rules share their literals, so codes are also kept by identity, which is quick to look up.
    """

    def __init__(self) -> None:
        self.index: dict[Atom, int] = {}
        self._known: dict[int, int] = {}

    def codes(self, literals: Sequence[Literal]) -> list[int]:
        """One code per literal; the literals must outlive this object."""
        known, index = self._known, self.index
        row = []
        for literal in literals:
            code = known.get(id(literal))
            if code is None:
                code = 2 * index.setdefault(literal.atom, len(index)) + literal.positive
                known[id(literal)] = code
            row.append(code)
        return row


def _consistent(codes: list[int]) -> list[int]:
    """One literal per atom; where an outcome names both signs, what it makes true is true."""
    if len({code >> 1 for code in codes}) == len(codes):
        return codes
    return [code for code in dict.fromkeys(codes) if code & 1 or code + 1 not in codes]


def _select(problem: Problem, keep: Mask, entries: Mask) -> Problem:
    """`problem` with the rules of `keep` (n_rules,) and of their contexts the literals of `entries`."""
    a = problem.arrays
    rules = np.flatnonzero(keep).astype(np.int32)
    actions, rule_action = np.unique(a.rule_action[rules], return_inverse=True)
    context_ptr, context = _take(a.context_ptr, a.context, rules, entries)
    rule_of = _row_numbers(context_ptr)
    # Literals that are false at the start most likely end the product early, so those come first.
    context = context[np.lexsort((a.start[context], rule_of))]
    watchers = np.argsort(context >> 1, kind="stable")
    n_outcomes = np.diff(a.outcome_ptr)
    outcomes = np.flatnonzero(np.repeat(keep, n_outcomes)).astype(np.int32)
    change_ptr, change = _take(a.change_ptr, a.change, outcomes)
    arrays = a._replace(
        action_ptr=_offsets(np.bincount(rule_action, minlength=len(actions))),
        rule_action=rule_action.astype(np.int32),
        context_ptr=context_ptr,
        context=context,
        watch_ptr=_offsets(np.bincount(context >> 1, minlength=len(problem.atoms))),
        watch=rule_of[watchers],
        outcome_ptr=_offsets(n_outcomes[rules]),
        outcome_probability=a.outcome_probability[outcomes],
        change_ptr=change_ptr,
        change=change,
    )
    return Problem(
        problem.atoms,
        tuple(problem.actions[i] for i in actions),
        tuple(problem.rules[i] for i in rules),
        _with_effects(arrays),
    )


def _with_effects(a: Arrays) -> Arrays:
    """Fill in the effects: per rule and atom, what its outcomes do to the atom taken together."""
    n_atoms, n_rules = len(a.start) // 2, len(a.rule_action)
    outcome = _row_numbers(a.change_ptr)
    rule = _row_numbers(a.outcome_ptr)[outcome].astype(np.int64)
    pairs, inverse = np.unique(rule * n_atoms + (a.change >> 1), return_inverse=True)
    probability = a.outcome_probability[outcome]
    return a._replace(
        effect_ptr=_offsets(np.bincount(pairs // max(n_atoms, 1), minlength=n_rules)),
        effect_atom=(pairs % max(n_atoms, 1)).astype(np.int32),
        effect_set=np.bincount(inverse, probability * (a.change & 1), len(pairs)).astype(np.float64),
        effect_change=np.bincount(inverse, probability, len(pairs)).astype(np.float64),
    )


def _kind(definition: Definition) -> int:
    if isinstance(definition, AnyOf):
        return ANY_OF
    return CLOSURE if isinstance(definition, Closure) else COUNT


def _looked_at(definition: Definition) -> Iterable[Atom]:
    """The atoms it needs, in the order in which it names them."""
    if isinstance(definition, AnyOf):
        return (literal.atom for group in definition.groups for literal in group)
    if isinstance(definition, Closure):
        return (Atom(definition.base, atom.args) for atom in definition.defines)
    return (literal.atom for literal in definition.literals)


def _definition(definition: Definition, index: Mapping[Atom, int]) -> list[int]:
    """One definition as numbers.

    ANY_OF: atom, then for each group its length and its literals. CLOSURE: n, n * n base atoms row by row,
    n * n defined atoms. COUNT: atom, comparison, value, literals.
    """
    if isinstance(definition, AnyOf):
        row = [index[definition.atom]]
        for group in definition.groups:
            row += [len(group), *(_code(literal, index) for literal in group)]
        return row
    if isinstance(definition, Closure):
        bases = [index[Atom(definition.base, atom.args)] for atom in definition.defines]
        return [len(definition.entities), *bases, *(index[atom] for atom in definition.defines)]
    comparison = COMPARISONS.index(definition.comparison)
    literals = (_code(literal, index) for literal in definition.literals)
    return [index[definition.atom], comparison, definition.value, *literals]


def _code(literal: Literal, index: Mapping[Atom, int]) -> int:
    return 2 * index[literal.atom] + literal.positive


def _rows(rows: Sequence[Sequence[int]]) -> tuple[Ints, Ints]:
    """Offsets (n_rows + 1,) and all entries one after another."""
    return _offsets(map(len, rows)), _ints(itertools.chain.from_iterable(rows))


def _take(ptr: Ints, entries: Ints, rows: Ints, wanted: Mask | None = None) -> tuple[Ints, Ints]:
    """Offsets and entries of `rows` only, and of these only the `wanted` entries."""
    chosen = np.zeros(len(ptr) - 1, dtype=np.bool_)
    chosen[rows] = True
    number = _row_numbers(ptr)
    mask = chosen[number] if wanted is None else chosen[number] & wanted
    lengths = np.bincount(number[mask], minlength=len(ptr) - 1)[rows]
    return _offsets(lengths), entries[mask]


def _row_numbers(ptr: Ints) -> Ints:
    """For every entry the row it belongs to."""
    return np.repeat(np.arange(len(ptr) - 1, dtype=np.int32), np.diff(ptr))


def _offsets(lengths: Iterable[int]) -> Ints:
    return np.array([0, *itertools.accumulate(lengths)], dtype=np.int32)


def _ints(values: Iterable[int]) -> Ints:
    return np.fromiter(values, dtype=np.int32)
