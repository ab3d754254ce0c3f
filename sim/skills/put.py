"""putOnWith(obj, target, hand): lower what the hand holds onto another object, let go, withdraw."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.world.observation import HANDS
from sim.kinematics import HandTarget, Vector, finger_directions
from sim.robot import YAWS, Robot
from sim.skills.base import looked_for, release
from sim.skills.grasp import object_target

GAP = 0.002  # m left under the object when the hand opens


def put_on(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    name, target, hand = args
    if robot.perception.held(hand) != name or hand not in robot.grips:
        return FailureReason.HAND_EMPTY
    if target in {robot.perception.held(h) for h in HANDS}:
        return FailureReason.HAND_BUSY
    if robot.perception.covered_by(target):
        return FailureReason.COVERED
    p_WT = robot.perception.pose(target).translation()
    place = np.array([p_WT[0], p_WT[1], robot.top_of(target) + robot.world.height(name) / 2])
    aim = robot.noise.aim(hand, "put")
    reason = set_down(robot, hand, level_targets(robot, hand, place + aim), [target])
    if reason is FailureReason.OUT_OF_REACH and robot.kinematics.reaches(hand, *map(float, p_WT[:2])):
        return FailureReason.BLOCKED
    there = looked_for(robot, name)
    if reason is FailureReason.NONE and not (there and target in robot.perception.supports(name)):
        return FailureReason.MISPLACED
    return reason


def level_targets(robot: Robot, hand: str, p_WO: Vector) -> list[HandTarget]:
    """Ways to bring what the hand holds to where its centre will be at `p_WO` (metres), lying level."""
    above = p_WO + np.array([0.0, 0.0, GAP])
    directions: list[Vector | None] = [*finger_directions(YAWS), None]
    return [object_target(robot, hand, above, direction) for direction in directions]


def set_down(
    robot: Robot, hand: str, targets: Iterable[HandTarget], touched: Collection[str] = ()
) -> FailureReason:
    """Lower what the hand holds to the first of the targets that can be reached, let go, and go home.

    On the way down it may touch the objects `touched`.
    """
    robot.look()
    plan = next(filter(None, (robot.descent(hand, target, touched) for target in targets)), None)
    if plan is None:
        return FailureReason.OUT_OF_REACH
    world, name = robot.world, robot.perception.held(hand)
    robot.go(plan.way)
    if robot.perception.held(hand) != name:
        release(robot, hand, robot.grips[hand].opening)
        robot.go_home(hand)
        return FailureReason.SLIPPED
    world.follow(plan.down, 1.2)
    world.hold(0.2)
    opening = robot.grips[hand].opening
    release(robot, hand, opening)
    world.follow([world.with_fingers(q, hand, opening) for q in plan.back], 0.9)
    robot.go_home(hand)
    return FailureReason.NONE
