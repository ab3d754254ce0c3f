"""Tables with any number of objects, under the sandwich domain's five rules: problems that grow.

They have the shape of libPRADA's published samples: two hands, tools to push and pull with, and everything
within reach. Six objects give the same 124 ground rules.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

from cognitive_arch.domain import load_domain
from cognitive_arch.relational.parser import load_rules
from cognitive_arch.relational.rules import Entity, GroundRule, RuleSet
from cognitive_arch.relational.symbols import Atom, Goal, State, parse_literal

HANDS = ("LeftHand", "RightHand")
MIN_OBJECTS, MAX_OBJECTS = 3, 100
"""The goals name three objects, and a name has two digits."""

GOALS: Mapping[str, Goal] = {
    "one": tuple(map(parse_literal, ("on(o02,o00)", "not inHand(o02,LeftHand)", "isClear(LeftHand)"))),
    "stack": tuple(map(parse_literal, ("on(o02,o00)", "on(o01,o02)"))),
}
"""One object on another and the left hand empty; a third one on top of these."""


class Tabletop(NamedTuple):
    """What is true at first, what can be done, and the objects' names, tools last."""

    state: State
    rules: tuple[GroundRule, ...]
    names: tuple[str, ...]


def tabletop(n_objects: int, n_tools: int = 2) -> Tabletop:
    """`n_objects` on the table, of which the last `n_tools` are tools; hands are clear, all is within reach.

    Raises `ValueError` unless there are 3 to 100 objects, and no more tools than these.
    """
    if not MIN_OBJECTS <= n_objects <= MAX_OBJECTS:
        raise ValueError(f"{n_objects} objects; valid: {MIN_OBJECTS} to {MAX_OBJECTS}")
    if not 0 <= n_tools <= n_objects:
        raise ValueError(f"{n_tools} tools among {n_objects} objects; valid: 0 to {n_objects}")
    names = tuple(f"o{i:02d}" for i in range(n_objects))
    tools = names[n_objects - n_tools :]
    entities = [Entity(hand, "hand") for hand in HANDS]
    entities += [Entity(name, "tool" if name in tools else "object") for name in names]
    state = {Atom(predicate, (hand,)) for predicate in ("isHand", "isClear") for hand in HANDS}
    state |= {Atom("reachableWith", (x, by)) for x in names for by in (*HANDS, *names) if x != by}
    state |= {Atom("pullableWith", (x, tool)) for x in names for tool in tools if x != tool}
    return Tabletop(frozenset(state), _rules().ground(entities), names)


@cache
def _rules() -> RuleSet:
    return load_rules(load_domain("sandwich").rules_path)
