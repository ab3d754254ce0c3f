"""Noisy indeterministic rules, lifted and ground (thesis Sec. 6.4.5.1, Table 16).

A `NIDRule` speaks of typed variables; `RuleSet.ground` turns it into `GroundRule`s over the entities of a
scene. The noise outcome is kept apart as the probability mass that no listed outcome takes.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from cognitive_arch.errors import GroundingError, unknown
from cognitive_arch.relational.derived import Definition
from cognitive_arch.relational.symbols import (
    ALL,
    OTHERHAND,
    Atom,
    GroundAction,
    LiftedLiteral,
    Literal,
    Predicate,
)

GROUNDINGS_KEPT = 4
"""So many groundings of one rule set are kept: an environment and whoever acts in it ask for the same."""


class Entity(NamedTuple):
    """A named thing of the scene and its type in the rules (`hand`, `object`, `tool`)."""

    name: str
    type: str


class Parameter(NamedTuple):
    """A typed variable of an action."""

    name: str
    type: str


@dataclass(frozen=True, slots=True)
class LiftedOutcome:
    """One listed outcome: probability and the literals it makes true."""

    probability: float
    literals: tuple[LiftedLiteral, ...]


@dataclass(frozen=True, slots=True)
class GroundOutcome:
    """One listed outcome over named entities."""

    probability: float
    literals: tuple[Literal, ...]


@dataclass(frozen=True, slots=True)
class GroundRule:
    """A rule over named entities.

    `outcomes` are the listed ones, most likely first; what is missing to 1 is the noise outcome, about
    which nothing is known.
    """

    action: GroundAction
    context: tuple[Literal, ...]
    outcomes: tuple[GroundOutcome, ...]

    @property
    def noise(self) -> float:
        """Probability of the noise outcome."""
        return max(0.0, 1.0 - sum(o.probability for o in self.outcomes))

    def applies(self, state: frozenset[Atom]) -> bool:
        """Whether the context holds in `state`."""
        return all(literal.holds(state) for literal in self.context)

    def with_first_probability(self, probability: float) -> GroundRule:
        """The same rule with another probability of its first outcome; the rest goes to noise."""
        first = replace(self.outcomes[0], probability=probability)
        return replace(self, outcomes=(first, *self.outcomes[1:]))


class GroundRules(tuple[GroundRule, ...]):
    """Ground rules together with the definitions of the derived atoms that their contexts speak of.

    It is a tuple of rules, so that whoever has no derived atoms need not know of them.
    """

    derived: tuple[Definition, ...]

    def __new__(cls, rules: Iterable[GroundRule] = (), derived: tuple[Definition, ...] = ()) -> GroundRules:
        """`derived` in the order of `derived.in_order`."""
        made = super().__new__(cls, rules)
        made.derived = derived
        return made


def derived_of(rules: Sequence[GroundRule]) -> tuple[Definition, ...]:
    """The definitions that `rules` carry, if any."""
    return rules.derived if isinstance(rules, GroundRules) else ()


@dataclass(frozen=True, slots=True)
class NIDRule:
    """A rule over variables: action, context, listed outcomes, noise outcome."""

    action: str
    parameters: tuple[Parameter, ...]
    context: tuple[LiftedLiteral, ...]
    outcomes: tuple[LiftedOutcome, ...]
    line: int = 0

    def __str__(self) -> str:
        return f"{self.action}({', '.join(p.name for p in self.parameters)})"


@dataclass(frozen=True)
class RuleSet:
    """Types, predicates and rules of one domain.

    `types` maps a type to its parent, or to None at the root.
    """

    types: Mapping[str, str | None]
    predicates: Mapping[str, Predicate]
    rules: tuple[NIDRule, ...]
    source: str = field(default="", compare=False)
    _grounded: dict[object, tuple[GroundRule, ...]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def is_a(self, type_: str, ancestor: str) -> bool:
        """Whether `type_` is `ancestor` or below it."""
        current: str | None = type_
        while current is not None:
            if current == ancestor:
                return True
            current = self.types.get(current)
        return False

    def ground(
        self, entities: Sequence[Entity], actions: frozenset[str] | None = None
    ) -> tuple[GroundRule, ...]:
        """All groundings over `entities`, in the order of the rules and of the sorted names.

        Variables are bound to distinct entities of their type. A grounding whose context contradicts
        itself can never apply and is left out. `actions` restricts to those action names.
        Raises `GroundingError` for an entity whose type the rules do not know.
        """
        wanted = tuple(n for n, rule in enumerate(self.rules) if actions is None or rule.action in actions)
        key = (tuple(sorted(set(entities))), wanted)
        if key not in self._grounded:
            if len(self._grounded) >= GROUNDINGS_KEPT:
                self._grounded.clear()
            grounder = _Grounder(self, entities)
            self._grounded[key] = tuple(g for n in wanted for g in grounder.groundings(self.rules[n]))
        return self._grounded[key]

    def ground_call(
        self, rule: NIDRule, args: Sequence[str], entities: Sequence[Entity]
    ) -> GroundRule | None:
        """`rule` with its parameters bound to `args`; None if its context contradicts itself."""
        return _Grounder(self, entities).bind(rule, tuple(args))

    def rule_for(self, action: str) -> NIDRule:
        """The first rule of `action`; raises `GroundingError` listing the actions if there is none."""
        for rule in self.rules:
            if rule.action == action:
                return rule
        raise GroundingError(unknown("action", action, {r.action for r in self.rules}))


class _Grounder:
    """Binds the variables of one rule set to the entities of one scene.

    What a literal expands to depends on few of a rule's variables, so expansions are kept.
    """

    def __init__(self, rules: RuleSet, entities: Sequence[Entity]) -> None:
        known = sorted(set(entities))
        for entity in known:
            if entity.type not in rules.types:
                raise GroundingError(unknown(f"type of {entity.name}", entity.type, rules.types))
        self._predicates = rules.predicates
        self._of_type = {t: [e.name for e in known if rules.is_a(e.type, t)] for t in rules.types}
        self._hands = [e.name for e in known if e.type == "hand"]
        self._expansions: dict[tuple[LiftedLiteral, tuple[str, ...]], tuple[Literal, ...]] = {}

    def groundings(self, rule: NIDRule) -> Iterator[GroundRule]:
        """All ground rules of `rule`."""
        for args in itertools.product(*(self._of_type[p.type] for p in rule.parameters)):
            if len(set(args)) == len(args):
                ground = self.bind(rule, args)
                if ground is not None:
                    yield ground

    def bind(self, rule: NIDRule, args: tuple[str, ...]) -> GroundRule | None:
        """`rule` with its parameters bound to `args`; None if its context contradicts itself."""
        binding = dict(zip((p.name for p in rule.parameters), args, strict=True))
        context = self._conjunction(rule.context, binding)
        signs: dict[Atom, bool] = {}
        if any(signs.setdefault(atom, positive) != positive for atom, positive in context):
            return None
        outcomes = tuple(
            GroundOutcome(o.probability, self._conjunction(o.literals, binding)) for o in rule.outcomes
        )
        return GroundRule(GroundAction(rule.action, args), context, outcomes)

    def _conjunction(
        self, literals: Sequence[LiftedLiteral], binding: Mapping[str, str]
    ) -> tuple[Literal, ...]:
        return tuple(dict.fromkeys(ground for lit in literals for ground in self._expand(lit, binding)))

    def _expand(self, literal: LiftedLiteral, binding: Mapping[str, str]) -> tuple[Literal, ...]:
        args = tuple(binding.get(a, a) for a in literal.args)
        # OTHERHAND depends on which hand the rule has already, wherever that stands.
        bound = tuple(h for h in binding.values() if h in self._hands) if OTHERHAND in args else ()
        key = (literal, args + bound)
        if key not in self._expansions:
            choices = [
                [name for name in self._of_type[type_] if name not in args]
                if arg == ALL
                else [hand for hand in self._hands if hand not in bound]
                if arg == OTHERHAND
                else [arg]
                for arg, type_ in zip(args, self._predicates[literal.predicate].types, strict=True)
            ]
            self._expansions[key] = tuple(
                Literal(Atom(literal.predicate, chosen), literal.positive)
                for chosen in itertools.product(*choices)
            )
        return self._expansions[key]
