"""Reach by the published constants, and by the arms."""

from __future__ import annotations

from typing import Any

import pytest

from cognitive_arch.domain import Domain, ReachLimits
from cognitive_arch.errors import ConfigError
from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.environment import Environment
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.relational.rules import RuleSet
from cognitive_arch.scenes import load_scene
from cognitive_arch.session import RunConfig


@pytest.mark.parametrize(
    ("place", "hands"),
    [
        ((-0.49, 0.0), ("LeftHand", "RightHand")),
        ((-0.491, 0.0), ()),
        ((-0.30, -0.15), ("LeftHand", "RightHand")),
        ((-0.30, -0.16), ("LeftHand",)),
        ((-0.30, 0.16), ("RightHand",)),
    ],
)
def test_the_published_constants(place: tuple[float, float], hands: tuple[str, ...]) -> None:
    assert ReachLimits().hands(*place) == hands
    assert ReachLimits().with_tool(-0.78)
    assert not ReachLimits().with_tool(-0.80)


def build(backend: str, reach: str | None, domain: Domain, rules: RuleSet) -> Environment:
    scene = load_scene("complex")
    return make_environment(backend, domain, scene, rules, noise=NoiseLevels(), reach=reach)


def told(environment: Environment) -> dict[str, tuple[set[str], set[str]]]:
    seen = environment.reset(0).objects
    environment.close()
    return {obj.name: (set(obj.reachable_with), set(obj.pullable_with)) for obj in seen}


def test_both_worlds_agree_on_the_constants(domain: Domain, rules: RuleSet) -> None:
    symbolic = told(build("symbolic", None, domain, rules))
    assert symbolic == told(build("symbolic", "published", domain, rules))
    assert symbolic == told(build("drake", "published", domain, rules))
    assert symbolic["Ham"] == ({"Rake", "Stick"}, {"Rake"})
    # The right hand may not go beyond y = -0.15 by the constants; its arm is longer than that.
    assert symbolic["Stick"][0] == {"LeftHand", "Rake"}


def test_in_physics_what_pulls_is_told_by_its_shape(domain: Domain, rules: RuleSet) -> None:
    swapped = domain.model_copy(
        update={
            "objects": {
                name: spec.model_copy(update={"can_pull": name == "Stick"})
                for name, spec in domain.objects.items()
            }
        }
    )
    assert told(build("drake", None, swapped, rules))["Ham"][1] == {"Rake"}
    assert told(build("symbolic", None, swapped, rules))["Ham"][1] == {"Stick"}


def test_what_is_wider_than_half_the_bar_cannot_be_pulled(domain: Domain, rules: RuleSet) -> None:
    rake = domain.objects["Rake"]
    short = rake.model_copy(update={"shape": rake.shape.model_copy(update={"bar": 0.05})})
    changed = domain.model_copy(update={"objects": {**domain.objects, "Rake": short}})
    assert told(build("drake", None, changed, rules))["Ham"][1] == set()


def test_the_manifest_says_how_reach_was_told(cogarch: Any) -> None:
    assert RunConfig().to_json()["reach"] == "kinematic"
    assert RunConfig(reach="published").to_json()["reach"] == "published"
    answer = cogarch("run", "pick up the ham", "--backend", "symbolic", "--json")
    assert answer.json["reach"] == "published"
    assert cogarch("inspect", "latest", "--json").json["manifest"]["reach"] == "published"


@pytest.mark.parametrize(
    ("backend", "reach", "valid"),
    [("symbolic", "kinematic", "valid: published"), ("drake", "far", "valid: kinematic, published")],
)
def test_reach_that_is_not_there(backend: str, reach: str, valid: str, cogarch: Any) -> None:
    with pytest.raises(ConfigError, match=valid):
        RunConfig(backend=backend, reach=reach)
    answer = cogarch("run", "pick up the ham", "--backend", backend, "--reach", reach)
    assert (answer.code, answer.out) == (2, "")
    assert valid in answer.err
    assert answer.err.count("\n") == 1
