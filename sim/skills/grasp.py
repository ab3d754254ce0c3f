"""graspWith(obj, hand): come down on an object, close the fingers, lift it and carry it aside."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.shapes import Shape
from cognitive_arch.world.observation import HANDS
from sim.hands import FINGER_THICKNESS, FINGER_WIDTH, HANDLE, STROKE, Posture
from sim.kinematics import DOWN, HandTarget, Vector, palm_axis
from sim.robot import YAWS, Descent, Grip, Robot
from sim.skills.base import come_down, release
from sim.skills.tool import carry_tool
from sim.world import Joints

TIP_HEIGHT = 0.003  # m of the finger tips above the object's underside
DEPTH = 0.048  # m of an object that fit between the fingers: what is taller would meet the palm
MARGIN = 0.015  # m between each open finger and the object
SQUEEZE = 0.010  # m that the closing fingers are commanded into the object
FIRM_SQUEEZE = 0.025  # m into a tool: enough for all the force the fingers have
CARRY = {"LeftHand": (-0.26, -0.17), "RightHand": (-0.26, 0.17)}  # m, where a full hand waits
CARRY_HEIGHT = 0.14  # m above the table: from higher up, a slice that slips may roll off it


def grasp(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    name, hand = args
    return take(robot, name, hand)


def take(robot: Robot, name: str, hand: str, insets: Sequence[float] = HANDLE) -> FailureReason:
    """Take an object and carry it aside; a tool at one of `insets` (m from the end of its handle)."""
    reason, _ = pick_up(robot, name, hand, insets)
    if reason is not FailureReason.NONE:
        return reason
    if robot.domain.objects[name].shape.type == "tool":
        carry_tool(robot, hand, name)
    else:
        carry(robot, hand)
    return FailureReason.NONE if robot.perception.held(hand) == name else FailureReason.SLIPPED


def pick_up(
    robot: Robot, name: str, hand: str, insets: Sequence[float] = HANDLE
) -> tuple[FailureReason, list[Joints]]:
    """Take an object and raise it; returns why not, or `NONE`, and the waypoints from it upwards."""
    obstacle = _obstacle(robot, name, hand)
    if obstacle is not None:
        return obstacle, []
    aim = robot.noise.aim(hand, "grasp")
    width, yaws = grip_choices(robot, name)
    # A tool is a lever that wants to turn in the hand: the fingers press on it as hard as they can.
    is_tool = robot.domain.objects[name].shape.type == "tool"
    squeeze = (FIRM_SQUEEZE if is_tool else SQUEEZE) * robot.noise.grip(hand)
    closed = width / 2 - squeeze if is_tool else max(0.0, width / 2 - squeeze)
    robot.set_posture(hand, Posture.STRAIGHT)
    grip = Grip(min(STROKE, width / 2 + MARGIN), closed, yaws, robot.world.home)
    robot.look()
    plan = _plan(robot, name, hand, grip, aim, insets)
    if plan is None:
        reachable = robot.perception.can_take(hand, name)
        return FailureReason.BLOCKED if reachable else FailureReason.OUT_OF_REACH, []
    world = robot.world
    robot.go(plan.way)
    if not come_down(robot, hand, name, plan.down, 1.0):
        world.follow([world.command, plan.way[-1]], 0.6)
        robot.go_home(hand)
        return FailureReason.NOT_GRASPED, []
    world.move_fingers(hand, grip.closed, 0.5)
    world.hold(0.15)
    robot.perception.take_hold(hand, name)
    world.follow([world.with_fingers(q, hand, grip.closed) for q in plan.back], 1.0)
    world.hold(0.1)
    if robot.perception.held(hand) != name:
        release(robot, hand, STROKE)
        robot.go_home(hand)
        return FailureReason.NOT_GRASPED, []
    robot.grips[hand] = grip
    return FailureReason.NONE, [plan.down[-1], *plan.back]


def _obstacle(robot: Robot, name: str, hand: str) -> FailureReason | None:
    held = {h: robot.perception.held(h) for h in HANDS}
    if held[hand] is not None or name in held.values():
        return FailureReason.HAND_BUSY
    if robot.perception.covered_by(name):
        return FailureReason.COVERED
    width, _ = grip_choices(robot, name)
    return None if width / 2 + 0.005 <= STROKE else FailureReason.TOO_WIDE


def grip_choices(robot: Robot, name: str) -> tuple[float, tuple[float, ...]]:
    """Width between the fingers (metres) and the hand yaws (radians) at which the object can be held."""
    shape = robot.domain.objects[name].shape
    yaw = robot.perception.pose(name).rotation().ToRollPitchYaw().yaw_angle()
    if shape.type == "tool":
        return shape.width, (_wrap(yaw),)
    if shape.is_round:
        return shape.extent[0], YAWS
    faces = [(_wrap(yaw), shape.extent[1]), (_wrap(yaw + math.pi / 2), shape.extent[0])]
    width = min(size for _, size in faces)
    return width, tuple(angle for angle, size in faces if size <= width + 1e-6)


def _wrap(angle: float) -> float:
    """The angle within +-pi/2 that describes the same line."""
    return (angle + math.pi / 2) % math.pi - math.pi / 2


def _plan(
    robot: Robot, name: str, hand: str, grip: Grip, aim: Vector, insets: Sequence[float]
) -> Descent | None:
    targets = _targets(robot, name, hand, grip, aim, insets)
    # Sorting is stable: among equally free directions the more upright and straighter ones stay first.
    targets.sort(key=lambda target: -min(0.0, _clearance(robot, name, target, grip)))
    for target in targets:
        if _clearance(robot, name, target, grip) < -0.01:
            continue
        found = robot.descent(hand, target, [name], grip.opening)
        if found is not None:
            return found
    return None


def _targets(
    robot: Robot, name: str, hand: str, grip: Grip, aim: Vector, insets: Sequence[float]
) -> list[HandTarget]:
    """Where the finger tips could go: around an object's middle, or on a tool's handle."""
    shape, X_WO = robot.domain.objects[name].shape, robot.perception.pose(name)
    height = robot.world.height(name)
    up = np.array([0.0, 0.0, max(TIP_HEIGHT, height - DEPTH) - height / 2])
    if shape.type != "tool":
        return robot.grasp_targets(hand, X_WO.translation() + aim + up, grip.yaws)
    targets = []
    ends = (1.0,) if shape.bar > 0 else (1.0, -1.0)
    for inset, end in itertools.product(insets, ends):
        handle = X_WO @ np.array([end * (shape.length / 2 - inset), 0.0, 0.0])
        along = end * X_WO.rotation().matrix()[:, 0]
        # The stretched fingers point to the tool's head: held the other way round it is of no use.
        targets += [
            target
            for target in robot.grasp_targets(hand, handle + aim + up, grip.yaws)
            if target.fingers_W is not None
            and float(np.cross(palm_axis(hand)[2] * DOWN, along) @ target.fingers_W) < 0
        ]
    return targets


def _clearance(robot: Robot, name: str, target: HandTarget, grip: Grip) -> float:
    """Free space (metres) between the open fingers and the nearest other object at finger height."""
    assert target.fingers_W is not None
    free = 1.0
    for other in robot.perception.names():
        p_WN = robot.perception.pose(other).translation()
        same_stack = math.dist(p_WN[:2], robot.perception.pose(name).translation()[:2]) < 0.02
        if other == name or same_stack or robot.top_of(other) < target.p_WP[2]:
            continue
        for sign in (1, -1):
            middle = target.p_WP[:2] + sign * (grip.opening + FINGER_THICKNESS / 2) * target.fingers_W[:2]
            reach = math.hypot(FINGER_WIDTH / 2, FINGER_THICKNESS / 2) + robot.perception.radius(other)
            free = min(free, math.dist(middle, p_WN[:2]) - reach)
    return free


def carry(robot: Robot, hand: str) -> None:
    """Move what the hand holds to where a full hand waits, level, out of the other hand's way."""
    height = robot.scene.table.height + CARRY_HEIGHT
    target = object_target(robot, hand, np.array([*CARRY[hand], height]), None)
    robot.look()
    joints = robot.kinematics.solve(
        hand, target, robot.rest(hand), idle=robot.idle_target(hand), accept=robot.clearance.free
    )
    if joints is not None:
        robot.travel(hand, joints)
    robot.grips[hand].carrying = robot.world.command


def _up(shape: Shape, X_WO: RigidTransform) -> Vector:
    """The axis of an object that is to point up when it is put down; of what can lie on any side, the one
    that does so now."""
    if shape.type in ("cylinder", "tool"):
        return np.array([0.0, 0.0, 1.0])
    heights = X_WO.rotation().matrix()[2]
    axis = int(np.abs(heights).argmax())
    up: Vector = np.sign(heights[axis]) * np.eye(3)[axis]
    return up


def object_target(robot: Robot, hand: str, p_WO: Vector, fingers_W: Vector | None) -> HandTarget:
    """The hand pose that brings what it holds to `p_WO` (its centre, metres), lying level."""
    name = robot.perception.held(hand)
    assert name is not None
    X_WO = robot.perception.pose(name)
    X_HO = robot.world.hand_pose(hand).inverse() @ X_WO
    up_H = X_HO.rotation().matrix() @ _up(robot.domain.objects[name].shape, X_WO)
    return HandTarget(X_HO.translation(), p_WO, up_H, np.array([0.0, 0.0, 1.0]), 0.03, fingers_W)
