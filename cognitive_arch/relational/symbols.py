"""Predicates, terms, literals and atoms.

Lifted and ground forms are separate types: a `LiftedLiteral` may hold variables and the macros `ALL`
and `OTHERHAND` (thesis Sec. 6.4.5.1), a `Literal` holds entity names only. A state is a frozen set of
the atoms that are true; every other atom is false.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

ALL = "ALL"
OTHERHAND = "OTHERHAND"


class Atom(NamedTuple):
    """A ground atom such as `on(Ham,Bun-bottom)`."""

    predicate: str
    args: tuple[str, ...]

    def __str__(self) -> str:
        """`on(Ham,Bun-bottom)`; a compared count, whose predicate is `height>=2`, as `height(Ham)>=2`."""
        name = self.predicate.rstrip("0123456789").rstrip("<>=") if self.predicate[-1:].isdigit() else ""
        if not name or self.predicate[len(name)] not in "<>=":
            name = self.predicate
        return f"{name}({','.join(self.args)}){self.predicate[len(name) :]}"


class Literal(NamedTuple):
    """A ground atom or its negation: `not isClear(LeftHand)`."""

    atom: Atom
    positive: bool = True

    def __str__(self) -> str:
        return str(self.atom) if self.positive else f"not {self.atom}"

    def negated(self) -> Literal:
        return Literal(self.atom, not self.positive)

    def holds(self, state: State) -> bool:
        """Whether the literal is true in `state`."""
        return (self.atom in state) == self.positive


State: TypeAlias = frozenset[Atom]
Goal: TypeAlias = tuple[Literal, ...]


class GroundAction(NamedTuple):
    """An action on named entities, such as `graspWith(Ham,LeftHand)`."""

    name: str
    args: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.name}({','.join(self.args)})"


DO_NOTHING = GroundAction("doNothing", ())


@dataclass(frozen=True, slots=True)
class Predicate:
    """A predicate and the types of its arguments."""

    name: str
    types: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LiftedLiteral:
    """A literal over variables, entity names and the macros `ALL` and `OTHERHAND`."""

    predicate: str
    args: tuple[str, ...]
    positive: bool = True

    def __str__(self) -> str:
        text = f"{self.predicate}({', '.join(self.args)})"
        return text if self.positive else f"not {text}"


_LITERAL = re.compile(r"\s*(not\s+|-|¬)?\s*([A-Za-z_][\w-]*)\s*\(\s*([^()]*?)\s*\)\s*")


def parse_literal(text: str) -> Literal:
    """Read `on(Ham,Bun-bottom)` or `not isClear(LeftHand)`; raises `ValueError` on anything else."""
    match = _LITERAL.fullmatch(text)
    if match is None:
        raise ValueError(f"not a literal: '{text}'")
    sign, predicate, args = match.groups()
    names = tuple(a.strip() for a in args.split(",")) if args else ()
    return Literal(Atom(predicate, names), sign is None)


def parse_action(text: str) -> GroundAction:
    """Read `graspWith(Ham,LeftHand)`, the inverse of `str`; raises `ValueError` on anything else."""
    literal = parse_literal(text)
    if not literal.positive:
        raise ValueError(f"not an action: '{text}'")
    return GroundAction(literal.atom.predicate, literal.atom.args)


def satisfied(goal: Goal, state: State) -> bool:
    """Whether every literal of `goal` is true in `state`."""
    return all(literal.holds(state) for literal in goal)
