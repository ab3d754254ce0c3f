"""A ground problem -> libPRADA's four files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from itertools import count
from pathlib import Path

from cognitive_arch.errors import RuleError, one_line
from cognitive_arch.relational.libprada.model import FIRST_CONSTANT, MAX_ARITY, SymbolKind
from cognitive_arch.relational.libprada.rules import (
    ACTION,
    CONTEXT,
    DEFAULT,
    EMPTY_CONTEXT,
    NO_CHANGE,
    NOISE,
    OUTCOMES,
)
from cognitive_arch.relational.libprada.symbols import BINARY, NAME
from cognitive_arch.relational.libprada.text import quote
from cognitive_arch.relational.rules import GroundOutcome, GroundRule, derived_of
from cognitive_arch.relational.symbols import Goal, Literal, State

SYMBOLS_FILE = "symbols.dat"
RULES_FILE = "rules.dat"
STATE_FILE = "state.dat"
GOAL_FILE = "goal.dat"

_NUMBER = re.compile(r"[1-9]\d{1,8}", re.ASCII)
_ROUNDING = 1e-9


def write_problem(folder: Path, rules: Sequence[GroundRule], state: State, goal: Goal) -> Mapping[str, str]:
    """Write `symbols.dat`, `rules.dat`, `state.dat` and `goal.dat` into `folder`, which is made if needed.

    Returns the number that each entity has in the files: names that are integers from 10 stay, others are
    numbered in their order. Rules that can never apply, for their context contradicts itself, are left out.
    Raises `RuleError` for what these files cannot say, before anything is written.
    """
    writer = _Writer(rules, state, goal)
    files = {
        SYMBOLS_FILE: writer.symbols(),
        RULES_FILE: writer.rules(),
        STATE_FILE: writer.state(),
        GOAL_FILE: writer.conjunction(goal) + "\n",
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise RuleError(f"cannot write to {quote(str(folder))}: {one_line(error)}") from None
    return writer.numbers


class _Writer:
    """Checks a problem and turns its parts into text."""

    def __init__(self, rules: Sequence[GroundRule], state: State, goal: Goal) -> None:
        self.ground = [
            rule for rule in rules if len({x.atom for x in rule.context}) == len(set(rule.context))
        ]
        self.facts = state
        self.aims = goal
        self.declared: dict[str, tuple[int, SymbolKind]] = {}
        self.check(rules)
        changes = (x.atom for rule in self.ground for o in rule.outcomes for x in o.literals)
        contexts = (x.atom for rule in self.ground for x in rule.context)
        self.atoms = sorted({*state, *(x.atom for x in goal), *contexts, *changes})
        for atom in self.atoms:
            self.declare(atom.predicate, atom.args, SymbolKind.PRIMITIVE)
        for rule in self.ground:
            self.declare(rule.action.name, rule.action.args, SymbolKind.ACTION)
        named = {a for atom in self.atoms for a in atom.args} | {
            a for r in self.ground for a in r.action.args
        }
        self.numbers = _numbers(named)

    def check(self, rules: Sequence[GroundRule]) -> None:
        if derived_of(rules):
            names = sorted({a.predicate for d in derived_of(rules) for a in d.defines})
            what = f"derived predicates are not written, only read: {one_line(', '.join(names))}"
            raise RuleError(f"{what}; valid: rules, state and goal over primitive predicates")
        if not self.ground:
            raise RuleError("there is no rule to write; valid: one rule or more")
        if not self.aims:
            raise RuleError("there is no goal to write; valid: one literal or more")
        if any(literal.negated() in self.aims for literal in self.aims):
            raise RuleError("the goal contradicts itself; valid: each literal in one sign")
        for rule in self.ground:
            self.check_outcomes(rule)

    def check_outcomes(self, rule: GroundRule) -> None:
        total = sum(outcome.probability for outcome in rule.outcomes)
        in_range = all(0 <= outcome.probability <= 1 for outcome in rule.outcomes)
        if not rule.outcomes or not in_range or total > 1 + _ROUNDING:
            what = f"the outcomes of {rule.action} have the probabilities"
            listed = ", ".join(f"{outcome.probability:g}" for outcome in rule.outcomes) or "none"
            raise RuleError(f"{what} {one_line(listed)}; valid: 0 to 1, with a sum of at most 1")
        for outcome in rule.outcomes:
            if any(literal.negated() in outcome.literals for literal in outcome.literals):
                what = f"an outcome of {rule.action} contradicts itself"
                raise RuleError(f"{what}; valid: each literal in one sign")

    def declare(self, name: str, args: tuple[str, ...], kind: SymbolKind) -> None:
        if NAME.fullmatch(name) is None or name == DEFAULT:
            valid = f"a small letter or a digit, then letters, digits, '-' and '_', and not {DEFAULT}"
            raise RuleError(f"libPRADA cannot read the name {quote(name)}; valid: {valid}")
        if len(args) > MAX_ARITY:
            raise RuleError(f"{name} has {len(args)} arguments; valid: at most {MAX_ARITY}")
        if self.declared.setdefault(name, (len(args), kind)) != (len(args), kind):
            what = f"{name} is used with different numbers of arguments, or both as predicate and as action"
            raise RuleError(f"{what}; valid: one arity and one use for each name")

    def header(self) -> list[str]:
        """Comments that say which number stands for whom."""
        return [f"# {number} = {one_line(name)}" for name, number in self.numbers.items() if name != number]

    def symbols(self) -> str:
        entries = sorted(self.declared.items(), key=lambda entry: (entry[1][1], entry[0]))
        lines = [f"{name} {arity} {kind} {BINARY}" for name, (arity, kind) in entries]
        return "\n".join([*self.header(), *lines, ""])

    def rules(self) -> str:
        blocks = "\n\n".join(self.block(rule) for rule in self.ground)
        return "\n".join([*self.header(), f"# {len(self.ground)} ground rules", "", blocks, ""])

    def block(self, rule: GroundRule) -> str:
        action = self.call(rule.action.name, rule.action.args)
        context = self.conjunction(rule.context) or EMPTY_CONTEXT
        outcomes = [self.outcome(o) for o in rule.outcomes]
        # Noise is what the others leave, so its digits after the twelfth say nothing.
        noise = f"{_exact(round(rule.noise, 12))} {NOISE}"
        lines = [ACTION, f"  {action}", CONTEXT, f"  {context}", OUTCOMES]
        return "\n".join([*lines, *(f"  {line}" for line in (*outcomes, noise))])

    def outcome(self, outcome: GroundOutcome) -> str:
        return f"{_exact(outcome.probability)} {self.conjunction(outcome.literals) or NO_CHANGE}"

    def state(self) -> str:
        """What is true, then what is false of all that the problem speaks of: libPRADA wants both."""
        true = [Literal(atom) for atom in self.atoms if atom in self.facts]
        false = [Literal(atom, False) for atom in self.atoms if atom not in self.facts]
        return self.conjunction((*true, *false)) + "\n"

    def conjunction(self, literals: Iterable[Literal]) -> str:
        return " ".join(self.literal(literal) for literal in literals)

    def literal(self, literal: Literal) -> str:
        call = self.call(literal.atom.predicate, literal.atom.args)
        return call if literal.positive else f"-{call}"

    def call(self, name: str, args: tuple[str, ...]) -> str:
        return f"{name}({' '.join(self.numbers[arg] for arg in args)})"


def _numbers(names: Iterable[str]) -> dict[str, str]:
    """A number for every name; integers that libPRADA takes for constants stay as they are."""
    ordered = sorted(names, key=lambda name: (len(name) if _NUMBER.fullmatch(name) else 0, name))
    kept = {name for name in ordered if _NUMBER.fullmatch(name)}
    fresh = (str(number) for number in count(FIRST_CONSTANT) if str(number) not in kept)
    return {name: name if name in kept else next(fresh) for name in ordered}


def _exact(probability: float) -> str:
    """All digits that it takes to read the same number, without an exponent."""
    return format(Decimal(repr(float(probability))), "f")
