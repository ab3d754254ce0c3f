"""tapFromLeft(obj, hand), tapFromRight(obj, hand): hit an object from the side with the upright hand.

Left and right are the robot's own. The fingers point away from the robot and the palm faces its middle, as
in thesis Sec. 5.3.3: one tap is done with the palm, the other with the back of the hand.
"""

from __future__ import annotations

import math

from cognitive_arch.execution.environment import FailureReason
from sim.robot import Robot
from sim.skills.bare import sweep_object

TO_RIGHT, TO_LEFT = math.pi / 2, -math.pi / 2  # rad; the robot looks along -x
PITCHES = (0.30, 0.15, 0.45, 0.60)  # rad by which the fingers point down


def tap_from_left(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    obj, hand = args
    return sweep_object(robot, obj, hand, TO_RIGHT, [(math.pi / 2, p, math.pi / 2) for p in PITCHES])


def tap_from_right(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    obj, hand = args
    return sweep_object(robot, obj, hand, TO_LEFT, [(-math.pi / 2, p, math.pi / 2) for p in PITCHES])
