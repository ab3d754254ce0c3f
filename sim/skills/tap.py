"""tapFromLeft(obj, hand), tapFromRight(obj, hand): hit an object from the side with the upright hand.

Left and right are the robot's own. The fingers point away from the robot and the palm faces its middle, as
in thesis Sec. 5.3.3: one tap is done with the palm, the other with the back of the hand.
"""

from __future__ import annotations

import math

from cognitive_arch.execution.environment import FailureReason
from sim.robot import Robot
from sim.skills.bare import sweep_object, upright_pitch

TO_RIGHT, TO_LEFT = math.pi / 2, -math.pi / 2  # rad; the robot looks along -x
LEAST = 0.30  # rad by which the hand points down, at least: its wrist has to clear the table
MORE_OR_LESS = (0.0, 0.12, -0.12)  # rad from the best pitch


def tap_from_left(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    return _tap(robot, args, TO_RIGHT)


def tap_from_right(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    return _tap(robot, args, TO_LEFT)


def _tap(robot: Robot, args: tuple[str, ...], towards: float) -> FailureReason:
    obj, hand = args
    # Straight fingers meet the object with their tips, bent ones with all their length.
    best = max(LEAST, upright_pitch(robot.postures[hand]))
    return sweep_object(
        robot, obj, hand, towards, [(towards, best + more, math.pi / 2) for more in MORE_OR_LESS]
    )
