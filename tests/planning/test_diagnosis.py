"""Why there is no plan."""

from __future__ import annotations

import json

from cognitive_arch.planning.diagnosis import LiteralStatus, Verdict, diagnose
from cognitive_arch.relational.derived import AnyOf, Closure
from cognitive_arch.relational.rules import GroundOutcome, GroundRule, GroundRules
from cognitive_arch.relational.symbols import Atom, GroundAction, Literal, State
from tests.conftest import literals, state

STACK = literals("on(Ham,Bun-bottom)", "on(Bun-top,Ham)")


def out_of_reach(start: State, name: str) -> State:
    return frozenset(a for a in start if a.predicate != "reachableWith" or a.args[0] != name)


def test_too_far(ground: tuple[GroundRule, ...], start: State) -> None:
    found = diagnose(start, STACK, ground, 3)
    assert (found.verdict, found.steps) == (Verdict.TOO_FAR, 4)
    assert all(lit.status is LiteralStatus.REACHABLE for lit in found.literals)
    assert "about 4 actions, more than the horizon" in str(found)


def test_nothing_forbids_it(ground: tuple[GroundRule, ...], start: State) -> None:
    found = diagnose(start, STACK, ground, 5)
    assert found.verdict is Verdict.UNLIKELY
    assert found.literals[0].action == GroundAction("putOnWith", ("Ham", "Bun-bottom", "LeftHand"))
    assert found.literals[0].unmet == literals("inHand(Ham,LeftHand)")


def test_what_cannot_be_reached_and_what_is_behind_it(ground: tuple[GroundRule, ...], start: State) -> None:
    found = diagnose(out_of_reach(start, "Ham"), STACK, ground, 5)
    assert found.verdict is Verdict.UNREACHABLE
    first = found.literals[0]
    assert first.status is LiteralStatus.BLOCKED
    assert first.unmet == literals("inHand(Ham,LeftHand)")
    assert first.roots == literals("reachableWith(Ham,LeftHand)")
    assert "that fails for want of reachableWith(Ham,LeftHand)" in str(found)


def test_no_rule_at_all(ground: tuple[GroundRule, ...], start: State) -> None:
    found = diagnose(start, literals("on(Ham,Unicorn)", "isClear(LeftHand)"), ground, 5)
    assert found.verdict is Verdict.UNREACHABLE
    assert [lit.status for lit in found.literals] == [LiteralStatus.NO_RULE]
    assert "on(Ham,Unicorn) (no rule makes it true with what is here)" in str(found)


def test_a_goal_that_holds(ground: tuple[GroundRule, ...], start: State) -> None:
    found = diagnose(start, literals("isClear(LeftHand)"), ground, 5)
    assert (found.verdict, found.literals, str(found)) == (Verdict.HOLDS, (), "the goal holds already")


def test_derived_goals() -> None:
    """above(A,C) needs on(A,B) and on(B,C); the second nobody can make true."""
    on = [Atom("on", pair) for pair in (("A", "B"), ("B", "C"))]
    put = GroundRule(GroundAction("put", ("A", "B")), (), (GroundOutcome(0.9, (Literal(on[0]),)),))
    done = AnyOf(Atom("done", ()), ((Literal(Atom("above", ("A", "C"))),),))
    rules = GroundRules([put], (Closure("above", "on", ("A", "B", "C")), done))
    found = diagnose(state(), (Literal(Atom("done", ())),), rules, 3)
    assert found.verdict is Verdict.UNREACHABLE
    assert found.literals[0].action is None
    assert found.literals[0].status is LiteralStatus.BLOCKED
    reachable = diagnose(frozenset({on[1]}), (Literal(Atom("done", ())),), rules, 3)
    assert (reachable.verdict, reachable.steps) == (Verdict.UNLIKELY, 1)


def test_it_can_be_written_down(ground: tuple[GroundRule, ...], start: State) -> None:
    data = json.loads(json.dumps(diagnose(out_of_reach(start, "Ham"), STACK, ground, 5).to_json()))
    assert data["verdict"] == "unreachable"
    assert data["literals"][0]["roots"] == ["reachableWith(Ham,LeftHand)"]
