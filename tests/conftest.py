"""Shared fixtures: the sandwich domain and small states."""

from __future__ import annotations

import pytest

from cognitive_arch.domain import Domain, load_domain
from cognitive_arch.relational.parser import load_rules
from cognitive_arch.relational.rules import Entity, GroundRule, RuleSet
from cognitive_arch.relational.symbols import Goal, GroundAction, State, parse_literal

HANDS = ("LeftHand", "RightHand")
PARTS = ("Bun-bottom", "Bun-top", "Ham")


def literals(*texts: str) -> Goal:
    return tuple(parse_literal(text) for text in texts)


def state(*texts: str) -> State:
    return frozenset(literal.atom for literal in literals(*texts))


def action(text: str) -> GroundAction:
    atom = parse_literal(text).atom
    return GroundAction(atom.predicate, atom.args)


@pytest.fixture(scope="session")
def domain() -> Domain:
    return load_domain("sandwich")


@pytest.fixture(scope="session")
def rules(domain: Domain) -> RuleSet:
    return load_rules(domain.rules_path)


@pytest.fixture(scope="session")
def entities() -> tuple[Entity, ...]:
    return (*(Entity(h, "hand") for h in HANDS), *(Entity(p, "object") for p in PARTS))


@pytest.fixture(scope="session")
def ground(rules: RuleSet, entities: tuple[Entity, ...]) -> tuple[GroundRule, ...]:
    return rules.ground(entities)


@pytest.fixture(scope="session")
def start() -> State:
    """The simple scene: everything on the table and within reach."""
    reach = [f"reachableWith({p},{e})" for p in PARTS for e in (*HANDS, *PARTS) if e != p]
    return state(*(f"isHand({h})" for h in HANDS), *(f"isClear({h})" for h in HANDS), *reach)
