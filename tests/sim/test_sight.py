"""What the robot believes from its eyes and hands, beside what is there."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pydrake.math import RigidTransform

from cognitive_arch.domain import load_domain
from cognitive_arch.execution.environment import FailureReason, Outcome
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.scenes import load_scene
from cognitive_arch.world.anchoring import WorldModel
from sim.environment import DrakeEnvironment
from sim.eyes import SENSOR, EyeNoise
from sim.sight import CameraPerception
from sim.sight_trials import looks
from tests.conftest import action

pytestmark = pytest.mark.physics


@pytest.fixture
def kitchen() -> Iterator[DrakeEnvironment]:
    scene = load_scene("kitchen")
    environment = DrakeEnvironment(load_domain(scene.domain), scene)
    environment.reset(0)
    yield environment
    environment.close()


def believed(environment: DrakeEnvironment) -> set[str]:
    return {str(atom) for atom in WorldModel().update(environment.observe()).atoms()}


def true(environment: DrakeEnvironment) -> set[str]:
    truth = environment.truth()
    assert truth is not None
    return {str(atom) for atom in WorldModel().update(truth).atoms()}


def put_somewhere(environment: DrakeEnvironment, name: str, x: float, y: float, on: float = 0.0) -> None:
    """Somebody lays a thing there, its underside `on` metres above the table."""
    world = environment.world
    z = world.scene.table.height + on + world.height(name) / 2 + 0.0003
    world.place(name, RigidTransform([x, y, z]))
    environment.settle(0.3)


def test_a_scene_is_believed_to_be_as_it_is(kitchen: DrakeEnvironment) -> None:
    assert believed(kitchen) == true(kitchen)
    for obj in kitchen.observe().objects:
        assert obj.position == pytest.approx(kitchen.world.pose(obj.name).translation(), abs=0.004)


def test_what_is_true_never_reaches_the_robot(
    kitchen: DrakeEnvironment, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the simulator's poses and contacts of things it does all the same."""

    def forbidden(*_: object) -> None:
        raise AssertionError("the robot asked the simulator")

    monkeypatch.setattr(type(kitchen.world), "pose", forbidden)
    for name in ("held", "supports", "on_table", "names"):
        monkeypatch.setattr(type(kitchen.robot.truth), name, forbidden)
    assert kitchen.execute(action("graspWith(Ham,RightHand)")).outcome is Outcome.SUCCESS
    assert kitchen.execute(action("putOnWith(Ham,Bun-bottom,RightHand)")).outcome is Outcome.SUCCESS
    assert "on(Ham,Bun-bottom)" in believed(kitchen)


def test_its_own_hands_are_no_things(kitchen: DrakeEnvironment) -> None:
    kitchen.execute(action("graspWith(Ham,LeftHand)"))
    perception = kitchen.robot.perception
    assert isinstance(perception, CameraPerception)
    perception.look()
    assert perception.image is not None
    assert perception.image.own.mean() > 0.03
    assert {sighting.label for sighting in perception.sightings} <= set(kitchen.world.scenario.objects)
    assert believed(kitchen) == true(kitchen)


def test_a_pile_and_what_is_taken_from_it(kitchen: DrakeEnvironment) -> None:
    height = kitchen.world.height
    put_somewhere(kitchen, "Ham", -0.302, 0.001, height("Bun-bottom"))
    assert "on(Ham,Bun-bottom)" in believed(kitchen)
    put_somewhere(kitchen, "Bun-top", -0.300, 0.002, height("Bun-bottom") + height("Ham"))
    assert {"on(Bun-top,Ham)", "on(Bun-top,Bun-bottom)"} <= believed(kitchen) == true(kitchen)
    kitchen.disturb(OutsideEvent.parse("1:remove:Ham"))
    kitchen.settle(0.3)
    seen = believed(kitchen)
    assert "on(Bun-top,Bun-bottom)" in seen
    assert not [atom for atom in seen if "Ham" in atom]


def test_a_thing_that_disappears_and_one_that_is_moved(kitchen: DrakeEnvironment) -> None:
    kitchen.disturb(OutsideEvent.parse("1:remove:Tomato"))
    kitchen.disturb(OutsideEvent.parse("1:move:Ham:-0.35,-0.05"))
    seen = kitchen.observe()
    assert seen.absent == ("Tomato",)
    ham = next(obj for obj in seen.objects if obj.name == "Ham")
    assert ham.position == pytest.approx(kitchen.world.pose("Ham").translation(), abs=0.004)


