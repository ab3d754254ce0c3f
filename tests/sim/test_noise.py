"""Physical noise: what it is made of, that it prints itself, and that failures follow from physics."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from cognitive_arch.domain import Domain
from cognitive_arch.errors import StateError
from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.environment import FailureReason, Outcome
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.relational.rules import RuleSet
from cognitive_arch.scenes import load_scene
from sim.environment import DrakeEnvironment
from sim.hands import FINGER_FRICTION, finger_names
from sim.noise import (
    ActuatorNoise,
    AimError,
    ArmState,
    Backlash,
    Calibration,
    HeadError,
    HeadLift,
    PhysicalNoise,
    SightError,
    SlipperyFingers,
    WeakGrip,
    spread,
)
from tests.conftest import action

ARM = (
    AimError(0.018, 0.024),
    SightError(0.006),
    Calibration(0.006),
    Backlash(0.01),
    ActuatorNoise(0.002),
    SlipperyFingers(0.5),
    WeakGrip(2.0),
)
TOOL = (HeadError(0.02), HeadLift(0.01))


def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def test_errors_of_aim_grow_with_the_level() -> None:
    assert spread(0.5, 0.02) == pytest.approx(0.02)
    sizes = [spread(level, 0.02) for level in np.linspace(0, 1, 101)]
    assert sizes == sorted(sizes)
    assert (sizes[0], sizes[-1]) == (0.0, 0.08)


@pytest.mark.parametrize("part", [*ARM, *TOOL], ids=lambda part: type(part).__name__)
def test_every_part_prints_itself_at_its_level(part: Any) -> None:
    low, high = part.told(0.2), part.told(0.8)
    assert low != high
    assert "\n" not in low
    assert " mm" in low or " mrad" in low or " %" in low


def test_a_composition_prints_each_part_once() -> None:
    noise = PhysicalNoise({"left": 0.5, "right": 0.5, "pull": 0.2}, arm=ARM, pull=TOOL, push=TOOL)
    lines = noise.told()
    assert len(lines) == len(ARM) + len(TOOL)
    aim = "aim off by a Gaussian of 18.0 mm (grasp) or 24.0 mm (put) in x and y, every time"
    assert lines[0] == f"left arm, right arm: {aim}"
    assert lines[-1] == "pull: the tool's head too high by a Gaussian of 2.0 mm, every time"
    assert len(PhysicalNoise({"left": 0.5, "right": 0.2}, arm=ARM).told()) == 2 * len(ARM)
    assert PhysicalNoise({}).told() == ()
    assert str(PhysicalNoise({"left": 0.0})) == "none"


def test_errors_of_aim_add_up() -> None:
    draw = rng()
    aim, sight = (np.array([part.aim(0.5, "put", draw) for _ in range(4000)]) for part in ARM[:2])
    assert aim.std(axis=0) == pytest.approx(2 * [spread(0.5, 0.024)], rel=0.05)
    assert sight.std(axis=0) == pytest.approx([0.003, 0.003], rel=0.05)
    up = np.array([HeadLift(0.01).head(0.5, draw) for _ in range(1000)])
    assert (up[:, :2] == 0).all()
    assert (up[:, 2] >= 0).all()  # never into the table
    assert up[:, 2].mean() == pytest.approx(0.005 * math.sqrt(2 / math.pi), rel=0.1)


def test_calibration_is_off_by_the_same_all_the_time() -> None:
    part, arm, joints = Calibration(0.006), ArmState(), np.zeros(7)
    part.begin(0.5, arm, 7, rng())
    first = part.set_point(0.5, joints, joints, arm, rng())
    assert first.any()
    assert part.set_point(0.5, joints + 1.0, joints, arm, rng()) - 1.0 == pytest.approx(first)


def test_backlash_is_play_between_motor_and_joint() -> None:
    part, arm = Backlash(0.02), ArmState()  # at level 0.5: 10 mrad
    part.begin(0.5, arm, 1, rng())
    motor = joint = 0.0
    for step, expected in ((0.004, 0.0), (0.1, 0.099), (-0.004, 0.099), (-0.006, 0.099), (-0.1, -0.001)):
        motor += step
        joint = float(part.set_point(0.5, np.array([motor]), np.array([step]), arm, rng())[0])
        assert joint == pytest.approx(expected), (step, motor)
    assert abs(joint - motor) == pytest.approx(0.005)


def test_actuators_shake_only_while_they_move() -> None:
    part, still = ActuatorNoise(0.002), np.zeros(7)
    assert (part.set_point(0.5, still, still, ArmState(), rng()) == still).all()
    draw = rng()
    shaken = np.array([part.set_point(0.5, still, still + 0.1, ArmState(), draw) for _ in range(1000)])
    assert shaken.std() == pytest.approx(0.001, rel=0.05)


def test_a_weak_grip_is_seldom_a_very_weak_one() -> None:
    draw = rng()
    grips = np.array([WeakGrip(2.0).grip(0.5, draw) for _ in range(4000)])
    assert ((grips >= 0) & (grips <= 1)).all()
    assert np.median(grips) == pytest.approx(0.5, abs=0.03)
    assert (grips < 0.1).mean() == pytest.approx(0.1, abs=0.02)


# -- in the simulation ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def noisy(domain: Domain) -> DrakeEnvironment:
    return DrakeEnvironment(
        domain, load_scene("simple"), noise={"left": 0.5, "pull": 0.5}, perception="oracle"
    )


def frictions(environment: DrakeEnvironment, side: str) -> set[float]:
    world = environment.world
    graph = world.scenario.scene_graph
    context = graph.GetMyContextFromRoot(world.simulator.get_context())
    inspector = graph.get_query_output_port().Eval(context).inspector()
    found = set()
    for name in finger_names(side):
        for geometry in world.plant.GetCollisionGeometriesForBody(world.plant.GetBodyByName(name)):
            properties = inspector.GetProximityProperties(geometry)
            found.add(properties.GetProperty("material", "coulomb_friction").static_friction())
    return found


def test_an_episode_draws_for_noisy_arms_only(noisy: DrakeEnvironment) -> None:
    noisy.reset(0)
    drawn = noisy.robot.noise.save()
    assert set(drawn) == {"LeftHand"}
    assert len(drawn["LeftHand"]["offsets"]) == 7
    assert frictions(noisy, "l") == {FINGER_FRICTION * drawn["LeftHand"]["friction"]}
    assert drawn["LeftHand"]["friction"] < 1
    assert frictions(noisy, "r") == {FINGER_FRICTION}
    assert not noisy.robot.noise.aim("RightHand", "put").any()
    assert noisy.robot.noise.grip("RightHand") == 1.0
    assert not noisy.robot.noise.head("push").any()
    assert noisy.robot.noise.head("pull").all()
    noisy.reset(1)
    assert noisy.robot.noise.save() != drawn
    noisy.reset(0)
    assert noisy.robot.noise.save() == drawn


def test_without_noise_nothing_is_drawn_and_nothing_changes(domain: Domain) -> None:
    environment = DrakeEnvironment(domain, load_scene("simple"), noise={"left": 0.0}, perception="oracle")
    environment.reset(3)
    state = environment.robot.rng.bit_generator.state
    noise, world = environment.robot.noise, environment.world
    assert not np.concatenate([noise.aim("LeftHand", "grasp"), noise.head("pull"), noise.head("push")]).any()
    assert noise.grip("LeftHand") == 1.0
    assert world.on_send is None
    assert environment.robot.rng.bit_generator.state == state
    assert environment.noise_told == ()


def test_set_points_arrive_wrong_and_the_robot_does_not_know(noisy: DrakeEnvironment) -> None:
    noisy.reset(0)
    world = noisy.world
    world.follow([world.home], 0.5)
    world.hold(0.5)
    left, right = (world.arm_joints(hand) for hand in ("LeftHand", "RightHand"))
    assert world.command == pytest.approx(world.home)
    # The arms have soft motors; both sag alike, so it is the difference that counts.
    error = np.abs((world.joints() - world.home)[left] - (world.joints() - world.home)[right])
    assert 0.0005 < error.max() < 0.02


def test_what_was_drawn_is_saved_and_restored(noisy: DrakeEnvironment, domain: Domain) -> None:
    noisy.reset(0)
    noisy.execute(action("graspWith(Unicorn,LeftHand)"))
    saved = json.loads(json.dumps(noisy.save()))
    drawn, friction = noisy.robot.noise.save(), frictions(noisy, "l")
    noisy.reset(1)
    noisy.restore(saved)
    assert noisy.robot.noise.save() == drawn
    assert frictions(noisy, "l") == friction
    assert noisy.save() == saved
    clean = DrakeEnvironment(domain, load_scene("simple"), perception="oracle")
    with pytest.raises(StateError, match="noise of LeftHand"):
        clean.restore(saved)


def test_the_composition_is_told(domain: Domain, rules: RuleSet, cogarch: Any) -> None:
    levels = NoiseLevels.parse("left=0.5,pull=0.25")
    drake, symbolic = (
        make_environment(backend, domain, load_scene("simple"), rules, noise=levels)
        for backend in ("drake", "symbolic")
    )
    assert {line.split(":")[0] for line in drake.noise_told} == {"left arm", "pull"}
    assert symbolic.noise_told[1] == "pull: an action fails with probability 0.25 and then changes nothing"
    answer = cogarch("run", "pick up the ham", "--backend", "symbolic", "--noise", "left=0.5", "--json")
    assert answer.json["physical_noise"] == [symbolic.noise_told[0]]
    assert "left: an action fails" in answer.err
    manifest = cogarch("inspect", "latest", "--json").json["manifest"]
    assert manifest["physical_noise"] == answer.json["physical_noise"]


@pytest.mark.physics
def test_a_grip_without_force_lets_the_object_slip(domain: Domain) -> None:
    limp = PhysicalNoise({"left": 1.0}, arm=(WeakGrip(power=1000.0),))
    environment = DrakeEnvironment(domain, load_scene("simple"), noise=limp, perception="oracle")
    environment.reset(0)
    result = environment.execute(action("graspWith(Ham,LeftHand)"))
    assert result.outcome is Outcome.FAILURE
    assert result.reason in (FailureReason.NOT_GRASPED, FailureReason.SLIPPED)


@pytest.mark.physics
def test_a_head_that_is_too_high_passes_over_the_object(domain: Domain) -> None:
    high = PhysicalNoise({"pull": 1.0}, pull=(HeadLift(sigma=0.1),))
    environment = DrakeEnvironment(domain, load_scene("complex"), noise=high, perception="oracle")
    environment.reset(0)
    assert environment.execute(action("graspWith(Rake,RightHand)")).outcome is Outcome.SUCCESS
    result = environment.execute(action("pull(Ham,Rake,RightHand)"))
    assert abs(result.effect["displacement_x"]) < 0.02
