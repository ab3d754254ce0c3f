"""`rules.dat`: lifted or ground rules with their outcomes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from cognitive_arch.errors import RuleError
from cognitive_arch.relational.libprada.literals import LiteralReader, Role
from cognitive_arch.relational.libprada.model import (
    LiftedOutcome,
    LiftedRule,
    Pattern,
    SymbolTable,
    variable_name,
)
from cognitive_arch.relational.libprada.text import Line, Source, quote

ACTION = "ACTION:"
CONTEXT = "CONTEXT:"
OUTCOMES = "OUTCOMES:"
EMPTY_CONTEXT = "--"
NO_CHANGE = "<no-change>"
NOISE = "<noise>"
DEFAULT = "default"

_KEYWORDS = (ACTION, CONTEXT, OUTCOMES)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_DEFAULT_ACTION = re.compile(rf"{DEFAULT}\(\s*\)")
_TOLERANCE = 1e-3
_ROUNDING = 1e-9
"""Sums closer than this are equal."""
_OUTCOME = f"a probability, then literals, {NO_CHANGE} or {NOISE}"


def read_rules(source: Source, table: SymbolTable) -> tuple[LiftedRule, ...]:
    """Read and check all rules but the default rule, which changes nothing; raises `RuleError`."""
    return _RulesFile(source, table).read()


class _RulesFile:
    """Reads block after block, one line ahead."""

    def __init__(self, source: Source, table: SymbolTable) -> None:
        self.source = source
        self.reader = LiteralReader(source, table.symbols)
        self.lines = source.lines()
        self.ahead = next(self.lines, None)

    def read(self) -> tuple[LiftedRule, ...]:
        if self.ahead is None:
            raise self.source.empty(f"rules of {ACTION}, {CONTEXT} and {OUTCOMES}")
        rules = []
        while self.ahead is not None:
            rule = self.rule()
            if rule is not None:
                rules.append(rule)
        if not rules:
            raise self.source.fail(
                self.source.last_line, "there is no rule besides the default; valid: rules"
            )
        return tuple(rules)

    def fail(self, line: Line, problem: str) -> RuleError:
        return self.source.fail(line.number, problem)

    def take(self, wanted: str) -> Line:
        """The next line; raises `RuleError` at the end of the file."""
        if self.ahead is None:
            raise self.source.fail(self.source.last_line, f"the file ends within a rule; valid: {wanted}")
        line, self.ahead = self.ahead, next(self.lines, None)
        return line

    def keyword(self, word: str) -> Line:
        line = self.take(word)
        if line.text != word:
            raise self.fail(line, f"cannot read {quote(line.text)}; valid: {word}")
        return line

    def body(self, wanted: str) -> list[Line]:
        """The lines up to the next keyword: at least one."""
        lines = []
        while self.ahead is not None and self.ahead.text not in _KEYWORDS:
            lines.append(self.take(wanted))
        if not lines:
            missing = self.take(wanted)
            raise self.fail(
                missing, f"{missing.text} stands where a rule has something else; valid: {wanted}"
            )
        return lines

    def rule(self) -> LiftedRule | None:
        """One block; None for the default rule."""
        self.keyword(ACTION)
        line = self.take("an action")
        default = _DEFAULT_ACTION.fullmatch(line.text) is not None
        actions = [] if default else self.reader.read(line, Role.ACTION)
        if not default and len(actions) != 1:
            raise self.fail(line, f"here are {len(actions)} actions; valid: one")
        self.keyword(CONTEXT)
        context = [(c, self.context(c)) for c in self.body(f"literals, or {EMPTY_CONTEXT} for none")]
        self.keyword(OUTCOMES)
        outcomes = self.outcomes(self.body(_OUTCOME), default)
        if default:
            return None
        literals = tuple(p for _, patterns in context for p in patterns)
        rule = LiftedRule(actions[0], literals, tuple(outcome for _, outcome in outcomes), line.number)
        bound = actions[0].variables.union(*(p.variables for p in literals if p.positive))
        for where, patterns in context:
            self.check_bound(patterns, bound, where)
        for where, outcome in outcomes:
            self.check_bound(outcome.literals, bound, where)
        return rule

    def context(self, line: Line) -> list[Pattern]:
        return [] if line.text == EMPTY_CONTEXT else self.reader.read(line, Role.CONTEXT)

    def check_bound(self, patterns: Iterable[Pattern], bound: frozenset[int], line: Line) -> None:
        for pattern in patterns:
            if not pattern.variables <= bound:
                variable = variable_name(min(pattern.variables - bound))
                what = f"the variable {variable} of {pattern.predicate} is never bound"
                valid = "variables of the action or of a positive literal of the context"
                raise self.fail(line, f"{what}; valid: {valid}")

    def outcomes(self, lines: list[Line], default: bool) -> list[tuple[Line, LiftedOutcome]]:
        """The listed outcomes, so that their probabilities and that of noise sum to 1."""
        listed: list[tuple[Line, LiftedOutcome]] = []
        noise: float | None = None
        for line in lines:
            if noise is not None:
                raise self.fail(line, f"an outcome stands after {NOISE}; valid: {NOISE} last, then {ACTION}")
            probability, text = self.probability(line)
            if text == NOISE:
                noise = probability
            else:
                listed.append((line, LiftedOutcome(probability, self.changes(Line(line.number, text)))))
        if not listed and not default:
            raise self.fail(lines[0], f"the rule has no outcome besides noise; valid: {_OUTCOME}")
        if default and any(outcome.literals for _, outcome in listed):
            raise self.fail(lines[0], f"the default rule changes something; valid: {NO_CHANGE} and {NOISE}")
        share = self.share([outcome.probability for _, outcome in listed], noise, lines[-1])
        return [(at, LiftedOutcome(o.probability * share, o.literals)) for at, o in listed]

    def share(self, listed: list[float], noise: float | None, line: Line) -> float:
        """By what the probabilities of the listed outcomes are multiplied: 1, but for rounded ones."""
        total = math.fsum(listed)
        sum_ = total + (noise or 0.0)
        if abs(1 - sum_) > _TOLERANCE + _ROUNDING:
            hint = f" ({NOISE} has no line here)" if noise is None and total < 1 else ""
            raise self.fail(line, f"the probabilities sum to {sum_:g}{hint}; valid: 1, within {_TOLERANCE:g}")
        # Three digits need not sum to 1; what was written in full stays as it is, to the last bit.
        target = min(1.0, total) if noise is None else max(0.0, 1.0 - noise)
        return 1.0 if total == 0 or abs(target - total) < _ROUNDING else target / total

    def probability(self, line: Line) -> tuple[float, str]:
        """The number at the start of an outcome, and the rest of the line."""
        number, *rest = line.text.split(maxsplit=1)
        if _NUMBER.fullmatch(number) is None:
            raise self.fail(line, f"{quote(number)} is not a number; valid: {_OUTCOME}")
        if not 0 <= float(number) <= 1:
            raise self.fail(line, f"{quote(number)} is not a probability; valid: 0 to 1")
        return float(number), rest[0] if rest else ""

    def changes(self, line: Line) -> tuple[Pattern, ...]:
        """The literals of an outcome; none for no change."""
        if line.text == NO_CHANGE:
            return ()
        if "REWARD" in line.text:
            raise self.fail(line, f"rewards in outcomes are not read; valid: {_OUTCOME}")
        literals = tuple(self.reader.read(line, Role.OUTCOME))
        if not literals:
            raise self.fail(line, f"the outcome says nothing after its probability; valid: {_OUTCOME}")
        seen = {(p.predicate, p.args): p.positive for p in literals}
        for p in literals:
            if seen[p.predicate, p.args] != p.positive:
                what = f"the outcome makes {p.predicate} both true and false"
                raise self.fail(line, f"{what}; valid: each literal in one sign")
        return literals
