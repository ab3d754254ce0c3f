"""pull(obj, tool, hand): reach behind an object with a tool that has a bar, and drag it into reach."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.world.observation import HANDS
from sim.footprint import Capsule, Point, disc, footprint, smallest_gap
from sim.robot import Robot
from sim.skills.tool import (
    PITCHES,
    HeldTool,
    Sweep,
    discomfort,
    first_feasible,
    held_tool,
    is_free,
    obstacles,
    perform,
    spread_idle_arm,
    unusable,
)

BEHIND = 0.015  # m between the bar and the object when the tool comes down
BESIDE = 0.005  # m between the shaft and the object
CLOSER = 0.115  # m that a pull is to bring an object closer, at least
ROOM = 0.030  # m around the object where it ends up: fingers must fit in
ENDS = (  # m, x and y to choose from
    tuple(round(float(x), 2) for x in np.arange(-0.30, -0.46, -0.02)),
    tuple(round(float(y), 2) for y in np.arange(-0.21, 0.22, 0.03)),
)
SKEWS = (0.0, 0.3, -0.3, 0.55, -0.55)  # rad; friction holds the object on the bar up to about 0.67
BEST_X = -0.40  # m


def pull(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    obj, name, hand = args
    reason = unusable(robot, obj, name, hand)
    if reason is not None:
        return reason
    tool = held_tool(robot, name, hand)
    if tool is None or tool.shape.bar <= 0:
        return FailureReason.CANNOT_PULL
    tool = tool.with_head_off(robot.noise.head("pull"))
    spread_idle_arm(robot, hand)
    motion = first_feasible(robot, tool, _sweeps(robot, tool, obj))
    return FailureReason.OUT_OF_REACH if motion is None else perform(robot, tool, motion)


def _sweeps(robot: Robot, tool: HeldTool, obj: str) -> Iterator[Sweep]:
    """Ways to drag the object to where the other hand can take it, the best first."""
    x, y, _ = robot.world.pose(obj).translation()
    place = (float(x), float(y))
    (body,) = footprint(robot.domain.objects[obj].shape, robot.world.pose(obj))
    others = obstacles(robot, obj)
    low = [c for capsules in others.values() for c in capsules]
    ranked = []
    for end, skew, side in itertools.product(itertools.product(*ENDS), SKEWS, (1.0, -1.0)):
        course = math.atan2(end[1] - place[1], end[0] - place[0])
        # Pulled askew the object slides along the bar: it must slide towards the shaft.
        if end[0] - place[0] < CLOSER or abs(course) > 0.9 or skew * side > 0:
            continue
        room = smallest_gap([disc(end, body.radius)], low)
        if room < ROOM or smallest_gap([Capsule(place, end, body.radius)], low) < 0.005:
            continue
        sweep = _sweep(tool, place, end, body.radius, side, skew)
        cost = discomfort(tool, sweep) + 2 * abs(end[0] - BEST_X) + abs(end[1]) + 10 * max(0.0, 0.06 - room)
        ranked.append((cost, end, sweep))
    other = next(hand for hand in HANDS if hand != tool.hand)
    for _, end, flat in sorted(ranked, key=lambda row: row[0]):
        if not robot.kinematics.reaches(other, *end):
            continue
        for pitch in PITCHES:
            sweep = replace(flat, pitch=pitch)
            if is_free(robot, tool, sweep, others):
                yield sweep


def _sweep(tool: HeldTool, place: Point, end: Point, radius: float, side: float, skew: float) -> Sweep:
    """Object from `place` to `end`, the shaft turned by `skew` (radians) from that direction; `side` is
    on which side of the shaft the object lies (+1: towards y of the tool)."""
    yaw = math.atan2(end[1] - place[1], end[0] - place[0]) + skew
    half = tool.shape.width / 2
    beside = side * (half + radius + BESIDE)

    def head(point: Point, along: float) -> Point:
        return (
            point[0] - along * math.cos(yaw) + beside * math.sin(yaw),
            point[1] - along * math.sin(yaw) - beside * math.cos(yaw),
        )

    return Sweep(yaw, head(place, half + radius + BEHIND), head(end, half + radius))
