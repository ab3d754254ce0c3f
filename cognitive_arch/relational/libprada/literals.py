"""Literals as libPRADA writes them: `on(X Y)`, `-on(X Y)`, `height(X)>=2`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import Enum

from cognitive_arch.errors import RuleError
from cognitive_arch.relational.derived import Comparison
from cognitive_arch.relational.libprada.model import (
    FIRST_CONSTANT,
    VARIABLES,
    Pattern,
    Symbol,
    SymbolKind,
    Term,
    variable_name,
)
from cognitive_arch.relational.libprada.text import Line, Source, quote, unknown_name

TOKEN = re.compile(r"[^\s,()]++\([^()]*+\)(?:[=<>+?!]++[^\s,()]*+)?|[^\s,]++")
"""A literal, or anything else up to the next space. It never goes back, so noise takes linear time."""

_LITERAL = re.compile(r"(-?)([^\s,()=<>-][^\s,()=<>]*)\(([^()]*)\)(?:([=<>+?!]+)(.*))?")
_CONSTANT = re.compile(r"[A-Za-z0-9_][\w-]*", re.ASCII)
_EXAMPLE = "literals such as on(X Y) or -on(X Y)"
_LONGEST_NUMBER = 9


class Role(Enum):
    """Where a literal stands: a name for messages, the kinds allowed there, and whether variables are."""

    ACTION = "an action", frozenset({SymbolKind.ACTION}), True
    CONTEXT = "a context", frozenset(SymbolKind) - {SymbolKind.ACTION}, True
    OUTCOME = "an outcome", frozenset({SymbolKind.PRIMITIVE}), True
    STATE = "a state", frozenset(SymbolKind) - {SymbolKind.ACTION}, False
    GOAL = "a goal", frozenset(SymbolKind) - {SymbolKind.ACTION}, False
    DEFINITION = "a definition", frozenset(SymbolKind) - {SymbolKind.ACTION}, True

    def __init__(self, title: str, kinds: frozenset[SymbolKind], variables: bool) -> None:
        self.title = title
        self.kinds = kinds
        self.variables = variables


class LiteralReader:
    """Reads the literals of one file; each text is looked at once, for large files repeat them a lot."""

    def __init__(self, source: Source, symbols: Mapping[str, Symbol]) -> None:
        self.source = source
        self.symbols = symbols
        self._known: dict[Role, dict[str, Pattern]] = {role: {} for role in Role}

    def read(self, line: Line, role: Role) -> list[Pattern]:
        """The literals of a line; raises `RuleError` at the first that is none."""
        known = self._known[role]
        found = []
        # One by one: a list of all tokens of a line of noise would take much memory before it fails.
        for match in TOKEN.finditer(line.text):
            token = match[0]
            if token not in known:
                known[token] = self._pattern(token, role, line.number)
            found.append(known[token])
        return found

    def _pattern(self, token: str, role: Role, line: int) -> Pattern:
        match = _LITERAL.fullmatch(token)
        if match is None:
            raise self._malformed(token, line)
        sign, name, arguments, operator, value = match.groups()
        symbol = self._symbol(name, role, line)
        args = self._arguments(arguments, symbol, role, line)
        if role is Role.ACTION and sign:
            raise self.source.fail(line, f"{quote(token)}: an action cannot be negated; valid: {name}(...)")
        comparison, number = self._comparison(symbol, operator, value, line)
        return Pattern.make(symbol, args, not sign, comparison, number)

    def _malformed(self, token: str, line: int) -> RuleError:
        if "(" in token and ")" not in token:
            problem = f"the parenthesis in {quote(token)} is not closed"
        else:
            problem = f"cannot read {quote(token)}"
        return self.source.fail(line, f"{problem}; valid: {_EXAMPLE}")

    def _symbol(self, name: str, role: Role, line: int) -> Symbol:
        symbol = self.symbols.get(name)
        valid = [s.name for s in self.symbols.values() if s.kind in role.kinds] if symbol is None else []
        if symbol is None:
            raise self.source.fail(line, unknown_name("symbol", name, valid))
        if symbol.kind not in role.kinds:
            kinds = ", ".join(kind for kind in SymbolKind if kind in role.kinds)
            what = f"{name} is declared as {symbol.kind}"
            raise self.source.fail(line, f"{what}, which cannot stand in {role.title}; valid: {kinds}")
        return symbol

    def _arguments(self, text: str, symbol: Symbol, role: Role, line: int) -> tuple[Term, ...]:
        args = tuple(self._term(word, line) for word in text.replace(",", " ").split())
        if len(args) != symbol.arity:
            declared = f"{symbol.name} takes {symbol.arity} arguments"
            raise self.source.fail(
                line, f"{declared}, here it has {len(args)}; valid: as in the symbols file"
            )
        for term in args:
            if isinstance(term, int) and not role.variables:
                name = variable_name(term)
                valid = f"constants, that is integers from {FIRST_CONSTANT} or names"
                raise self.source.fail(line, f"{name} is a variable, not for {role.title}; valid: {valid}")
        return args

    def _term(self, word: str, line: int) -> Term:
        name = word.partition("/")[0]
        variable = VARIABLES.get(name)
        if variable is not None:
            return variable
        # To libPRADA 07 is the variable 7.
        if _CONSTANT.fullmatch(name) is None or (name.isdecimal() and name.startswith("0")):
            valid = f"X, Y, Z, V, W, U, integers from {FIRST_CONSTANT}, or names"
            raise self.source.fail(line, f"cannot read the argument {quote(word)}; valid: {valid}")
        return name

    def _comparison(
        self, symbol: Symbol, operator: str | None, value: str | None, line: int
    ) -> tuple[Comparison | None, int]:
        name = symbol.name
        if symbol.kind is not SymbolKind.COUNT:
            if operator is not None:
                raise self.source.fail(
                    line, f"{name} is true or false and cannot be compared; valid: {name}(...)"
                )
            return None, 0
        valid = ", ".join(f"{name}(...){c}2" for c in Comparison)
        if operator is None or value is None:
            raise self.source.fail(line, f"{name} is a count and must be compared; valid: {valid}")
        if operator not in list(Comparison):
            raise self.source.fail(line, f"{name} cannot be compared by {quote(operator)}; valid: {valid}")
        if not (value.isascii() and value.isdecimal() and len(value) <= _LONGEST_NUMBER):
            raise self.source.fail(line, f"{name} is compared with {quote(value)}; valid: {valid}")
        return Comparison(operator), int(value)