def test_what_slips_from_the_hand_is_noticed(kitchen: DrakeEnvironment) -> None:
    kitchen.execute(action("graspWith(Cheese,RightHand)"))
    assert "inHand(Cheese,RightHand)" in believed(kitchen)
    kitchen.disturb(OutsideEvent.parse("1:empty:RightHand"))
    seen = believed(kitchen)
    assert "inHand(Cheese,RightHand)" not in seen
    assert seen == true(kitchen)


@pytest.mark.parametrize("call", ["putOnWith(Ham,Bun-bottom,RightHand)", "dropWith(Ham,RightHand)"])
def test_what_somebody_takes_as_the_hand_opens_is_missed(
    kitchen: DrakeEnvironment, monkeypatch: pytest.MonkeyPatch, call: str
) -> None:
    kitchen.execute(action("graspWith(Ham,RightHand)"))
    opened = kitchen.world.move_fingers

    def open_and_lose(hand: str, opening: float, seconds: float = 0.4) -> None:
        opened(hand, opening, seconds)
        kitchen.world.park("Ham")

    monkeypatch.setattr(kitchen.world, "move_fingers", open_and_lose)
    result = kitchen.execute(action(call))
    assert result.outcome is Outcome.FAILURE
    assert result.reason is FailureReason.MISPLACED
    assert "Ham" in kitchen.observe().absent


def test_what_a_hand_lets_go_of_is_not_believed_to_float(kitchen: DrakeEnvironment) -> None:
    kitchen.execute(action("graspWith(Ham,LeftHand)"))
    kitchen.disturb(OutsideEvent.parse("1:remove:Ham"))
    assert kitchen.observe().absent == ("Ham",)
    assert believed(kitchen) == true(kitchen)


def test_memory_is_saved_with_the_rest(kitchen: DrakeEnvironment) -> None:
    put_somewhere(kitchen, "Ham", -0.302, 0.001, kitchen.world.height("Bun-bottom"))
    before, picture = kitchen.observe(), kitchen.robot.perception.picture()
    saved = json.loads(json.dumps(kitchen.save()))
    other = DrakeEnvironment(load_domain("sandwich"), load_scene("kitchen"))
    assert other.restore(saved) == before
    assert json.dumps(other.save()) == json.dumps(saved)
    again = other.robot.perception.picture()  # at once, before any time has passed
    assert picture is not None
    assert again is not None
    assert np.array_equal(again, picture)


def test_noise_and_shadows_cut_nothing_to_pieces() -> None:
    """Half as much again as the sensors' own noise; dark sides of tools are where colours are least sure."""
    scene = load_scene("complex")
    noise = EyeNoise(1.5 * SENSOR.color, 1.5 * SENSOR.depth)
    environment = DrakeEnvironment(load_domain(scene.domain), scene, eye_noise=noise, shadows=True)
    environment.reset(0)
    perception = environment.robot.perception
    assert isinstance(perception, CameraPerception)
    assert sorted(sighting.label for sighting in perception.sightings) == sorted(scene.objects)
    assert not perception.strangers()
    assert believed(environment) == true(environment)
    environment.close()


def test_noise_is_that_of_the_moment() -> None:
    scene = load_scene("kitchen")
    environment = DrakeEnvironment(load_domain(scene.domain), scene, perception="noisy-camera")
    images = []
    for seed in (1, 1, 2):
        environment.reset(seed)
        perception = environment.robot.perception
        assert isinstance(perception, CameraPerception)
        assert perception.image is not None
        images.append(perception.image.depth)
    assert np.array_equal(images[0], images[1])
    assert not np.array_equal(images[0], images[2])
    saved = json.loads(json.dumps(environment.save()))
    environment.reset(3)
    environment.restore(saved)
    perception = environment.robot.perception
    assert isinstance(perception, CameraPerception)
    assert perception.image is not None
    assert np.array_equal(perception.image.depth, images[2])
    environment.close()


@pytest.mark.parametrize("seed", [2, 3])
def test_random_scenes_piles_and_full_hands(seed: int) -> None:
    for look in looks(seed):
        assert np.median(list(look.errors.values())) < 0.005
        assert max(look.errors.values()) < 0.012
        assert len(look.wrong) + len(look.overlooked) <= 0.01 * look.atoms


@pytest.mark.parametrize(("seed", "eyes"), [(30, {}), (70, {}), (9, {"eye_noise": SENSOR, "shadows": True})])
def test_layers_of_one_colour_and_layers_in_the_shadow_are_told_apart(
    seed: int, eyes: dict[str, Any]
) -> None:
    """In 30 and 70 a bun lies on a bun, in 9 the sides of two boxes are dark."""
    piled = list(itertools.islice(looks(seed, **eyes), 2))[1]
    assert piled.strangers == 0
    assert piled.mistaken("on") == 0
