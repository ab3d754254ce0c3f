from __future__ import annotations

import pytest

from cognitive_arch.errors import ConfigError
from cognitive_arch.execution.heuristics import Adaptation, Heuristics, action_worked, undone
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import State
from tests.conftest import action, literals, state


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("all", (True, True, True)),
        ("none", (False, False, False)),
        ("adaptability", (True, False, False)),
        ("adaptability+creativity", (True, True, False)),
        (" Creativity , goal-maintenance", (False, True, True)),
    ],
)
def test_parse_heuristics(text: str, expected: tuple[bool, bool, bool]) -> None:
    parsed = Heuristics.parse(text)
    assert (parsed.adaptability, parsed.creativity, parsed.goal_maintenance) == expected
    assert Heuristics.parse(str(parsed)) == parsed


@pytest.mark.parametrize("text", ["", "hope", "adaptability,,creativity"])
def test_bad_heuristics(text: str) -> None:
    with pytest.raises(ConfigError, match="valid: adaptability, all, creativity, goal_maintenance, none"):
        Heuristics.parse(text)


@pytest.mark.parametrize("text", ["all,none", "none+adaptability", "creativity,all"])
def test_all_and_none_stand_alone(text: str) -> None:
    with pytest.raises(ConfigError, match=r"stands alone; valid together: adaptability, creativity"):
        Heuristics.parse(text)


def test_parse_noise() -> None:
    assert NoiseLevels.parse("0.25") == NoiseLevels(0.25, 0.25, 0.25, 0.25)
    assert NoiseLevels.parse("left=0.5, pull=1") == NoiseLevels(left=0.5, pull=1.0)
    assert NoiseLevels.parse(str(NoiseLevels(0.1, 0.2, 0.3, 0.4))) == NoiseLevels(0.1, 0.2, 0.3, 0.4)


@pytest.mark.parametrize(
    "text", ["", "x", "-0.1", "1.1", "nan", "inf", "left", "left=", "foot=0.1", "left=2", "left=0,left=1"]
)
def test_bad_noise(text: str) -> None:
    with pytest.raises(ConfigError, match="noise"):
        NoiseLevels.parse(text)


def test_noise_belongs_to_a_capability(domain: object) -> None:
    levels = NoiseLevels(left=0.1, right=0.2, pull=0.3, push=0.4)
    capabilities = domain.capabilities  # type: ignore[attr-defined]
    assert levels.of(action("graspWith(Ham,LeftHand)"), capabilities) == 0.1
    assert levels.of(action("putOnWith(Ham,Bun,RightHand)"), capabilities) == 0.2
    assert levels.of(action("pull(Ham,Rake,LeftHand)"), capabilities) == 0.3
    assert levels.of(action("push(Ham,Rake,RightHand)"), capabilities) == 0.4


def test_adaptability_divides_by_five(ground: tuple[GroundRule, ...]) -> None:
    adaptation = Adaptation(decay=0.2)
    grasp = action("graspWith(Ham,LeftHand)")

    def probability() -> float:
        return next(r for r in adaptation.apply(ground) if r.action == grasp).outcomes[0].probability

    seen = [probability()]
    for _ in range(3):
        event = adaptation.record(grasp, ground)
        seen.append(probability())
    assert seen == pytest.approx([0.95, 0.19, 0.038, 0.0076])
    assert "failed 3 times" in event.why
    assert "from 0.038 to 0.0076" in event.why
    others = [r for r in adaptation.apply(ground) if r.action != grasp]
    assert others == [r for r in ground if r.action != grasp]
    adaptation.reset()
    assert adaptation.apply(ground) == ground


def test_lost_probability_goes_to_noise(ground: tuple[GroundRule, ...]) -> None:
    put = action("putOnWith(Ham,Bun-bottom,LeftHand)")
    adaptation = Adaptation(decay=0.2)
    adaptation.record(put, ground)
    rule = next(r for r in adaptation.apply(ground) if r.action == put)
    assert [o.probability for o in rule.outcomes] == pytest.approx([0.14, 0.15])
    assert rule.noise == pytest.approx(0.71)


def test_undone_looks_at_common_literals_only() -> None:
    previous = literals("on(Ham,Bun)", "isClear(LeftHand)")
    current = literals("on(Ham,Bun)", "not isClear(LeftHand)", "inHand(Top,LeftHand)")
    assert undone(previous, current, state()) == literals("on(Ham,Bun)")
    assert undone(previous, current, state("on(Ham,Bun)")) == ()


def test_action_worked(ground: tuple[GroundRule, ...], start: State) -> None:
    grasp = action("graspWith(Ham,LeftHand)")
    rule = next(r for r in ground if r.action == grasp)
    held = (start - state("isClear(LeftHand)")) | state("inHand(Ham,LeftHand)")
    assert action_worked(rule, start, held)
    assert not action_worked(rule, start, start)
    assert not action_worked(rule, start, start - state("isClear(LeftHand)"))
    # Already true and still true: nothing changed, so it did not work.
    assert not action_worked(rule, held, held)
