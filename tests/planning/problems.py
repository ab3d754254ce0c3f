"""Small problems for planners that look at single worlds."""

from __future__ import annotations

from collections.abc import Sequence

from cognitive_arch.relational.rules import GroundOutcome, GroundRule
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State
from tests.conftest import HANDS, PARTS, literals

NEW_NAMES = dict(zip((*HANDS, *PARTS), ("Zoe", "Adam", "Yak", "Bee", "Xerxes"), strict=True))


def rule(name: str, context: tuple[str, ...], *outcomes: tuple[float, tuple[str, ...]]) -> GroundRule:
    """A rule of the action `name` without arguments; an outcome is a probability and literals."""
    listed = tuple(GroundOutcome(p, literals(*effects)) for p, effects in outcomes)
    return GroundRule(GroundAction(name, ()), literals(*context), listed)


def renamed_action(action: GroundAction) -> GroundAction:
    """`action` on the entities by their new names."""
    return GroundAction(action.name, tuple(NEW_NAMES[a] for a in action.args))


def renamed(
    start: State, goal: Goal, rules: Sequence[GroundRule]
) -> tuple[State, Goal, tuple[GroundRule, ...]]:
    """The same problem, its rules in the same order, in which every entity has another name."""

    def atom(old: Atom) -> Atom:
        return Atom(old.predicate, tuple(NEW_NAMES[a] for a in old.args))

    def conjunction(old: Sequence[Literal]) -> tuple[Literal, ...]:
        return tuple(Literal(atom(lit.atom), lit.positive) for lit in old)

    new_rules = tuple(
        GroundRule(
            renamed_action(r.action),
            conjunction(r.context),
            tuple(GroundOutcome(o.probability, conjunction(o.literals)) for o in r.outcomes),
        )
        for r in rules
    )
    return frozenset(map(atom, start)), conjunction(goal), new_rules
