"""A planning problem in libPRADA's four files -> ground rules, initial state and goal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from cognitive_arch.relational.derived import derive
from cognitive_arch.relational.libprada.definitions import Definer
from cognitive_arch.relational.libprada.grounding import Grounder
from cognitive_arch.relational.libprada.literals import LiteralReader, Role
from cognitive_arch.relational.libprada.model import (
    LiftedRule,
    Pattern,
    Symbol,
    SymbolKind,
    SymbolTable,
)
from cognitive_arch.relational.libprada.rules import read_rules
from cognitive_arch.relational.libprada.symbols import read_symbols
from cognitive_arch.relational.libprada.text import Source, quote
from cognitive_arch.relational.rules import GroundRules
from cognitive_arch.relational.symbols import Atom, Goal, State


@dataclass(frozen=True)
class LibPradaProblem:
    """What is true at first (derived atoms included), what is wanted, and what can be done.

    `rules` carry the definitions of derived atoms. Several rules may be of one action.
    """

    state: State
    goal: Goal
    rules: GroundRules
    symbols: tuple[Symbol, ...]
    constants: tuple[str, ...]

    def names(self, *kinds: SymbolKind) -> tuple[str, ...]:
        """The names of all symbols of these kinds, as declared."""
        return tuple(symbol.name for symbol in self.symbols if symbol.kind in kinds)


def load_problem(symbols: Path, rules: Path, state: Path, goal: Path) -> LibPradaProblem:
    """Read the four files of a problem and ground it.

    Raises `RuleError` if one is missing, too large or malformed; the message names file and line.
    """
    declared = Source.read(symbols, "symbols file")
    table = read_symbols(declared)
    ruled = Source.read(rules, "rules file")
    lifted = read_rules(ruled, table)
    facts = _conjunction(Source.read(state, "state file"), table, Role.STATE)
    wanted = _conjunction(Source.read(goal, "goal file"), table, Role.GOAL)
    constants = _constants((*facts, *wanted), lifted, table)
    primitive = frozenset(
        p.ground({}).atom for p in facts if p.positive and p.symbol.kind is SymbolKind.PRIMITIVE
    )
    aims = tuple(dict.fromkeys(p.ground({}) for p in wanted))
    ground = tuple(Grounder(lifted, constants, primitive, ruled).ground())
    definer = Definer(table, (*wanted, *(p for r in lifted for p in r.context)), constants, declared)
    definer.need(aims)
    if table.definitions:
        for rule in ground:
            definer.need(rule.context)
    definitions = definer.definitions()
    return LibPradaProblem(
        state=derive(primitive, definitions),
        goal=aims,
        rules=GroundRules(ground, definitions),
        symbols=tuple(table.symbols.values()),
        constants=constants,
    )


def _conjunction(source: Source, table: SymbolTable, role: Role) -> list[Pattern]:
    """The literals of a state or goal file: at least one, and none together with its negation."""
    reader = LiteralReader(source, table.symbols)
    found: list[Pattern] = []
    signs: dict[Atom, bool] = {}
    for line in source.lines():
        for pattern in reader.read(line, role):
            atom = pattern.ground({}).atom
            if signs.setdefault(atom, pattern.positive) != pattern.positive:
                what = f"{quote(str(atom))} is said to be both true and false"
                raise source.fail(line.number, f"{what}; valid: each literal in one sign")
            found.append(pattern)
    if not found:
        raise source.empty("literals such as on(66 67) or -on(66 67)")
    return found


def _constants(
    literals: Iterable[Pattern], rules: Iterable[LiftedRule], table: SymbolTable
) -> tuple[str, ...]:
    """All that are named anywhere: numbers by size, then names."""
    found = set[str]().union(
        *(p.constants for p in literals),
        *(p.constants for rule in rules for p in rule.patterns if p.args),
        *(p.constants for definition in table.definitions.values() for p in definition.base),
    )
    return tuple(sorted(found, key=lambda name: (not name.isdecimal(), len(name) * name.isdecimal(), name)))
