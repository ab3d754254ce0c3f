"""pull(obj, tool, hand): reach behind an object with a tool that has a bar, and drag it into reach."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.world.observation import HANDS
from sim.footprint import Capsule, Point, disc, outer_radius, smallest_gap
from sim.robot import Robot
from sim.skills.regrip import sweep_with_tool
from sim.skills.tool import (
    PITCHES,
    HeldTool,
    Sweep,
    discomfort,
    is_free,
    obstacles,
)

BEHIND = 0.015  # m between the bar and the object when the tool comes down
BESIDE = 0.005  # m between the shaft and the object
ROOM = 0.030  # m around the object where it ends up: fingers must fit in
CLOSER = (0.113, 0.125, 0.14, 0.16, 0.18, 0.20, 0.24)  # m that a pull may bring an object closer
SIDEWAYS = tuple(round(float(y), 2) for y in np.arange(-0.21, 0.22, 0.03))  # m, y where it may end up
NEAREST_END = -0.30  # m, x
SKEWS = (0.0, 0.2, -0.2, 0.4, -0.4, 0.6, -0.6, 0.9, -0.9)  # rad
HOLDS = 0.65  # rad up to which friction keeps the object on the bar; beyond, it slides along to the shaft
BEST_X = -0.40  # m


def pull(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    return sweep_with_tool(robot, args, "pull", _sweeps, with_bar=True)


def _sweeps(robot: Robot, tool: HeldTool, obj: str) -> Iterator[Sweep]:
    """Ways to drag the object to where the other hand can take it, the best first."""
    x, y, _ = robot.perception.pose(obj).translation()
    place = (float(x), float(y))
    radius = outer_radius(robot.domain.objects[obj].shape)
    others = obstacles(robot, obj)
    low = [c for capsules in others.values() for c in capsules]
    ranked = []
    for closer, y, skew, side in itertools.product(CLOSER, SIDEWAYS, SKEWS, (1.0, -1.0)):
        end = (place[0] + closer, y)
        course = math.atan2(end[1] - place[1], end[0] - place[0])
        if not _bar_is_there(tool, side):
            continue
        # Pulled askew the object slides along the bar: it must slide towards the shaft.
        if end[0] > NEAREST_END or abs(course) > 0.9 or skew * side > 0:
            continue
        room = smallest_gap([disc(end, radius)], low)
        if room < ROOM or smallest_gap([Capsule(place, end, radius)], low) < 0.005:
            continue
        sweep = _sweep(tool, place, end, radius, side, skew)
        cost = (
            discomfort(tool, sweep)
            + 2 * abs(end[0] - BEST_X)
            + abs(end[1])
            + 10 * max(0.0, 0.06 - room)
            + 0.1 * abs(skew)
        )
        ranked.append((cost, end, skew, sweep))
    other = next(hand for hand in HANDS if hand != tool.hand)
    for _, end, skew, flat in sorted(ranked, key=lambda row: row[0]):
        if not robot.kinematics.reaches(other, *end):
            continue
        # Under a raised shaft the object would slip through.
        pitches = PITCHES if abs(skew) <= HOLDS else PITCHES[:1]
        for pitch in pitches:
            sweep = replace(flat, pitch=pitch)
            if is_free(robot, tool, sweep, others):
                yield sweep


def _bar_is_there(tool: HeldTool, side: float) -> bool:
    """A hook has its bar on one side of the shaft only, a rake on both."""
    low, high = tool.shape.sides
    reach, other = (high, -low) if side > 0 else (-low, high)
    return reach >= other


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
