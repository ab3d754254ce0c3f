"""touch(obj, hand): lower the finger tips onto an object until they feel it, and withdraw."""

from __future__ import annotations

import math

import numpy as np

from cognitive_arch.execution.environment import FailureReason
from sim.kinematics import Vector
from sim.robot import Robot
from sim.skills.bare import Stance, clear, obstacles, stance, unusable, upright_pitch
from sim.skills.base import looked_for
from sim.world import Joints

ABOVE = 0.09  # m over the object from which the finger tips come
SLOW = 0.008  # m over it from where they come slowly
DEEPEST = 0.004  # m under its top where they give up
SPEED = 0.012  # m/s of the last bit
DWELL = 0.3  # s of contact
HEADINGS = (0.0, 0.35, -0.35, 0.7, -0.7)  # rad from straight ahead
STILL = 0.010  # m that a touched object may move


def touch(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    obj, hand = args
    reason = unusable(robot, obj, hand)
    if reason is not None:
        return reason
    p_WT = robot.perception.pose(obj).translation() + robot.noise.aim(hand, "grasp")
    p_WT[2] = robot.top_of(obj)
    path, reason = _plan(robot, obj, hand, p_WT)
    if path is None:
        return reason
    world, before = robot.world, robot.perception.pose(obj).translation()
    touched = False

    def felt() -> bool:
        nonlocal touched
        touched = touched or robot.perception.feels(hand, obj)
        return touched

    way, near, end = path
    robot.go(way)
    world.follow([near], 0.9, felt)
    world.follow([end], (SLOW + DEEPEST) / SPEED, felt)
    if touched:
        world.hold(DWELL)
    world.follow([near, way[-1]], 0.9)
    robot.go_home(hand)
    if not looked_for(robot, obj):
        return FailureReason.OFF_TABLE
    if not touched:
        return FailureReason.NO_CONTACT
    moved = float(np.linalg.norm(robot.perception.pose(obj).translation() - before))
    return FailureReason.NONE if moved <= STILL else FailureReason.UNEXPECTED_EFFECT


def _plan(
    robot: Robot, obj: str, hand: str, p_WT: Vector
) -> tuple[tuple[list[Joints], Joints, Joints] | None, FailureReason]:
    """The way to above the object, joints just over it and a little below its top."""
    others = obstacles(robot, obj)
    robot.look()
    height = float(p_WT[2]) - robot.scene.table.height
    place = (float(p_WT[0]), float(p_WT[1]))
    pitch = upright_pitch(robot.postures[hand])
    blocked = False
    for heading in HEADINGS:
        held = stance(hand, robot.postures[hand], math.pi + heading, pitch, 0.0)
        if not clear(robot, held.covers(place, height), others):
            blocked = True
            continue
        path = _solve(robot, obj, held, p_WT)
        if not isinstance(path, FailureReason):
            return path, FailureReason.NONE
        blocked = blocked or path is FailureReason.BLOCKED
    return None, FailureReason.BLOCKED if blocked else FailureReason.OUT_OF_REACH


def _solve(
    robot: Robot, obj: str, held: Stance, p_WT: Vector
) -> tuple[list[Joints], Joints, Joints] | FailureReason:
    idle, joints = robot.idle_target(held.hand), robot.rest(held.hand)
    path = []
    for over in (ABOVE, SLOW, -DEEPEST):
        target = held.target(p_WT + np.array([0.0, 0.0, held.radius + over]))
        step = robot.kinematics.solve(held.hand, target, joints, idle=idle)
        if step is None:
            return FailureReason.OUT_OF_REACH
        path.append(step)
        joints = step
    above, near, end = path
    with robot.clearance.touching(held.hand, [obj]):
        if not robot.clearance.free_path(path):
            return FailureReason.BLOCKED
    way = robot.way(held.hand, above)
    return FailureReason.BLOCKED if way is None else (way, near, end)
