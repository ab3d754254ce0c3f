"""What the robot must not run into, and demands that cannot be met: they end with a reason, nothing moves."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cognitive_arch.domain import Domain, ObjectSpec, Placement, Scene, load_domain
from cognitive_arch.execution.environment import FailureReason, Outcome
from cognitive_arch.runs import run_task
from cognitive_arch.scenes import load_scene
from cognitive_arch.session import RunConfig
from sim.environment import DrakeEnvironment
from sim.kinematics import DOWN, HandTarget, fingertip, palm_axis
from sim.skills.grasp import take
from sim.skills.put import set_down
from sim.skills.regrip import INSETS
from sim.skills.tool import held_tool, lay_targets
from tests.conftest import action


@pytest.fixture(scope="module")
def simple(domain: Domain) -> DrakeEnvironment:
    environment = DrakeEnvironment(domain, load_scene("simple"), perception="oracle")
    environment.reset(0)
    return environment


def reaching(environment: DrakeEnvironment, hand: str, place: tuple[float, float, float]) -> np.ndarray:
    """Joints with the tips of the open fingers at `place`, palm down, whatever is in the way."""
    robot = environment.robot
    target = HandTarget(fingertip(hand), np.array(place), palm_axis(hand), DOWN, 0.1)
    near = robot.world.with_fingers(robot.rest(hand), hand, 0.05)
    joints = robot.kinematics.solve(hand, target, near)
    assert joints is not None
    return joints


def test_home_is_free_and_a_hand_in_the_table_is_not(simple: DrakeEnvironment) -> None:
    robot, table = simple.robot, simple.world.scene.table.height
    robot.look()
    assert robot.clearance.free(robot.world.home)
    assert robot.clearance.free(reaching(simple, "LeftHand", (-0.35, -0.15, table + 0.02)))
    deep = reaching(simple, "LeftHand", (-0.35, -0.15, table - 0.02))
    assert not robot.clearance.free(deep)
    assert {"table"} < {name for pair in robot.clearance.too_near(deep) for name in pair}
    assert not robot.clearance.free_path([robot.world.home, deep, robot.world.home])


def test_only_what_may_be_touched_may_be_touched(simple: DrakeEnvironment) -> None:
    robot = simple.robot
    robot.look()
    x, y, z = robot.world.pose("Ham").translation()
    into = reaching(simple, "RightHand", (float(x), float(y) - 0.03, float(z) + 0.004))
    assert not robot.clearance.free(into)
    with robot.clearance.touching("RightHand", ["Bun-top"]):
        assert not robot.clearance.free(into)
    with robot.clearance.touching("RightHand", ["Ham"]):
        assert robot.clearance.free(into)
    assert not robot.clearance.free(into)
    assert not robot.clearance.free_path([into, robot.world.home])
    raised = robot.kinematics.solve("RightHand", robot.kinematics.raised("RightHand", into, 0.12), into)
    assert raised is not None
    assert robot.clearance.free_from(into, [raised, robot.world.home])
    assert not robot.clearance.free_from(into, [raised, into, raised])  # once away, it counts


def test_arms_keep_clear_of_each_other_and_of_the_trunk(simple: DrakeEnvironment) -> None:
    robot, names = simple.robot, simple.world.joint_names
    robot.look()
    crossed = robot.world.home.copy()
    for side in "lr":
        crossed[names.index(f"{side}_shoulder_yaw")] = 1.2
        crossed[names.index(f"{side}_shoulder_roll")] = 0.2
    pairs = robot.clearance.too_near(crossed)
    assert any({a[:2], b[:2]} == {"l_", "r_"} for a, b in pairs), pairs
    folded = robot.world.home.copy()
    folded[names.index("l_shoulder_yaw")], folded[names.index("l_elbow")] = 1.3, 1.8
    folded[names.index("l_shoulder_roll")] = 0.0
    assert not robot.clearance.free(folded)


def test_what_is_held_belongs_to_the_hand(simple: DrakeEnvironment) -> None:
    robot, table = simple.robot, simple.world.scene.table.height
    high = reaching(simple, "LeftHand", (-0.35, -0.15, table + 0.12))
    robot.look()
    assert robot.clearance.free(high)
    from pydrake.math import RigidTransform

    long_way_down = RigidTransform(fingertip("LeftHand") + 0.13 * palm_axis("LeftHand"))
    robot.look({"LeftHand": ("Ham", long_way_down)})
    assert not robot.clearance.free(high)


WALL = {"shape": {"type": "box", "size": [0.09, 0.015, 0.09]}, "mass": 0.2, "color": [0.5, 0.5, 0.5]}


def walled_in() -> DrakeEnvironment:
    """A small box between four walls that are higher than the fingers are long."""
    toys = load_domain("toys")
    names = [f"Wall-{n}" for n in range(4)]
    domain = toys.model_copy(
        update={"objects": {**toys.objects, **{name: ObjectSpec.model_validate(WALL) for name in names}}}
    )
    x, y, off = -0.36, 0.10, 0.040
    places = {
        names[0]: Placement(position=(x, y + off)),
        names[1]: Placement(position=(x, y - off)),
        names[2]: Placement(position=(x + 0.055, y), yaw=math.pi / 2),
        names[3]: Placement(position=(x - 0.055, y), yaw=math.pi / 2),
        "Small-box": Placement(position=(x, y)),
    }
    return DrakeEnvironment(domain, Scene(name="walled", domain="toys", objects=places), perception="oracle")


def test_behind_a_wall_of_others() -> None:
    environment = walled_in()
    environment.reset(0)
    before = {name: environment.world.pose(name).translation() for name in environment.world.scenario.objects}
    for call in ("graspWith", "tapFromLeft", "push", "pull", "lift"):
        for hand in ("LeftHand", "RightHand"):
            result = environment.execute(action(f"{call}(Small-box,{hand})"))
            assert result.outcome is Outcome.FAILURE
            assert result.reason in {FailureReason.BLOCKED, FailureReason.OUT_OF_REACH}, call
    assert environment.execute(action("graspWith(Small-box,RightHand)")).reason is FailureReason.BLOCKED
    for name, place in before.items():
        assert math.dist(place, environment.world.pose(name).translation()) < 0.002, name


def test_off_the_table(tmp_path: Path) -> None:
    """It fell down when the scene began: the robot does not see it, and says what it misses."""
    scene = tmp_path / "edge.yaml"
    scene.write_text(
        "name: edge\ndomain: toys\nobjects:\n"
        "  Red-ball: {position: [-0.95, 0.0]}\n  Big-box: {position: [-0.35, 0.1]}\n"
    )
    result = run_task("take the red ball", RunConfig(scene=str(scene), record=False), tmp_path / "runs")
    assert not result["success"]
    assert "Red-ball" in result["explanation"]
    assert result["total"] == 0


@pytest.mark.physics
def test_a_tool_is_laid_down_flat_and_taken_elsewhere(domain: Domain) -> None:
    environment = DrakeEnvironment(domain, load_scene("complex"), perception="oracle")
    environment.reset(0)
    assert environment.execute(action("graspWith(Rake,RightHand)")).outcome is Outcome.SUCCESS
    robot = environment.robot
    tool = held_tool(robot, "Rake", "RightHand")
    assert tool is not None
    assert set_down(robot, "RightHand", lay_targets(robot, tool, INSETS[-1])) is FailureReason.NONE
    assert ("Rake", "table") in environment.world.contacts()
    up = environment.world.pose("Rake").rotation().matrix()[2, 2]
    assert up > math.cos(0.02)
    assert take(robot, "Rake", "RightHand", (INSETS[-1],)) is FailureReason.NONE
    shorter = held_tool(robot, "Rake", "RightHand")
    assert shorter is not None
    assert tool.grip - shorter.grip == pytest.approx(INSETS[-1] - INSETS[0], abs=0.01)
