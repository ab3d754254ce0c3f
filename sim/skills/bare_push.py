"""push(obj, hand): shove an object away from the robot with the finger tips, or the backs of bent fingers."""

from __future__ import annotations

import math

from cognitive_arch.execution.environment import FailureReason
from sim.robot import Robot
from sim.skills.bare import sweep_object, upright_pitch

AWAY = math.pi  # rad; the robot looks along -x
MORE_OR_LESS = (0.0, 0.15, -0.15)  # rad from the best pitch


def push_with_hand(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    obj, hand = args
    best = upright_pitch(robot.postures[hand])
    return sweep_object(robot, obj, hand, AWAY, [(0.0, best + more, 0.0) for more in MORE_OR_LESS])
