"""Lifted definitions of derived symbols -> ground ones of those atoms that somebody asks for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import permutations, product

from cognitive_arch.errors import RuleError
from cognitive_arch.relational.derived import AnyOf, Closure, CountIs, Definition
from cognitive_arch.relational.libprada.model import LiftedDefinition, Pattern, SymbolKind, SymbolTable
from cognitive_arch.relational.libprada.text import Source
from cognitive_arch.relational.symbols import Atom, Literal

MAX_LITERALS = 300_000
"""Literals of ground definitions before a problem is called too large."""


class Definer:
    """Collects what is asked for, and all that this needs in turn.

    `patterns` are all literals that somebody may ask for a grounding of.
    """

    def __init__(
        self, table: SymbolTable, patterns: Iterable[Pattern], constants: Sequence[str], source: Source
    ) -> None:
        self.table = table
        self.constants = tuple(constants)
        self.source = source
        bases = (p for definition in table.definitions.values() for p in definition.base)
        self._derived = {p.predicate: p for p in (*patterns, *bases) if p.symbol.name in table.definitions}
        self._asked: set[Atom] = set()
        self._waiting: list[tuple[Pattern, Atom]] = []
        self._made = 0

    def need(self, literals: Iterable[Literal]) -> None:
        """Ask for the definitions of those literals that are derived."""
        for literal in literals:
            pattern = self._derived.get(literal.atom.predicate)
            if pattern is None:
                continue
            # One closure defines all its atoms.
            whole = pattern.symbol.kind is SymbolKind.TRANSCLOSURE
            atom = Atom(literal.atom.predicate, ()) if whole else literal.atom
            if atom not in self._asked:
                self._asked.add(atom)
                self._waiting.append((pattern, atom))

    def definitions(self) -> tuple[Definition, ...]:
        """What was asked for and all that it needs, each after those it needs.

        The order is that of the symbols, which are free of cycles; so nothing has to be compared.
        """
        rank = {name: index for index, name in enumerate(self.table.definitions)}
        made: list[tuple[int, Atom, Definition]] = []
        while self._waiting:
            pattern, atom = self._waiting.pop()
            made.append((rank[pattern.symbol.name], atom, self._define(pattern, atom)))
        return tuple(definition for _, _, definition in sorted(made, key=lambda entry: entry[:2]))

    def _define(self, pattern: Pattern, atom: Atom) -> Definition:
        lifted = self.table.definitions[pattern.symbol.name]
        binding = dict(enumerate(atom.args))
        if lifted.symbol.kind is SymbolKind.TRANSCLOSURE:
            base = lifted.base[0]
            for x, y in product(self.constants, repeat=2):
                self._literal(lifted, base, {0: x, 1: y})
            return Closure(lifted.symbol.name, base.predicate, self.constants)
        if pattern.comparison is not None:
            literals = tuple(
                self._literal(lifted, lifted.base[0], binding | dict(zip(lifted.free, args, strict=True)))
                for args in product(self.constants, repeat=len(lifted.free))
            )
            return CountIs(atom, literals, pattern.comparison, pattern.value)
        groups = self._all(lifted, binding) if lifted.universal else self._any(lifted, binding)
        return AnyOf(atom, tuple(groups))

    def _others(self, binding: dict[int, str]) -> list[str]:
        """What a quantified variable ranges over: the constants that are no arguments of the symbol."""
        return [c for c in self.constants if c not in binding.values()]

    def _any(self, lifted: LiftedDefinition, binding: dict[int, str]) -> Iterator[tuple[Literal, ...]]:
        """One group for each binding of the free variables, which are distinct."""
        for args in permutations(self._others(binding), len(lifted.free)):
            bound = binding | dict(zip(lifted.free, args, strict=True))
            yield tuple(dict.fromkeys([self._literal(lifted, p, bound) for p in lifted.base]))

    def _all(self, lifted: LiftedDefinition, binding: dict[int, str]) -> Iterator[tuple[Literal, ...]]:
        """One group that holds the literals for every binding of the free variables."""
        group: dict[Literal, None] = {}
        for pattern in lifted.base:
            free = [v for v in lifted.free if v in pattern.variables]
            for args in product(self._others(binding), repeat=len(free)):
                bound = binding | dict(zip(free, args, strict=True))
                group[self._literal(lifted, pattern, bound)] = None
        yield tuple(group)

    def _literal(self, lifted: LiftedDefinition, pattern: Pattern, binding: dict[int, str]) -> Literal:
        self._made += 1
        if self._made > MAX_LITERALS:
            raise self._too_large(lifted)
        literal = pattern.ground(binding)
        self.need((literal,))
        return literal

    def _too_large(self, lifted: LiftedDefinition) -> RuleError:
        what = f"over {len(self.constants)} constants the definition of {lifted.symbol.name} is too large"
        return self.source.fail(lifted.symbol.line, f"{what}; valid: at most {MAX_LITERALS} literals in all")
