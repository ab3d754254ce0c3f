"""Lifted rules over the constants of a problem -> ground rules, as far as they can ever apply."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from cognitive_arch.errors import RuleError
from cognitive_arch.relational.libprada.model import LiftedRule, Pattern, SymbolKind
from cognitive_arch.relational.libprada.text import Source
from cognitive_arch.relational.rules import GroundOutcome, GroundRule
from cognitive_arch.relational.symbols import GroundAction, Literal, State

MAX_STEPS = 1_000_000
"""Values of variables tried before the rules are called too many."""

MAX_BINDINGS = 100_000
"""Groundings of rules with variables; planning over more takes minutes, and gigabytes."""


@dataclass(frozen=True, slots=True)
class _Search:
    """How to bind the variables of one rule: in which order, to what, and what must hold after each."""

    rule: LiftedRule
    action: frozenset[int]
    order: list[int]
    domains: dict[int, list[str]]
    checks: list[list[Pattern]]


class Grounder:
    """Grounds rules over `constants`; what no rule changes is looked up in `state` and filters bindings."""

    def __init__(
        self, rules: Sequence[LiftedRule], constants: Sequence[str], state: State, source: Source
    ) -> None:
        self.rules = rules
        self.constants = constants
        self.state = state
        self.source = source
        self._changed = {p.symbol.name for r in rules for o in r.outcomes for p in o.literals}
        self._place = {constant: index for index, constant in enumerate(constants)}
        self._steps = 0
        self._made = 0

    def ground(self) -> Iterator[GroundRule]:
        """All groundings, in the order of the file and of the constants.

        A grounding whose context contradicts itself is left out. A rule without variables stays as it is,
        even if it can never apply: there is nothing to filter, and so it reads back as it was written.
        """
        for rule in self.rules:
            for binding in self._bindings(rule):
                ground = _bind(rule, binding)
                if ground is not None:
                    yield ground

    def _static(self, pattern: Pattern) -> bool:
        """Whether the initial state settles the literal for good."""
        return pattern.symbol.kind is SymbolKind.PRIMITIVE and pattern.symbol.name not in self._changed

    def _bindings(self, rule: LiftedRule) -> Iterable[dict[int, str]]:
        """Action arguments are distinct; deictic references differ from these, not from each other."""
        positive = [term for p in rule.context if p.positive and p.variables for term in p.args]
        if not rule.action.variables and not positive:
            return [{}]
        variables = [t for t in dict.fromkeys((*rule.action.args, *positive)) if isinstance(t, int)]
        static = [p for p in rule.context if self._static(p)]
        if not all(p.literal.holds(self.state) for p in static if p.literal is not None):
            return []
        constants = [c for c in self.constants if c not in rule.action.constants]
        domains = {v: self._domain(v, static, constants) for v in variables}
        order = _order(domains, static)
        checks = [
            [p for p in static if v in p.variables and p.variables <= set(order[: i + 1])]
            for i, v in enumerate(order)
        ]
        search = _Search(rule, rule.action.variables, order, domains, checks)
        found = list(self._extend(search, {}))
        return sorted(found, key=lambda binding: [self._place[binding[v]] for v in variables])

    def _domain(self, variable: int, static: list[Pattern], constants: list[str]) -> list[str]:
        tests = [p for p in static if p.variables == {variable}]
        return [c for c in constants if all(p.ground({variable: c}).holds(self.state) for p in tests)]

    def _extend(self, search: _Search, binding: dict[int, str]) -> Iterator[dict[int, str]]:
        """`binding` with the remaining variables bound, in every way that passes the checks."""
        depth = len(binding)
        if depth == len(search.order):
            self._made += 1
            yield dict(binding)
            return
        variable = search.order[depth]
        taken = {c for v, c in binding.items() if variable in search.action or v in search.action}
        for constant in search.domains[variable]:
            if constant in taken:
                continue
            self._steps += 1
            if self._steps > MAX_STEPS or self._made > MAX_BINDINGS:
                raise self._too_many(search.rule)
            binding[variable] = constant
            if all(p.ground(binding).holds(self.state) for p in search.checks[depth]):
                yield from self._extend(search, binding)
            del binding[variable]

    def _too_many(self, rule: LiftedRule) -> RuleError:
        what = f"over {len(self.constants)} constants the rules up to here have too many groundings"
        valid = f"at most {MAX_BINDINGS}; literals that no rule changes narrow a context"
        return self.source.fail(rule.line, f"{what}; valid: {valid}")


def _order(domains: dict[int, list[str]], static: list[Pattern]) -> list[int]:
    """Variables in the order of binding: first those that settle most, then those with few choices."""
    order: list[int] = []
    waiting = list(domains)
    while waiting:
        bound = frozenset(order)
        settled = {v: sum(v in p.variables and p.variables <= bound | {v} for p in static) for v in waiting}
        best = min(waiting, key=lambda v: (-settled[v] if order else 0, len(domains[v])))
        order.append(best)
        waiting.remove(best)
    return order


def _bind(rule: LiftedRule, binding: dict[int, str]) -> GroundRule | None:
    """The ground rule; None if its context contradicts itself."""
    context = tuple(dict.fromkeys([p.ground(binding) for p in rule.context]))
    if len({literal.atom for literal in context}) < len(context):
        return None
    outcomes = tuple(GroundOutcome(o.probability, _changes(o.literals, binding)) for o in rule.outcomes)
    action = rule.action.ground(binding).atom
    return GroundRule(GroundAction(action.predicate, action.args), context, outcomes)


def _changes(patterns: Iterable[Pattern], binding: dict[int, str]) -> tuple[Literal, ...]:
    """The literals of an outcome; where two references coincide, what comes wins over what goes."""
    literals = dict.fromkeys([p.ground(binding) for p in patterns])
    return tuple([lit for lit in literals if lit.positive or lit.negated() not in literals])
