from __future__ import annotations

import itertools
import math

import pytest

from cognitive_arch.errors import GroundingError
from cognitive_arch.relational.rules import Entity, GroundRule, RuleSet
from cognitive_arch.relational.symbols import State
from cognitive_arch.relational.transition import apply_literals, covering_rule
from tests.conftest import action, literals, state


def by_name(rules: tuple[GroundRule, ...], text: str) -> GroundRule:
    return next(r for r in rules if r.action == action(text))


def test_grounding_is_typed(ground: tuple[GroundRule, ...]) -> None:
    # 3 objects, 2 hands, no tool: 6 grasps, 6 drops, 12 puts and neither pull nor push.
    counts = {
        name: sum(r.action.name == name for r in ground) for name in ("graspWith", "dropWith", "putOnWith")
    }
    assert counts == {"graspWith": 6, "dropWith": 6, "putOnWith": 12}
    assert len(ground) == 24


def test_all_and_otherhand(ground: tuple[GroundRule, ...]) -> None:
    rule = by_name(ground, "graspWith(Ham,LeftHand)")
    assert set(rule.context) == set(
        literals(
            "not isHand(Ham)", "isClear(LeftHand)", "isHand(LeftHand)", "reachableWith(Ham,LeftHand)",
            "not on(Bun-bottom,Ham)", "not on(Bun-top,Ham)", "not inHand(Ham,RightHand)",
        )
    )  # fmt: skip


def test_all_in_an_effect_means_every_entity(rules: RuleSet) -> None:
    names = [
        Entity("LeftHand", "hand"),
        Entity("RightHand", "hand"),
        Entity("Tomato", "object"),
        Entity("Bread", "object"),
        Entity("Rake", "tool"),
    ]
    rule = by_name(rules.ground(names), "pull(Tomato,Rake,LeftHand)")
    assert {str(lit) for lit in rule.outcomes[0].literals} == {
        f"reachableWith(Tomato,{e})" for e in ("LeftHand", "RightHand", "Bread", "Rake")
    }


def test_order_and_names_do_not_matter(rules: RuleSet, entities: tuple[Entity, ...]) -> None:
    expected = rules.ground(entities)
    for shuffled in itertools.islice(itertools.permutations(entities), 10):
        assert rules.ground(shuffled) == expected
    assert rules.ground(entities * 2) == expected


def test_unknown_type(rules: RuleSet) -> None:
    with pytest.raises(GroundingError, match="valid: entity, hand, object, tool"):
        rules.ground([Entity("Ham", "food")])


def test_noise_is_what_is_left(ground: tuple[GroundRule, ...]) -> None:
    for rule in ground:
        assert math.isclose(sum(o.probability for o in rule.outcomes) + rule.noise, 1.0)
    assert by_name(ground, "putOnWith(Ham,Bun-bottom,LeftHand)").noise == pytest.approx(0.15)


def test_transition(ground: tuple[GroundRule, ...], start: State) -> None:
    grasp = action("graspWith(Ham,LeftHand)")
    rule = covering_rule(ground, grasp, start)
    assert rule is not None
    after = apply_literals(start, rule.outcomes[0].literals)
    assert after - start == state("inHand(Ham,LeftHand)")
    assert start - after == state("isClear(LeftHand)")
    assert covering_rule(ground, grasp, after) is None
