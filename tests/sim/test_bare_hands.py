"""Bare hands: the postures of the fingers, why a skill is refused, and what each one does to an object."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from cognitive_arch.domain import Domain, Placement, Scene
from cognitive_arch.execution.environment import FailureReason, Outcome
from sim.environment import DrakeEnvironment
from sim.hands import BENDS, PALM_SIGN, SIDES, Posture, finger_line, is_hand_joint, limbs
from sim.kinematics import DOWN, HandTarget, Kinematics, fingertip, palm_axis
from sim.skills.bare import stance
from sim.trials import TAPPED, bare_scene, use_hand
from tests.conftest import action
from tests.sim.physics import check_physics

HANDS = ("LeftHand", "RightHand")


def scene_of(**places: tuple[float, float]) -> Scene:
    """Objects of the sandwich domain, underscores for hyphens."""
    objects = {name.replace("_", "-"): Placement(position=place) for name, place in places.items()}
    return Scene(name="bare", objects=objects, events=())


@pytest.fixture(scope="module")
def crowded(domain: Domain) -> DrakeEnvironment:
    """Ham with a tomato right of it, a bun out of reach, another one by the table's left edge."""
    return DrakeEnvironment(
        domain,
        scene_of(Ham=(-0.36, 0.05), Tomato=(-0.36, 0.13), Bun_bottom=(-0.75, 0.0), Bun_top=(-0.36, -0.40)),
    )


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("posture", list(Posture))
def test_fingers_take_the_posture(crowded: DrakeEnvironment, hand: str, posture: Posture) -> None:
    """The tips are where the posture says, bent towards the palm, the same on both hands."""
    crowded.reset(0)
    crowded.set_posture(hand, posture)
    crowded.settle(0.3)
    world, side = crowded.world, SIDES[hand]
    knuckles = [world.joint_names.index(f"{side}_knuckle_{n}") for n in (1, 2, 3)]
    assert world.joints()[knuckles] == pytest.approx(BENDS[posture], abs=0.02)
    context = world.plant.GetMyContextFromRoot(world.simulator.get_context())
    tip = world.plant.GetFrameByName(f"{side}_phalanx_3").CalcPoseInWorld(context) @ np.array([0.012, 0, 0])
    x, depth = finger_line(posture)[-1]
    expected = world.hand_pose(hand) @ np.array([x, 0.0, -PALM_SIGN[side] * depth])
    assert tip == pytest.approx(expected, abs=0.002)
    other = next(h for h in HANDS if h != hand)
    assert crowded.robot.postures[other] is Posture.STRAIGHT


def test_hands_are_mirror_images() -> None:
    for posture in Posture:
        for left, right in zip(limbs("l", posture), limbs("r", posture), strict=True):
            assert (left.a[:2], left.b[:2], left.radius) == (right.a[:2], right.b[:2], right.radius)
            assert (left.a[2], left.b[2]) == (-right.a[2], -right.b[2])


def test_inverse_kinematics_leaves_the_hands_alone(crowded: DrakeEnvironment) -> None:
    crowded.reset(0)
    world = crowded.world
    near = world.with_posture(world.home, "LeftHand", Posture.ARCHED)
    kinematics = Kinematics(world.joint_names, world.scene.table.height)
    target = HandTarget(
        fingertip("LeftHand"), np.array([-0.35, -0.1, -0.05]), palm_axis("LeftHand"), DOWN, 0.1
    )
    joints = kinematics.solve("LeftHand", target, near)
    assert joints is not None
    own = np.array([is_hand_joint(name) for name in world.joint_names])
    assert own.sum() == 12
    assert (joints[own] == near[own]).all()
    assert not np.allclose(joints[~own], near[~own])


def test_a_stance_turns_the_palm_to_the_middle_and_has_the_little_finger_lowest() -> None:
    for hand, inwards in (("LeftHand", 1.0), ("RightHand", -1.0)):
        upright = stance(hand, Posture.STRAIGHT, math.pi, 0.4, math.pi / 2)
        assert upright.palm_W == pytest.approx([0.0, inwards, 0.0], abs=1e-9)
        assert upright.p_HL[:2] == pytest.approx([finger_line(Posture.STRAIGHT)[-1][0], 0.024])
        ahead, aside = upright.front((0.0, inwards), 0.01)
        assert ahead == pytest.approx(upright.radius, abs=1e-6)
        assert abs(aside) < 0.03


