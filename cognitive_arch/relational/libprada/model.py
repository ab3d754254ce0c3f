"""What libPRADA's files speak of: symbols, literals over variables, lifted rules and definitions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

from cognitive_arch.relational.derived import Comparison
from cognitive_arch.relational.symbols import Atom, Literal

VARIABLES: Mapping[str, int] = {
    **{letter: number for number, letter in enumerate("XYZVWU")},
    **{str(number): number for number in range(10)},
}
"""Every name of a variable; any other argument is a constant."""

FIRST_CONSTANT = 10
"""libPRADA takes smaller numbers for variables."""

MAX_ARITY = len(set(VARIABLES.values()))

Term: TypeAlias = int | str
"""A variable's number, or a constant's name."""


def variable_name(variable: int) -> str:
    """The name people know a variable by: `X` for 0; `7` for 7, which has no letter."""
    return next(name for name, number in VARIABLES.items() if number == variable)


class SymbolKind(StrEnum):
    """How a symbol gets its value; the word stands in `symbols.dat`."""

    ACTION = "action"
    PRIMITIVE = "primitive"
    CONJUNCTION = "conjunction"
    TRANSCLOSURE = "transclosure"
    COUNT = "count"

    @property
    def derived(self) -> bool:
        """Whether the value follows from other symbols."""
        return self not in (SymbolKind.ACTION, SymbolKind.PRIMITIVE)


@dataclass(frozen=True, slots=True)
class Symbol:
    """A declared name."""

    name: str
    arity: int
    kind: SymbolKind
    line: int = 0


@dataclass(frozen=True, slots=True)
class Pattern:
    """A literal, or an action, over variables and constants.

    `predicate` is the symbol's name; with a count, it holds the comparison, too: `height>=2`.
    """

    symbol: Symbol
    predicate: str
    args: tuple[Term, ...]
    positive: bool
    comparison: Comparison | None
    value: int
    variables: frozenset[int]
    literal: Literal | None
    """The ground literal, made once, if there are no variables."""

    @classmethod
    def make(
        cls,
        symbol: Symbol,
        args: tuple[Term, ...],
        positive: bool = True,
        comparison: Comparison | None = None,
        value: int = 0,
    ) -> Pattern:
        """Fill in what follows from the other fields."""
        predicate = symbol.name if comparison is None else f"{symbol.name}{comparison}{value}"
        variables = frozenset(term for term in args if isinstance(term, int))
        literal = None if variables else Literal(Atom(predicate, tuple(map(str, args))), positive)
        return cls(symbol, predicate, args, positive, comparison, value, variables, literal)

    @property
    def constants(self) -> frozenset[str]:
        """The constants named."""
        return frozenset(term for term in self.args if isinstance(term, str))

    def ground(self, binding: Mapping[int, str]) -> Literal:
        """The literal with its variables bound."""
        if self.literal is not None:
            return self.literal
        args = tuple([binding[term] if isinstance(term, int) else term for term in self.args])
        return Literal(Atom(self.predicate, args), self.positive)


@dataclass(frozen=True, slots=True)
class LiftedDefinition:
    """From what a derived symbol follows; its parameters are the variables 0, 1, ... below its arity.

    `universal` says that variables beyond the arity are all-quantified; else they are existential.
    """

    symbol: Symbol
    base: tuple[Pattern, ...]
    universal: bool = False

    @property
    def free(self) -> tuple[int, ...]:
        """The variables that are not parameters."""
        used = frozenset().union(*(pattern.variables for pattern in self.base))
        return tuple(sorted(v for v in used if v >= self.symbol.arity))


@dataclass(frozen=True, slots=True)
class SymbolTable:
    """All symbols of a problem; `definitions` in an order in which each comes after those it needs."""

    symbols: Mapping[str, Symbol]
    definitions: Mapping[str, LiftedDefinition]


@dataclass(frozen=True, slots=True)
class LiftedOutcome:
    """One listed outcome; no literals: nothing changes."""

    probability: float
    literals: tuple[Pattern, ...]


@dataclass(frozen=True, slots=True)
class LiftedRule:
    """A rule over variables and constants; what its outcomes leave of the probability is noise."""

    action: Pattern
    context: tuple[Pattern, ...]
    outcomes: tuple[LiftedOutcome, ...]
    line: int

    @property
    def patterns(self) -> tuple[Pattern, ...]:
        """Everything it speaks of."""
        return (self.action, *self.context, *(p for outcome in self.outcomes for p in outcome.literals))
