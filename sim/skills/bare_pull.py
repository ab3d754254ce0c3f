"""pull(obj, hand): reach over an object, bring the fingers down behind it and draw it closer.

Bent or arched fingers hook it. Straight ones come to lie over it: the hand then stays above, and whether it
moves anything is for the observation to say.
"""

from __future__ import annotations

import math

from cognitive_arch.execution.environment import FailureReason
from sim.robot import Robot
from sim.skills.bare import sweep_object

CLOSER = 0.0  # rad; the robot looks along -x
PITCHES = (0.0, 0.12)  # rad by which the hand points down; it is level, whatever its fingers do


def pull_with_hand(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    obj, hand = args
    return sweep_object(robot, obj, hand, CLOSER, [(math.pi, pitch, 0.0) for pitch in PITCHES])
