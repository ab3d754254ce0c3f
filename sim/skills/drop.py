"""dropWith(obj, hand): lay what the hand holds on a free place of the table, gently."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from pydrake.math import RigidTransform

from cognitive_arch.execution.environment import FailureReason
from sim.footprint import disc, footprint, outer_radius, slab, smallest_gap
from sim.kinematics import HandTarget
from sim.robot import Robot
from sim.skills.base import looked_for
from sim.skills.put import level_targets, set_down
from sim.skills.tool import held_tool, lay_targets

ROOM = 0.025  # m around what is put down: fingers open there
FREE = 0.080  # m of room; more makes a place no better
PLACES = (np.arange(-0.24, -0.47, -0.04), np.arange(0.08, 0.30, 0.04))  # m, x and |y| to choose from


def drop(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    name, hand = args
    if robot.perception.held(hand) != name or hand not in robot.grips:
        return FailureReason.HAND_EMPTY
    reason = set_down(robot, hand, _targets(robot, name, hand))
    there = looked_for(robot, name)
    if reason is FailureReason.NONE and not (there and robot.perception.on_table(name)):
        return FailureReason.MISPLACED
    return reason


def _targets(robot: Robot, name: str, hand: str) -> Iterator[HandTarget]:
    tool = held_tool(robot, name, hand)
    if tool is not None:
        yield from lay_targets(robot, tool)
        return
    height = robot.scene.table.height + robot.world.height(name) / 2
    for x, y in free_places(robot, name, hand):
        yield from level_targets(robot, hand, np.array([x, y, height]))


def free_places(robot: Robot, name: str, hand: str) -> list[tuple[float, float]]:
    """Free places on the hand's side of the table, within reach, the freest first."""
    sign = -1.0 if hand == "LeftHand" else 1.0
    shapes = robot.domain.objects
    others = [
        capsule
        for other in robot.perception.names()
        if other != name
        for capsule in footprint(shapes[other].shape, robot.perception.pose(other))
    ]
    for stranger in robot.perception.strangers().values():
        others += slab(stranger.shape, RigidTransform(stranger.pose))
    own = outer_radius(shapes[name].shape)
    places = []
    for x, y in itertools.product(*PLACES):
        place = (float(x), sign * float(y))
        room = smallest_gap([disc(place, own)], others)
        if room >= ROOM and robot.kinematics.reaches(hand, *place):
            places.append((-min(room, FREE), abs(place[1]), place))
    return [place for *_, place in sorted(places)]
