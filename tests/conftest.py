"""Shared fixtures: the sandwich domain, small states, and the command line as a program sees it."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import pytest

from cognitive_arch import cli
from cognitive_arch.domain import Domain, load_domain
from cognitive_arch.relational.parser import load_rules
from cognitive_arch.relational.rules import Entity, GroundRule, RuleSet
from cognitive_arch.relational.symbols import Goal, GroundAction, State, parse_literal


def patience(seconds: float) -> float:
    """How long to wait for what takes `seconds` on an idle machine: as many times longer as it is busier."""
    return seconds * max(1.0, 2 * os.getloadavg()[0] / (os.cpu_count() or 1))


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


class Answer:
    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err

    @property
    def json(self) -> dict[str, Any]:
        return json.loads(self.out)  # type: ignore[no-any-return]


@pytest.fixture
def cogarch(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Any:
    monkeypatch.setenv("COGARCH_STORE", str(tmp_path / "runs"))

    def call(*args: str) -> Answer:
        monkeypatch.setattr(sys, "argv", ["cogarch", *args])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        captured = capsys.readouterr()
        return Answer(int(ended.value.code or 0), captured.out, captured.err)

    return call
