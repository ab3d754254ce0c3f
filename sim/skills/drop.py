"""dropWith(obj, hand): lay what the hand holds on a free place of the table, gently."""

from __future__ import annotations

import itertools

import numpy as np

from cognitive_arch.execution.environment import FailureReason
from sim.footprint import disc, footprint, outer_radius, smallest_gap
from sim.robot import Robot
from sim.skills.put import set_down

ROOM = 0.025  # m around what is put down: fingers open there
TOOL_RADIUS = 0.03  # m about the middle of a shaft
FREE = 0.080  # m of room; more makes a place no better
PLACES = (np.arange(-0.24, -0.47, -0.04), np.arange(0.08, 0.30, 0.04))  # m, x and |y| to choose from


def drop(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    name, hand = args
    if robot.perception.held(hand) != name:
        return FailureReason.HAND_EMPTY
    height = robot.scene.table.height + robot.world.height(name) / 2
    for x, y in free_places(robot, name, hand):
        reason = set_down(robot, hand, np.array([x, y, height]))
        if reason is FailureReason.OUT_OF_REACH:
            continue
        if reason is FailureReason.NONE and ("table", name) not in robot.world.contacts():
            return FailureReason.MISPLACED
        return reason
    return FailureReason.OUT_OF_REACH


def free_places(robot: Robot, name: str, hand: str) -> list[tuple[float, float]]:
    """Free places on the hand's side of the table, within reach, the freest first."""
    sign = -1.0 if hand == "LeftHand" else 1.0
    world, shapes = robot.world, robot.domain.objects
    others = [
        capsule
        for other in world.scenario.objects
        if other != name
        for capsule in footprint(shapes[other].shape, world.pose(other))
    ]
    shape = shapes[name].shape
    # A tool reaches far, but where to depends on how it is held.
    own = TOOL_RADIUS if shape.type == "tool" else outer_radius(shape)
    places = []
    for x, y in itertools.product(*PLACES):
        place = (float(x), sign * float(y))
        room = smallest_gap([disc(place, own)], others)
        if room >= ROOM and robot.kinematics.reaches(hand, *place):
            places.append((-min(room, FREE), abs(place[1]), place))
    return [place for *_, place in sorted(places)]
