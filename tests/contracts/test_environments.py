"""One suite for every environment: the law of the protocol, and what any world must answer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from cognitive_arch.domain import Domain, load_domain, load_scene
from cognitive_arch.errors import BackendError
from cognitive_arch.execution.backends import BACKENDS, make_environment
from cognitive_arch.execution.environment import Environment, FailureReason, Outcome
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.relational.parser import load_rules
from cognitive_arch.world.anchoring import WorldModel
from tests.conftest import action

DRAKE = pytest.param("drake", marks=pytest.mark.physics)


def build(backend: str, **options: Any) -> Environment:
    domain: Domain = load_domain("sandwich")
    options.setdefault("noise", NoiseLevels())
    return make_environment(backend, domain, load_scene("simple"), load_rules(domain.rules_path), **options)


@pytest.fixture(params=["symbolic", DRAKE])
def environment(request: pytest.FixtureRequest) -> Iterator[Environment]:
    env = build(request.param)
    env.reset(0)
    yield env
    env.close()


def atoms(environment: Environment) -> set[str]:
    return {str(a) for a in WorldModel().update(environment.observe()).atoms()}


def test_all_backends_are_covered() -> None:
    assert set(BACKENDS) == {"symbolic", "drake"}
    with pytest.raises(BackendError, match="valid: drake, symbolic"):
        build("gazebo")


def test_it_is_an_environment(environment: Environment) -> None:
    assert isinstance(environment, Environment)
    assert {"graspWith", "putOnWith", "dropWith"} <= environment.skills


def test_the_scene_is_what_the_file_says(environment: Environment) -> None:
    seen = environment.observe()
    assert [o.name for o in seen.objects] == ["Bun-bottom", "Bun-top", "Ham"]
    for obj in seen.objects:
        assert obj.position[:2] == pytest.approx(load_scene("simple").objects[obj.name].position, abs=0.004)
        assert {"LeftHand", "RightHand"} <= set(obj.reachable_with)
    assert [(h.name, h.holding) for h in seen.hands] == [("LeftHand", None), ("RightHand", None)]


def test_looking_changes_nothing(environment: Environment) -> None:
    assert environment.observe() == environment.observe()


def test_grasp_put_and_what_is_then_true(environment: Environment) -> None:
    assert environment.execute(action("graspWith(Ham,RightHand)")).outcome is Outcome.SUCCESS
    assert "inHand(Ham,RightHand)" in atoms(environment)
    assert "isClear(RightHand)" not in atoms(environment)
    assert environment.execute(action("putOnWith(Ham,Bun-bottom,RightHand)")).outcome is Outcome.SUCCESS
    environment.settle(1.0)
    now = atoms(environment)
    assert {"on(Ham,Bun-bottom)", "isClear(RightHand)"} <= now
    assert "inHand(Ham,RightHand)" not in now


def test_drop_puts_it_back_within_reach(environment: Environment) -> None:
    environment.execute(action("graspWith(Ham,LeftHand)"))
    assert environment.execute(action("dropWith(Ham,LeftHand)")).outcome is Outcome.SUCCESS
    now = atoms(environment)
    assert {"isClear(LeftHand)", "reachableWith(Ham,LeftHand)"} <= now
    assert not any(a.startswith("on(") for a in now)


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        ("putOnWith(Ham,Bun-bottom,LeftHand)", FailureReason.HAND_EMPTY),
        ("dropWith(Ham,LeftHand)", FailureReason.HAND_EMPTY),
        ("graspWith(Unicorn,LeftHand)", FailureReason.UNKNOWN_OBJECT),
        ("putOnWith(Ham,Unicorn,LeftHand)", FailureReason.UNKNOWN_OBJECT),
        ("dance(Ham,LeftHand)", FailureReason.UNKNOWN_SKILL),
    ],
)
def test_impossible_actions_fail_with_a_reason(
    environment: Environment, call: str, reason: FailureReason
) -> None:
    before = atoms(environment)
    result = environment.execute(action(call))
    assert (result.outcome, result.reason) == (Outcome.FAILURE, reason)
    assert atoms(environment) == before


def test_a_full_hand_cannot_grasp(environment: Environment) -> None:
    environment.execute(action("graspWith(Ham,LeftHand)"))
    result = environment.execute(action("graspWith(Bun-top,LeftHand)"))
    assert (result.outcome, result.reason) == (Outcome.FAILURE, FailureReason.HAND_BUSY)


@pytest.mark.parametrize("backend", ["symbolic", DRAKE])
def test_same_seed_same_world(backend: str) -> None:
    def history(seed: int) -> list[object]:
        env = build(backend, jitter=0.02, noise=NoiseLevels(left=0.5))
        seen: list[object] = [env.reset(seed)]
        seen += [env.execute(action("graspWith(Ham,LeftHand)")), env.observe()]
        env.close()
        return seen

    assert history(3) == history(3)
    assert history(3)[0] != history(4)[0]


def test_reset_forgets_the_last_episode(environment: Environment) -> None:
    first = environment.reset(1)
    environment.execute(action("graspWith(Ham,LeftHand)"))
    assert environment.reset(1) == first
