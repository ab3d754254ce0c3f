"""lift(obj, hand): take an object, hold it up for a moment, and set it down again where it was."""

from __future__ import annotations

from cognitive_arch.execution.environment import FailureReason
from sim.robot import Robot
from sim.skills.base import looked_for, release
from sim.skills.grasp import pick_up

HELD_UP = 0.5  # s


def lift(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`. Measures `lift`: how much higher the object was while it was held up, metres."""
    name, hand = args
    world = robot.world
    before = robot.perception.pose(name).translation()
    beneath = robot.perception.supports(name)
    reason, way_up = pick_up(robot, name, hand)
    if reason is not FailureReason.NONE:
        return reason
    world.hold(HELD_UP)
    robot.measured["lift"] = float(robot.perception.pose(name).translation()[2] - before[2])
    grip = robot.grips[hand]
    if robot.perception.held(hand) != name:
        release(robot, hand, grip.opening)
        robot.go_home(hand)
        return FailureReason.SLIPPED
    world.follow([world.with_fingers(q, hand, grip.closed) for q in way_up[::-1]], 1.2)
    world.hold(0.2)
    release(robot, hand, grip.opening)
    world.follow([world.with_fingers(q, hand, grip.opening) for q in way_up], 0.9)
    robot.go_home(hand)
    if not looked_for(robot, name):
        return FailureReason.MISPLACED
    # It is to stand again on what it stood on.
    back = set(robot.perception.supports(name)) == set(beneath)
    on_table = bool(beneath) or robot.perception.on_table(name)
    return FailureReason.NONE if back and on_table else FailureReason.MISPLACED
