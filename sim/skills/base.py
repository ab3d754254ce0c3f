"""What every skill is: a motion that reports why it could not be done, never that it worked."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.world.observation import HANDS
from sim.hands import STROKE
from sim.robot import Robot
from sim.world import Joints

STUCK = 0.5  # s in which what is stuck falls out of an open hand

Skill = Callable[[Robot, tuple[str, ...]], FailureReason]
"""Moves the robot; returns `NONE` if the motion was carried out, else what was in the way or went wrong.
Whether it had the intended effect is for the observation afterwards to say."""


def unusable_arguments(robot: Robot, action: GroundAction) -> FailureReason | None:
    """Why the arguments (objects, then one hand) cannot be worked with, if so."""
    *objects, hand = action.args if action.args else ("",)
    if hand not in HANDS or len(set(objects)) < len(objects):
        return FailureReason.UNKNOWN_OBJECT
    return None if set(objects) <= set(robot.perception.names()) else FailureReason.UNKNOWN_OBJECT


def let_go_of_lost(robot: Robot) -> None:
    """Open and bring home every hand whose object has slipped away since it was grasped, or is stuck
    between the pads though it was let go.

    Otherwise the arm would go on being kept level for something it no longer carries, or no skill could use
    the hand again.
    """
    for hand in HANDS:
        if hand not in robot.grips and robot.perception.held(hand) is not None:
            release(robot, hand, STROKE)
            robot.world.hold(STUCK)
            robot.go_home(hand)
    for hand in sorted(robot.grips):
        if robot.perception.held(hand) is None:
            release(robot, hand, robot.grips[hand].opening)
            robot.go_home(hand)


def come_down(robot: Robot, hand: str, name: str, down: Sequence[Joints], seconds: float) -> bool:
    """Lower a hand to an object through waypoints; false if it came to lie on it and stopped there.

    Where an object is a little elsewhere than it was believed to be, the fingers would press into it.
    """
    felt = False

    def on_it() -> bool:
        nonlocal felt
        felt = felt or robot.perception.feels(hand, name)
        return felt

    robot.world.follow(down, seconds, on_it)
    return not felt


def looked_for(robot: Robot, name: str) -> bool:
    """Look, and say whether a thing is still there: somebody may have taken it, or it fell off the table."""
    robot.perception.look()
    return name in robot.perception.names()


def release(robot: Robot, hand: str, opening: float) -> None:
    """Open the hand where it is and forget the grip."""
    robot.perception.feel()  # where the thing is that is let go: afterwards the hand tells no more
    robot.world.move_fingers(hand, opening)
    robot.perception.feel()
    robot.world.hold(0.1)
    robot.grips.pop(hand, None)