def test_a_full_hand_keeps_its_fingers_straight(crowded: DrakeEnvironment) -> None:
    crowded.reset(0)
    crowded.set_posture("LeftHand", Posture.BENT)
    assert crowded.execute(action("graspWith(Ham,LeftHand)")).outcome is Outcome.SUCCESS
    assert crowded.robot.postures["LeftHand"] is Posture.STRAIGHT
    with pytest.raises(ValueError, match="LeftHand holds something"):
        crowded.set_posture("LeftHand", Posture.ARCHED)
    for call in ("tapFromLeft(Tomato,LeftHand)", "touch(Ham,RightHand)", "lift(Ham,RightHand)"):
        assert crowded.execute(action(call)).reason is FailureReason.HAND_BUSY, call


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        ("tapFromLeft(Ham,LeftHand)", FailureReason.BLOCKED),  # the tomato is where the ham would go
        ("tapFromRight(Tomato,RightHand)", FailureReason.BLOCKED),
        ("tapFromRight(Bun-top,LeftHand)", FailureReason.OFF_TABLE),
        ("push(Bun-bottom,LeftHand)", FailureReason.OFF_TABLE),
        ("pull(Bun-bottom,RightHand)", FailureReason.OUT_OF_REACH),
        ("touch(Bun-bottom,RightHand)", FailureReason.OUT_OF_REACH),
        ("lift(Bun-bottom,RightHand)", FailureReason.OUT_OF_REACH),
        ("touch(Unicorn,LeftHand)", FailureReason.UNKNOWN_OBJECT),
        ("tapFromLeft(Ham,Tomato,LeftHand)", FailureReason.UNKNOWN_OBJECT),
        ("lift(LeftHand)", FailureReason.UNKNOWN_OBJECT),
    ],
)
def test_refusals_move_nothing(crowded: DrakeEnvironment, call: str, reason: FailureReason) -> None:
    crowded.reset(0)
    before = crowded.world.joints()
    result = crowded.execute(action(call))
    assert (result.outcome, result.reason) == (Outcome.FAILURE, reason)
    assert crowded.world.joints() == pytest.approx(before, abs=1e-3)


@pytest.mark.physics
@pytest.mark.parametrize(
    ("what", "hand", "posture"),
    [
        ("tapFromLeft", "LeftHand", Posture.STRAIGHT),  # with the palm
        ("tapFromLeft", "RightHand", Posture.ARCHED),  # with the back of the hand
        ("tapFromRight", "LeftHand", Posture.BENT),
        ("tapFromRight", "RightHand", Posture.STRAIGHT),
        ("push", "LeftHand", Posture.STRAIGHT),
        ("push", "RightHand", Posture.BENT),
        ("pull", "LeftHand", Posture.BENT),
        ("pull", "RightHand", Posture.ARCHED),
        ("touch", "LeftHand", Posture.ARCHED),
        ("lift", "RightHand", Posture.STRAIGHT),
    ],
)
def test_what_a_bare_hand_does(domain: Domain, what: str, hand: str, posture: Posture) -> None:
    """It moves the object the right way (or not at all), and nothing else."""
    environment = DrakeEnvironment(domain, bare_scene("Bun-bottom", hand), jitter=0.02, perception="oracle")
    environment.recorder.keep = True
    trial = use_hand(environment, what, posture, "Bun-bottom", hand, 0)
    assert trial.ok, trial.said
    check_physics(environment.recorder.trajectory())


@pytest.mark.physics
def test_straight_fingers_pull_nothing(domain: Domain) -> None:
    """The level hand passes over the object: bending the fingers is what makes the difference."""
    environment = DrakeEnvironment(domain, bare_scene("Bun-bottom", "RightHand"), perception="oracle")
    moved = {}
    for posture in (Posture.STRAIGHT, Posture.ARCHED):
        environment.reset(0)
        environment.set_posture("RightHand", posture)
        result = environment.execute(action("pull(Bun-bottom,RightHand)"))
        moved[posture] = result.effect["displacement_x"]
        assert (result.outcome is Outcome.SUCCESS) == (posture is Posture.ARCHED)
    assert abs(moved[Posture.STRAIGHT]) < 0.005
    assert moved[Posture.ARCHED] > 2 * TAPPED


def test_postures_are_part_of_the_saved_state(crowded: DrakeEnvironment) -> None:
    crowded.reset(0)
    crowded.set_posture("RightHand", Posture.ARCHED)
    saved = json.loads(json.dumps(crowded.save()))
    crowded.set_posture("RightHand", Posture.STRAIGHT)
    crowded.restore(saved)
    assert crowded.robot.postures == {"LeftHand": Posture.STRAIGHT, "RightHand": Posture.ARCHED}
    knuckle = crowded.world.joint_names.index("r_knuckle_2")
    assert crowded.world.joints()[knuckle] == pytest.approx(BENDS[Posture.ARCHED][1], abs=0.05)
