"""Derived predicates: atoms that follow from others and are never set by an action.

libPRADA knows three kinds besides primitive symbols: conjunctions (with free variables all- or
existentially quantified), transitive closures and counts. Here they are ground: a definition names the
atom it defines and the literals that it follows from.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

from cognitive_arch.errors import GroundingError
from cognitive_arch.relational.symbols import Atom, Literal, State


class Comparison(StrEnum):
    """How a count is compared with a number."""

    EQUAL = "="
    LESS = "<"
    LESS_EQUAL = "<="
    GREATER = ">"
    GREATER_EQUAL = ">="

    def holds(self, count: int, value: int) -> bool:
        """Whether `count` stands in this relation to `value`."""
        match self:
            case Comparison.EQUAL:
                return count == value
            case Comparison.LESS:
                return count < value
            case Comparison.LESS_EQUAL:
                return count <= value
            case Comparison.GREATER:
                return count > value
            case Comparison.GREATER_EQUAL:
                return count >= value


@dataclass(frozen=True, slots=True)
class AnyOf:
    """`atom` is true if all literals of at least one group hold.

    One group is a plain conjunction (or one whose free variables are all-quantified and written out); an
    existential quantifier gives one group per binding. No group at all is never true.
    """

    atom: Atom
    groups: tuple[tuple[Literal, ...], ...]

    @property
    def defines(self) -> tuple[Atom, ...]:
        """The atoms this definition gives a value to."""
        return (self.atom,)

    @property
    def needs(self) -> frozenset[Atom]:
        """The atoms it looks at."""
        return frozenset(literal.atom for group in self.groups for literal in group)

    def true_atoms(self, state: State) -> tuple[Atom, ...]:
        """Those of `defines` that hold in `state`."""
        holds = any(all(literal.holds(state) for literal in group) for group in self.groups)
        return (self.atom,) if holds else ()


@dataclass(frozen=True, slots=True)
class Closure:
    """`predicate(x,y)` is true if a chain of one or more `base` atoms leads from x to y."""

    predicate: str
    base: str
    entities: tuple[str, ...]

    @property
    def defines(self) -> tuple[Atom, ...]:
        """One atom for every ordered pair of entities, x = y included: a cycle leads back to itself."""
        return tuple(Atom(self.predicate, (x, y)) for x in self.entities for y in self.entities)

    @property
    def needs(self) -> frozenset[Atom]:
        """The atoms it looks at."""
        return frozenset(Atom(self.base, atom.args) for atom in self.defines)

    def true_atoms(self, state: State) -> tuple[Atom, ...]:
        """Those of `defines` that hold in `state`."""
        after = {x: [y for y in self.entities if Atom(self.base, (x, y)) in state] for x in self.entities}
        found: list[Atom] = []
        for start in self.entities:
            seen: set[str] = set()
            frontier = list(after[start])
            while frontier:
                here = frontier.pop()
                if here not in seen:
                    seen.add(here)
                    frontier.extend(after[here])
            found.extend(Atom(self.predicate, (start, end)) for end in self.entities if end in seen)
        return tuple(found)


@dataclass(frozen=True, slots=True)
class CountIs:
    """`atom` is true if as many of `literals` hold as `comparison` with `value` asks for."""

    atom: Atom
    literals: tuple[Literal, ...]
    comparison: Comparison
    value: int

    @property
    def defines(self) -> tuple[Atom, ...]:
        """The atoms this definition gives a value to."""
        return (self.atom,)

    @property
    def needs(self) -> frozenset[Atom]:
        """The atoms it looks at."""
        return frozenset(literal.atom for literal in self.literals)

    def true_atoms(self, state: State) -> tuple[Atom, ...]:
        """Those of `defines` that hold in `state`."""
        count = sum(literal.holds(state) for literal in self.literals)
        return (self.atom,) if self.comparison.holds(count, self.value) else ()


Definition: TypeAlias = AnyOf | Closure | CountIs


def in_order(definitions: Iterable[Definition]) -> tuple[Definition, ...]:
    """`definitions` so that each comes after those it needs; raises `GroundingError` if they are cyclic."""
    waiting = list(definitions)
    undefined = {atom for definition in waiting for atom in definition.defines}
    ordered: list[Definition] = []
    while waiting:
        ready = [d for d in waiting if undefined.isdisjoint(d.needs)]
        if not ready:
            names = sorted({atom.predicate for d in waiting for atom in d.defines})
            raise GroundingError(f"derived predicates are defined by each other: {', '.join(names)}")
        undefined.difference_update(atom for d in ready for atom in d.defines)
        ordered.extend(ready)
        waiting = [d for d in waiting if d not in ready]
    return tuple(ordered)


def derive(state: State, definitions: Sequence[Definition]) -> State:
    """`state` with every defined atom set as its definition says; `definitions` as from `in_order`."""
    for definition in definitions:
        state = state.difference(definition.defines).union(definition.true_atoms(state))
    return state
