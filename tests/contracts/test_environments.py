"""One suite for every environment: the law of the protocol, and what any world must answer."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import pytest

from cognitive_arch.domain import Domain, load_domain
from cognitive_arch.errors import BackendError, StateError
from cognitive_arch.execution.backends import BACKENDS, make_environment
from cognitive_arch.execution.environment import Environment, FailureReason, Outcome
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.relational.parser import load_rules
from cognitive_arch.scenes import load_scene
from cognitive_arch.world.anchoring import WorldModel
from tests.conftest import action

DRAKE = pytest.param("drake", marks=pytest.mark.physics)


def build(backend: str, *events: str, **options: Any) -> Environment:
    domain: Domain = load_domain("sandwich")
    scene = load_scene("simple").with_events(tuple(map(OutsideEvent.parse, events)), domain)
    options.setdefault("noise", NoiseLevels())
    return make_environment(backend, domain, scene, load_rules(domain.rules_path), **options)


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


# -- outside events ---------------------------------------------------------------------------------


@pytest.fixture(params=["symbolic", DRAKE])
def stage(request: pytest.FixtureRequest) -> Iterator[Environment]:
    """A world in which cheese may appear."""
    env = build(request.param, "1:add:Cheese:-0.30,0.20")
    env.reset(0)
    yield env
    env.close()


def happen(environment: Environment, event: str) -> tuple[str, ...]:
    return environment.disturb(OutsideEvent.parse(f"1:{event}"))


def seen(environment: Environment) -> dict[str, tuple[float, ...]]:
    return {obj.name: obj.position for obj in environment.observe().objects}


def work(environment: Environment, *calls: str) -> None:
    for call in calls:
        assert environment.execute(action(call)).outcome is Outcome.SUCCESS, call


def test_what_is_added_can_be_used_and_what_is_removed_is_gone(stage: Environment) -> None:
    assert "Cheese" not in seen(stage)
    assert happen(stage, "add:Cheese:-0.30,0.20") == ("Cheese",)
    assert seen(stage)["Cheese"][:2] == pytest.approx((-0.30, 0.20), abs=0.005)
    assert "reachableWith(Cheese,RightHand)" in atoms(stage)
    work(stage, "graspWith(Cheese,RightHand)", "putOnWith(Cheese,Bun-bottom,RightHand)")
    world = WorldModel()
    world.update(stage.observe())
    assert happen(stage, "remove:Cheese") == ("Cheese",)
    assert world.update(stage.observe()).object("Cheese") is None
    assert stage.execute(action("graspWith(Cheese,RightHand)")).reason is FailureReason.UNKNOWN_OBJECT
    assert happen(stage, "remove:Cheese") == ()
    work(stage, "graspWith(Ham,LeftHand)")
    assert "Cheese" not in {obj.name for obj in stage.reset(0).objects}


def test_a_layer_that_is_moved_lets_the_ones_above_sink(environment: Environment) -> None:
    work(environment, "graspWith(Ham,LeftHand)", "putOnWith(Ham,Bun-bottom,LeftHand)")
    work(environment, "graspWith(Bun-top,LeftHand)", "putOnWith(Bun-top,Ham,LeftHand)")
    assert happen(environment, "move:Ham:-0.35,0.15") == ("Ham",)
    assert seen(environment)["Ham"][:2] == pytest.approx((-0.35, 0.15), abs=0.005)
    assert {a for a in atoms(environment) if a.startswith("on(")} == {"on(Bun-top,Bun-bottom)"}


def test_what_topples_lies_on_the_table_with_all_that_was_on_it(environment: Environment) -> None:
    assert happen(environment, "topple:Ham") == ()
    work(environment, "graspWith(Ham,LeftHand)", "putOnWith(Ham,Bun-bottom,LeftHand)")
    work(environment, "graspWith(Bun-top,LeftHand)", "putOnWith(Bun-top,Ham,LeftHand)")
    assert happen(environment, "topple:Ham") == ("Ham", "Bun-top")
    assert not [a for a in atoms(environment) if a.startswith("on(")]
    work(environment, "graspWith(Ham,LeftHand)", "putOnWith(Ham,Bun-bottom,LeftHand)")


def test_what_slips_lies_on_the_table_and_the_hand_is_free(environment: Environment) -> None:
    assert happen(environment, "empty:LeftHand") == ()
    work(environment, "graspWith(Ham,LeftHand)")
    assert happen(environment, "empty:LeftHand") == ("Ham",)
    now = atoms(environment)
    assert {"isClear(LeftHand)", "reachableWith(Ham,LeftHand)"} <= now
    assert "inHand(Ham,LeftHand)" not in now
    assert seen(environment)["Ham"][2] == pytest.approx(seen(environment)["Bun-bottom"][2] - 0.005, abs=0.003)
    work(environment, "graspWith(Ham,LeftHand)")


def test_a_held_thing_can_be_taken_from_the_hand(environment: Environment) -> None:
    work(environment, "graspWith(Ham,LeftHand)")
    assert happen(environment, "move:Ham:-0.35,0.15") == ("Ham",)
    assert "isClear(LeftHand)" in atoms(environment)
    work(environment, "graspWith(Bun-top,LeftHand)", "graspWith(Ham,RightHand)")


def test_a_place_that_is_taken_is_not_used_twice(environment: Environment) -> None:
    assert happen(environment, "move:Ham:-0.289,0.011") == ("Ham",)
    places = seen(environment)
    assert math.dist(places["Ham"][:2], places["Bun-bottom"][:2]) > 0.07
    assert not [a for a in atoms(environment) if a.startswith("on(")]


def test_things_nobody_knows_of_cannot_be_disturbed(environment: Environment) -> None:
    before = environment.observe()
    for event in ("remove:Unicorn", "move:Cheese:-0.3,0.1", "add:Unicorn:-0.3,0.1", "topple:Cheese"):
        assert happen(environment, event) == ()
    assert environment.observe() == before


@pytest.mark.parametrize("backend", ["symbolic", DRAKE])
def test_nothing_is_said_of_a_tool_that_is_not_there(backend: str) -> None:
    env = build(backend, "1:add:Rake:-0.45,0.25")
    env.reset(0)
    assert not [a for a in atoms(env) if "Rake" in a]
    assert happen(env, "add:Rake:-0.45,0.25") == ("Rake",)
    assert "reachableWith(Ham,Rake)" in atoms(env)
    assert happen(env, "remove:Rake") == ("Rake",)
    assert not [a for a in atoms(env) if "Rake" in a]
    env.close()


# -- saved states -----------------------------------------------------------------------------------


def saveable(backend: str) -> Environment:
    events = ("1:add:Cheese:-0.30,0.20",)
    return build(backend, *events, jitter=0.02, noise=NoiseLevels(left=0.3, right=0.3))


def two_actions(environment: Environment) -> list[object]:
    """What is seen and told, and the state afterwards."""
    seen: list[object] = [environment.observe()]
    for call in ("putOnWith(Ham,Bun-bottom,LeftHand)", "graspWith(Bun-top,RightHand)"):
        seen += [environment.execute(action(call)), environment.observe()]
    environment.settle(0.1)
    return [*seen, environment.observe(), json.dumps(environment.save())]


@pytest.mark.parametrize("backend", ["symbolic", DRAKE])
def test_a_restored_state_goes_on_to_the_last_bit(backend: str) -> None:
    """With something in the hand, something removed and something still to be added; the noise draws on."""
    first = saveable(backend)
    first.reset(3)
    first.execute(action("graspWith(Ham,LeftHand)"))
    saved = json.dumps(first.save())
    assert json.dumps(first.save()) == saved
    told = two_actions(first)
    happen(first, "add:Cheese:-0.30,0.20")
    assert first.restore(json.loads(saved)) == told[0]
    assert two_actions(first) == told
    fresh = saveable(backend)
    assert fresh.restore(json.loads(saved)) == told[0]
    assert json.dumps(fresh.save()) == saved
    assert two_actions(fresh) == told
    assert happen(fresh, "add:Cheese:-0.30,0.20") == ("Cheese",)


@pytest.mark.parametrize("backend", ["symbolic", DRAKE])
def test_a_state_that_does_not_fit_is_refused_in_one_line(backend: str) -> None:
    environment = build(backend)
    environment.reset(0)
    saved, seen_before = environment.save(), environment.observe()
    other = make_other(backend)
    bad: list[dict[str, Any]] = [{}, {"kind": saved["kind"]}, saved | {"format": 99}, other.save()]
    bad += [saved | {key: None} for key in saved]
    bad += [saved | {key: "x"} for key in saved]
    for state in bad:
        with pytest.raises(StateError, match="does not fit") as error:
            environment.restore(state)
        assert len(str(error.value).splitlines()) == 1
    assert environment.observe() == seen_before
    assert environment.save() == saved


def make_other(backend: str) -> Environment:
    domain = load_domain("sandwich")
    scene = load_scene("kitchen")
    other = make_environment(backend, domain, scene, load_rules(domain.rules_path), noise=NoiseLevels())
    other.reset(0)
    return other
