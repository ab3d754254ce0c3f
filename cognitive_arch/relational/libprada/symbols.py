"""`symbols.dat`: names, arities and kinds, and from what derived symbols follow."""

from __future__ import annotations

import re
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter

from cognitive_arch.errors import RuleError
from cognitive_arch.relational.libprada.literals import TOKEN, LiteralReader, Role
from cognitive_arch.relational.libprada.model import (
    MAX_ARITY,
    LiftedDefinition,
    Pattern,
    Symbol,
    SymbolKind,
    SymbolTable,
    variable_name,
)
from cognitive_arch.relational.libprada.text import Line, Source, quote

NAME = re.compile(r"[a-z0-9][\w-]*", re.ASCII)
"""A symbol's name; libPRADA takes a word that starts with a capital for a quantifier or a variable."""

BINARY = "binary"
INTEGERS = "integers"
_RANGES = (BINARY, INTEGERS, "integer_set", "reals")
_KINDS = {str(kind): kind for kind in SymbolKind}
_ARROW = "<--"
_FORM = "name arity type range"


def read_symbols(source: Source) -> SymbolTable:
    """Read and check all declarations; raises `RuleError`. Definitions may use symbols of later lines."""
    return _SymbolsFile(source).read()


class _SymbolsFile:
    """Declarations first, then definitions, for these speak of the symbols."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.symbols: dict[str, Symbol] = {}
        self.reader = LiteralReader(source, self.symbols)

    def read(self) -> SymbolTable:
        """The whole file."""
        definitions: list[tuple[Symbol, Line]] = []
        for line in self.source.lines():
            declaration, arrow, definition = line.text.partition(_ARROW)
            symbol = self.declare(Line(line.number, declaration.strip()))
            if symbol.kind.derived and not definition.strip():
                what = f"{symbol.name} is a {symbol.kind} and needs a definition"
                raise self.fail(line, f"{what}; valid: {_FORM} {_ARROW} literals")
            if arrow and not symbol.kind.derived:
                what = f"{symbol.name} is declared as {symbol.kind} and has no definition"
                raise self.fail(line, f"{what}; valid: {_FORM}")
            if arrow:
                definitions.append((symbol, Line(line.number, definition.strip())))
        if not self.symbols:
            raise self.source.empty(f"lines of {_FORM}")
        return SymbolTable(self.symbols, self.sort([self.define(*entry) for entry in definitions]))

    def fail(self, line: Line, problem: str) -> RuleError:
        return self.source.fail(line.number, problem)

    def declare(self, line: Line) -> Symbol:
        """One declaration, without what follows its arrow."""
        if line.text.startswith("["):
            raise self.fail(line, f"argument types are not read; valid: {_FORM}")
        words = line.text.split(maxsplit=4)
        if len(words) != 4:
            raise self.fail(line, f"cannot read {quote(line.text)}; valid: {_FORM}")
        name, arity, kind, range_ = words
        if NAME.fullmatch(name) is None:
            valid = "a small letter or a digit, then letters, digits, '-' and '_'"
            raise self.fail(line, f"{quote(name)} cannot be the name of a symbol; valid: {valid}")
        if name in self.symbols:
            first = self.symbols[name].line
            raise self.fail(line, f"{name} is declared twice; valid: once, as in line {first}")
        if not (arity.isascii() and arity.isdecimal() and len(arity) < 3 and int(arity) <= MAX_ARITY):
            raise self.fail(line, f"the arity of {name} is {quote(arity)}; valid: 0 to {MAX_ARITY}")
        symbol = Symbol(name, int(arity), self.kind(kind, line), line.number)
        self.check_range(symbol, range_, line)
        self.symbols[name] = symbol
        return symbol

    def kind(self, text: str, line: Line) -> SymbolKind:
        if text not in _KINDS:
            raise self.fail(
                line, f"symbols of type {quote(text)} are not read; valid: {', '.join(SymbolKind)}"
            )
        return _KINDS[text]

    def check_range(self, symbol: Symbol, range_: str, line: Line) -> None:
        if range_ not in _RANGES:
            raise self.fail(line, f"unknown range {quote(range_)}; valid: {', '.join(_RANGES)}")
        valid = INTEGERS if symbol.kind is SymbolKind.COUNT else BINARY
        if range_ != valid:
            what = f"{symbol.name} is declared as {symbol.kind} with the range {range_}"
            raise self.fail(line, f"{what}, which is not read; valid: {valid}")

    def define(self, symbol: Symbol, line: Line) -> LiftedDefinition:
        if symbol.kind is SymbolKind.TRANSCLOSURE:
            return self.closure(symbol, line)
        quantifiers, base = self.quantified(line)
        if not base:
            raise self.fail(line, f"{symbol.name} is defined by no literal; valid: literals after {_ARROW}")
        if symbol.kind is SymbolKind.COUNT:
            self.check_count(symbol, base, line)
            return LiftedDefinition(symbol, base)
        if quantifiers >= {"A", "E"}:
            raise self.fail(line, f"{symbol.name} has two quantifiers; valid: either All or Ex")
        return LiftedDefinition(symbol, base, universal="A" in quantifiers)

    def quantified(self, line: Line) -> tuple[set[str], tuple[Pattern, ...]]:
        """First letters of the leading words with a capital, and the literals after them."""
        letters = set()
        start = 0
        for match in TOKEN.finditer(line.text):
            word = match.group()
            if not word[0].isupper() or "(" in word:
                break
            letters.add(word[0])
            start = match.end()
        rest = Line(line.number, line.text[start:])
        return letters, tuple(self.reader.read(rest, Role.DEFINITION))

    def check_count(self, symbol: Symbol, base: tuple[Pattern, ...], line: Line) -> None:
        if len(base) != 1:
            what = f"{symbol.name} counts {len(base)} literals"
            raise self.fail(line, f"{what}; valid: one, as in Num Y above(X Y)")
        if not LiftedDefinition(symbol, base).free:
            valid = f"a literal over {variable_name(min(symbol.arity, MAX_ARITY - 1))}, too"
            raise self.fail(line, f"{symbol.name} has no variable to count over; valid: {valid}")

    def closure(self, symbol: Symbol, line: Line) -> LiftedDefinition:
        words = line.text.split(maxsplit=2)
        if len(words) != 2 or words[0] != "+":
            raise self.fail(line, f"cannot read {quote(line.text)}; valid: + and a symbol of arity 2")
        base = self.symbols.get(words[1])
        binary = (SymbolKind.PRIMITIVE, SymbolKind.CONJUNCTION, SymbolKind.TRANSCLOSURE)
        if symbol.arity != 2 or base is None or base.arity != 2 or base.kind not in binary:
            what = f"{symbol.name} cannot be the closure of {quote(words[1])}"
            raise self.fail(
                line, f"{what}; valid: both declared, of arity 2, the base no action and no count"
            )
        return LiftedDefinition(symbol, (Pattern.make(base, (0, 1)),))

    def sort(self, definitions: list[LiftedDefinition]) -> Mapping[str, LiftedDefinition]:
        """Each after those it needs; raises `RuleError` if there is no such order."""
        by_name = {definition.symbol.name: definition for definition in definitions}
        needs = {
            name: sorted({p.symbol.name for p in definition.base if p.symbol.kind.derived})
            for name, definition in by_name.items()
        }
        try:
            order = tuple(TopologicalSorter(needs).static_order())
        except CycleError as error:
            cycle = error.args[1]
            what = f"derived symbols follow from each other: {quote(' <-- '.join(cycle))}"
            line = self.symbols[cycle[0]].line
            raise self.source.fail(
                line, f"{what}; valid: definitions that end in primitive symbols"
            ) from None
        return {name: by_name[name] for name in order}
