"""What an action does to a state, by the rules: the exact, ground semantics of NID rules."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import GroundAction, Literal, State


def apply_literals(state: State, literals: Iterable[Literal]) -> State:
    """`state` after the literals have been made true."""
    changes = tuple(literals)
    gone = {lit.atom for lit in changes if not lit.positive}
    come = {lit.atom for lit in changes if lit.positive}
    return frozenset((state - gone) | come)


def covering_rule(rules: Sequence[GroundRule], action: GroundAction, state: State) -> GroundRule | None:
    """The one rule of `action` whose context holds, or None if there is none or more than one.

    Without a unique covering rule the default rule applies: nothing is known to change.
    """
    covering = [r for r in rules if r.action == action and r.applies(state)]
    return covering[0] if len(covering) == 1 else None
