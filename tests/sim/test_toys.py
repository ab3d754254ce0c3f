"""Boxes, balls, a brick and a pear: what they weigh, how they roll, and that hands hold them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.multibody.math import SpatialVelocity

from cognitive_arch.domain import Domain, load_domain
from cognitive_arch.execution.environment import FailureReason, Outcome
from cognitive_arch.scenes import load_scene
from sim.environment import DrakeEnvironment
from sim.scenario import ROLLING_TIME, object_inertia, rolling_damping
from sim.world import World
from tests.conftest import action


@pytest.fixture(scope="module")
def toys() -> Domain:
    return load_domain("toys")


@pytest.fixture(scope="module")
def world(toys: Domain) -> World:
    scene = load_scene("toys")
    made = World(toys, scene)
    made.reset(dict(scene.objects))
    return made


def test_inertia_of_what_is_made_of_parts(toys: Domain) -> None:
    for name, spec in toys.objects.items():
        assert object_inertia(spec).IsPhysicallyValid(), name
        assert object_inertia(spec).get_mass() == pytest.approx(spec.mass)
    brick, pear = (object_inertia(toys.objects[name]) for name in ("Brick", "Pear"))
    assert brick.get_com() == pytest.approx([0, 0, -0.0014], abs=2e-4)  # the studs are light
    assert pear.get_com()[2] < -0.003  # it stands, for its belly is heavy


def test_everything_stays_where_it_is_put(world: World) -> None:
    world.reset(dict(world.scene.objects))
    world.hold(1.0)
    for name, placement in world.scene.objects.items():
        assert math.dist(world.pose(name).translation()[:2], placement.position) < 5e-4, name
        assert world.pose(name).rotation().matrix()[2, 2] > 0.9999, name


@pytest.mark.parametrize("speed", [0.1, 0.2])
def test_a_ball_rolls_a_few_centimetres_and_lies_still(world: World, speed: float) -> None:
    world.reset(dict(world.scene.objects))
    world.hold(0.1)
    context = world.plant.GetMyMutableContextFromRoot(world.simulator.get_mutable_context())
    for name in ("Red-ball", "Blue-ball"):
        shape = world.domain.objects[name].shape
        assert shape.type == "sphere"
        start = world.pose(name).translation()
        # Away from the robot and from all other things, without slipping.
        rolling = SpatialVelocity(np.array([0.0, -speed / shape.radius, 0.0]), np.array([-speed, 0.0, 0.0]))
        world.plant.SetFreeBodySpatialVelocity(context, world.scenario.objects[name], rolling)
        world.hold(1.5)
        rest = world.pose(name).translation()
        assert math.dist(start, rest) == pytest.approx(speed * ROLLING_TIME, rel=0.05)
        world.hold(1.0)
        assert math.dist(rest, world.pose(name).translation()) < 1e-5


def test_only_what_rolls_is_damped_and_it_can_still_be_parked(world: World, toys: Domain) -> None:
    assert {name for name, spec in toys.objects.items() if rolling_damping(spec) > 0} == {
        "Red-ball",
        "Blue-ball",
        "Pear",
    }
    world.park("Red-ball")
    before = world.pose("Red-ball").translation()
    world.hold(0.2)
    assert world.pose("Red-ball").translation() == pytest.approx(before)
    world.reset(dict(world.scene.objects))
    assert world.pose("Red-ball").translation()[:2] == pytest.approx(world.scene.objects["Red-ball"].position)


@pytest.mark.physics
@pytest.mark.parametrize(("name", "hand"), [("Red-ball", "RightHand"), ("Pear", "LeftHand")])
def test_round_things_are_held_by_friction(toys: Domain, name: str, hand: str) -> None:
    environment = DrakeEnvironment(toys, load_scene("toys"))
    environment.reset(0)
    assert environment.execute(action(f"graspWith({name},{hand})")).outcome is Outcome.SUCCESS
    environment.settle(1.0)
    assert environment.robot.perception.held(hand) == name
    assert environment.execute(action(f"dropWith({name},{hand})")).outcome is Outcome.SUCCESS
    environment.settle(1.0)
    assert ("table", name) in environment.world.contacts()


@pytest.mark.physics
def test_boxes_stack_even_on_studs(toys: Domain) -> None:
    environment = DrakeEnvironment(toys, load_scene("boxes"))
    environment.reset(0)
    for call in (
        "graspWith(Brick,LeftHand)",
        "putOnWith(Brick,Big-box,LeftHand)",
        "graspWith(Small-box,RightHand)",
        "putOnWith(Small-box,Brick,RightHand)",
    ):
        assert environment.execute(action(call)).reason is FailureReason.NONE, call
    environment.settle(2.0)
    below = {obj.name: obj.below for obj in environment.observe().objects}
    assert below["Brick"] == ("Big-box",)
    assert below["Small-box"] == ("Brick",)
    table = environment.world.scene.table.height
    top = environment.world.pose("Small-box").translation()[2] - table
    assert top == pytest.approx(0.050 + 0.028 + 0.018, abs=0.002)
