"""Reading rules files (`*.nid`): Lark grammar -> checked `RuleSet`; every error names file and line."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedInput, UnexpectedToken

from cognitive_arch.errors import RuleError, one_line, unknown
from cognitive_arch.relational.rules import LiftedOutcome, NIDRule, Parameter, RuleSet
from cognitive_arch.relational.symbols import ALL, OTHERHAND, LiftedLiteral, Predicate
from cognitive_arch.resources import grammar_text, read_text

_PLAIN = {"_NL": "end of line", "LPAR": "(", "RPAR": ")", "COMMA": ",", "_SEP": ",", "COLON": ":"}


@cache
def _parser() -> Lark:
    return Lark(grammar_text("nid"), parser="lalr", propagate_positions=True, maybe_placeholders=True)


def load_rules(path: Path) -> RuleSet:
    """Read a rules file; raises `RuleError` if it is missing, too large or malformed."""
    text = read_text(path, "rules file", RuleError)
    return parse_rules(text, str(path))


def parse_rules(text: str, source: str = "<rules>") -> RuleSet:
    """Parse and check rules; raises `RuleError` with `source` and line number."""
    try:
        tree = _parser().parse(text + "\n")
    except UnexpectedInput as error:
        raise RuleError(_syntax_message(error, text, source)) from None
    return _Builder(source).build(tree)


def _syntax_message(error: UnexpectedInput, text: str, source: str) -> str:
    lines = text.splitlines()
    line = min(max(error.line, 1), max(len(lines), 1)) if error.line else len(lines)
    here = one_line(lines[line - 1]) if lines else ""
    expected = ""
    if isinstance(error, UnexpectedToken):
        names = sorted({_PLAIN.get(n, n.lower().strip("_")) for n in error.accepts or error.expected})
        expected = f"; expected {' or '.join(names)}"
    return f"{source}, line {line}: cannot read '{here}'{expected}"


class _Builder:
    """Parse tree -> `RuleSet`; statements are checked in the order they stand in the file."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.types: dict[str, str | None] = {}
        self.predicates: dict[str, Predicate] = {}
        self.rules: list[NIDRule] = []

    def fail(self, line: int, problem: str) -> RuleError:
        return RuleError(f"{self.source}, line {line}: {problem}")

    def build(self, tree: Tree[Any]) -> RuleSet:
        readers = {
            "type": self.type,
            "predicate": self.predicate,
            "rule": self.rule,
            "unconditional": self.rule,
        }
        for statement in tree.children:
            readers[statement.data](statement)
        if not self.rules:
            raise RuleError(f"{self.source}: there is no rule in this file")
        return RuleSet(self.types, self.predicates, tuple(self.rules), self.source)

    def type(self, node: Tree[Any]) -> None:
        name, parent = node.children
        if name in self.types:
            raise self.fail(node.meta.line, f"type {name} is declared twice")
        if parent is not None and parent not in self.types:
            raise self.fail(node.meta.line, unknown("type", parent, self.types))
        self.types[str(name)] = None if parent is None else str(parent)

    def predicate(self, node: Tree[Any]) -> None:
        name, types = node.children
        if name in self.predicates:
            raise self.fail(node.meta.line, f"predicate {name} is declared twice")
        names = tuple(str(t) for t in types.children) if types else ()
        for type_ in names:
            self.known_type(type_, node.meta.line)
        self.predicates[str(name)] = Predicate(str(name), names)

    def known_type(self, type_: str, line: int) -> None:
        if type_ not in self.types:
            raise self.fail(line, unknown("type", type_, self.types))

    def rule(self, node: Tree[Any]) -> None:
        """Check one rule and add it."""
        name, parameters, *outcomes = node.children
        context = outcomes.pop(0) if node.data == "rule" else None
        params = tuple(Parameter(*map(str, p.children)) for p in parameters.children) if parameters else ()
        for param in params:
            self.known_type(param.type, node.meta.line)
        names = [p.name for p in params]
        if len(set(names)) < len(names):
            raise self.fail(node.meta.line, f"{name} has two parameters of one name")
        listed, total = [], 0.0
        for index, outcome in enumerate(outcomes):
            probability, total = self.probability(outcome, total)
            body = outcome.children[1]
            if body.data == "noise":
                if index != len(outcomes) - 1:
                    raise self.fail(outcome.meta.line, "noise is the last outcome of a rule")
            else:
                listed.append(LiftedOutcome(probability, self.literals(body, params)))
        if abs(total - 1) > 1e-6:
            raise self.fail(node.meta.line, f"the probabilities of {name} sum to {total:g}, not to 1")
        if not listed:
            raise self.fail(node.meta.line, f"{name} has no outcome besides noise")
        lifted = self.literals(context, params) if context else ()
        self.rules.append(NIDRule(str(name), params, lifted, tuple(listed), node.meta.line))

    def probability(self, outcome: Tree[Any], total: float) -> tuple[float, float]:
        value = float(str(outcome.children[0]))
        if not 0 <= value <= 1:
            raise self.fail(outcome.meta.line, f"{outcome.children[0]} is not a probability (0 to 1)")
        return value, total + value

    def literals(self, node: Tree[Any], params: tuple[Parameter, ...]) -> tuple[LiftedLiteral, ...]:
        return tuple(self.literal(child, params) for child in node.children)

    def literal(self, node: Tree[Any], params: tuple[Parameter, ...]) -> LiftedLiteral:
        sign, predicate, arguments = node.children
        name = str(predicate)
        line = node.meta.line
        if name not in self.predicates:
            raise self.fail(line, unknown("predicate", name, self.predicates))
        args = tuple(str(a) for a in arguments.children) if arguments else ()
        types = self.predicates[name].types
        if len(args) != len(types):
            raise self.fail(line, f"{name} takes {len(types)} arguments, here it has {len(args)}")
        for arg, type_ in zip(args, types, strict=True):
            self.argument(arg, type_, params, line)
        return LiftedLiteral(str(name), args, not isinstance(sign, Token))

    def argument(self, arg: str, type_: str, params: tuple[Parameter, ...], line: int) -> None:
        if arg in (ALL, OTHERHAND):
            return
        bound = {p.name: p.type for p in params}
        if arg not in bound:
            if arg[0].islower():
                raise self.fail(line, unknown("variable (never bound by the action)", arg, bound))
            return  # an upper-case name is an entity
        # An argument may be wider than the predicate asks (isHand of any entity), but not foreign to it.
        related = self._is_a(bound[arg], type_) or self._is_a(type_, bound[arg])
        if not related:
            raise self.fail(line, f"{arg} is of type {bound[arg]}, the predicate asks for {type_}")

    def _is_a(self, type_: str, ancestor: str) -> bool:
        return RuleSet(self.types, {}, ()).is_a(type_, ancestor)
