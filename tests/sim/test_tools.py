"""Tools in the hand: what they cover, why they are refused, and what pulling and pushing does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from cognitive_arch.domain import Domain, Scene, jittered
from cognitive_arch.execution.environment import FailureReason, Outcome
from cognitive_arch.perception.top_view import silhouette
from cognitive_arch.scenes import load_scene
from cognitive_arch.shapes import ToolShape
from sim.environment import DrakeEnvironment
from sim.footprint import Capsule, disc, gap, smallest_gap, tool_footprint
from sim.trials import mirrored
from tests.conftest import action
from tests.sim.physics import check_physics


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("complex")


@pytest.fixture(scope="module")
def complex_scene(domain: Domain, scene: Scene) -> DrakeEnvironment:
    return DrakeEnvironment(domain, scene, jitter=0.02)


def test_gaps_between_capsules() -> None:
    bar = Capsule((-1.0, 0.0), (1.0, 0.0), 0.1)
    assert gap(bar, disc((0.0, 1.0), 0.2)) == pytest.approx(0.7)
    assert gap(bar, disc((2.0, 0.0), 0.2)) == pytest.approx(0.7)
    assert gap(bar, Capsule((0.0, -1.0), (0.0, 1.0), 0.1)) < 0  # crossing, though no end is near
    assert smallest_gap([bar], []) == 1.0


def test_the_bar_of_a_rake_is_at_its_far_end(domain: Domain) -> None:
    shape = domain.objects["Rake"].shape
    assert shape.type == "tool"
    shaft, bar = tool_footprint(shape, (0.0, 0.0), 0.0)
    assert bar.a[0] == bar.b[0] == pytest.approx(-shape.length / 2 + shape.width / 2)
    assert abs(bar.a[1] - bar.b[1]) + 2 * bar.radius == pytest.approx(shape.bar)
    assert gap(shaft, bar) < 0
    turned = tool_footprint(shape, (0.0, 0.0), math.pi / 2)[1]
    assert turned.a[1] == pytest.approx(bar.a[0])


def test_the_bar_of_a_hook_is_on_one_side() -> None:
    hook = ToolShape(type="tool", length=0.3, width=0.02, bar=0.1, offset=0.04)
    assert hook.sides == pytest.approx((-0.01, 0.09))
    assert hook.extent == pytest.approx((0.3, 0.18))  # about the middle of the shaft
    _, bar = tool_footprint(hook, (0.0, 0.0), 0.0)
    assert bar.a[1] - bar.radius == pytest.approx(-0.01)
    assert bar.b[1] + bar.radius == pytest.approx(0.09)
    for way in (hook, hook.model_copy(update={"offset": -0.04})):
        seen = silhouette(way)  # up is away from the robot, right is its right
        head, handle = np.flatnonzero(seen[14]).mean(), np.flatnonzero(seen[-14]).mean()
        assert head - handle == pytest.approx(1000 * way.offset, abs=1.5)
    with pytest.raises(ValidationError, match="bar must lie on its shaft"):
        ToolShape(type="tool", length=0.3, width=0.02, bar=0.1, offset=0.06)


def test_jitter_turns_a_tool_only_as_far_as_it_may(domain: Domain, scene: Scene) -> None:
    for seed in range(20):
        placements = jittered(scene, 0.02, np.random.default_rng(seed), domain)
        assert abs(placements["Rake"].yaw) <= scene.objects["Rake"].turn < 0.3


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        ("pull(Ham,Rake,RightHand)", FailureReason.HAND_EMPTY),
        ("push(Ham,Stick,LeftHand)", FailureReason.HAND_EMPTY),
        ("pull(Ham,Unicorn,RightHand)", FailureReason.UNKNOWN_OBJECT),
        ("pull(Rake,Rake,RightHand)", FailureReason.UNKNOWN_OBJECT),
        ("pull(RightHand)", FailureReason.UNKNOWN_OBJECT),
    ],
)
def test_refusals(complex_scene: DrakeEnvironment, call: str, reason: FailureReason) -> None:
    complex_scene.reset(0)
    assert complex_scene.execute(action(call)).reason is reason


@pytest.mark.physics
def test_what_a_stick_cannot_do(complex_scene: DrakeEnvironment) -> None:
    complex_scene.reset(0)
    assert complex_scene.execute(action("graspWith(Stick,LeftHand)")).outcome is Outcome.SUCCESS
    refused = complex_scene.execute(action("pull(Ham,Stick,LeftHand)"))
    assert refused.reason is FailureReason.CANNOT_PULL
    pushed = complex_scene.execute(action("push(Ham,Stick,LeftHand)"))
    assert pushed.reason is FailureReason.NONE
    assert pushed.effect["displacement_x"] < -0.10
    assert complex_scene.robot.perception.held("LeftHand") == "Stick"


@pytest.mark.physics
def test_the_other_hand_pushes_with_a_rake_by_sight(domain: Domain, scene: Scene) -> None:
    """Its bar is cut by the border of the picture, and the way is oblique."""
    environment = DrakeEnvironment(domain, scene, jitter=0.02)
    environment.reset(4)
    assert environment.execute(action("graspWith(Rake,RightHand)")).outcome is Outcome.SUCCESS
    before = environment.robot.truth.pose("Ham").translation()[0]
    assert environment.execute(action("push(Ham,Rake,RightHand)")).reason is FailureReason.NONE
    assert environment.robot.truth.pose("Ham").translation()[0] < before - 0.10


@pytest.mark.physics
@pytest.mark.parametrize("hand", ["LeftHand", "RightHand"])
def test_pull_brings_it_within_reach_and_keeps_the_tool(domain: Domain, scene: Scene, hand: str) -> None:
    environment = DrakeEnvironment(domain, mirrored(scene) if hand == "LeftHand" else scene)
    environment.recorder.keep = True
    before = {obj.name: obj for obj in environment.reset(0).objects}
    assert not set(before["Ham"].reachable_with) & {"LeftHand", "RightHand"}
    assert environment.execute(action(f"graspWith(Rake,{hand})")).outcome is Outcome.SUCCESS
    result = environment.execute(action(f"pull(Ham,Rake,{hand})"))
    assert result.reason is FailureReason.NONE
    assert result.effect["displacement_x"] > 0.10
    after = {obj.name: obj for obj in environment.observe().objects}
    assert {"LeftHand", "RightHand"} & set(after["Ham"].reachable_with)
    assert environment.robot.perception.held(hand) == "Rake"
    for name in ("Bun-bottom", "Bun-top", "Stick", "Tomato"):
        assert math.dist(before[name].position, after[name].position) < 0.005, name
    assert 0.5 < result.effect["contact_duration"] < result.effect["duration"]  # the bar on the ham
    assert 0.1 < result.effect["object_speed"] < 1.0
    assert 0.1 < result.effect["hand_speed"] < 1.0
    check_physics(environment.recorder.trajectory())
