"""putOnWith(obj, target, hand): lower what the hand holds onto another object, let go, withdraw."""

from __future__ import annotations

import numpy as np

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.world.observation import HANDS
from sim.kinematics import Vector, finger_directions
from sim.robot import YAWS, Robot
from sim.skills.base import release
from sim.skills.grasp import object_target
from sim.world import Joints

GAP = 0.002  # m left under the object when the hand opens


def put_on(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    name, target, hand = args
    if robot.perception.held(hand) != name:
        return FailureReason.HAND_EMPTY
    if target in {robot.perception.held(h) for h in HANDS}:
        return FailureReason.HAND_BUSY
    if robot.perception.covered_by(target):
        return FailureReason.COVERED
    p_WT = robot.world.pose(target).translation()
    place = np.array([p_WT[0], p_WT[1], robot.top_of(target) + robot.world.height(name) / 2])
    reason = set_down(robot, hand, place + robot.noise.aim(hand, "put"))
    if reason is FailureReason.NONE and target not in robot.perception.supports(name):
        return FailureReason.MISPLACED
    return reason


def set_down(robot: Robot, hand: str, p_WO: Vector) -> FailureReason:
    """Lower what the hand holds until its centre is at `p_WO` (metres), let go, and go home."""
    plan = _plan(robot, hand, p_WO + np.array([0.0, 0.0, GAP]))
    if plan is None:
        return FailureReason.OUT_OF_REACH
    start, down = plan
    world, name = robot.world, robot.perception.held(hand)
    robot.travel(start)
    if robot.perception.held(hand) != name:
        release(robot, hand, robot.grips[hand].opening)
        robot.go_home(hand)
        return FailureReason.SLIPPED
    world.follow(down, 1.2)
    world.hold(0.2)
    opening = robot.grips[hand].opening
    release(robot, hand, opening)
    world.follow([world.with_fingers(q, hand, opening) for q in [*down[-2::-1], start]], 0.9)
    robot.go_home(hand)
    return FailureReason.NONE


def _plan(robot: Robot, hand: str, p_WO: Vector) -> tuple[Joints, list[Joints]] | None:
    directions: list[Vector | None] = [*finger_directions(YAWS), None]
    for direction in directions:
        found = robot.descent(hand, object_target(robot, hand, p_WO, direction))
        if found is not None:
            return found
    return None
