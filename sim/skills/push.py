"""push(obj, tool, hand): put a tool's head in front of an object and shove it away from the robot."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

from cognitive_arch.execution.environment import FailureReason
from cognitive_arch.world.observation import HANDS
from sim.footprint import Capsule, Point, disc, on_table, outer_radius, smallest_gap
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

BEFORE = 0.015  # m between the head and the object when the tool comes down
DISTANCES = (0.12, 0.16, 0.20, 0.24)  # m farther away that an object may be pushed
COURSES = (0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0, -1.0)  # rad from straight away
SKEWS = (0.0, 0.2, -0.2, 0.4, -0.4)  # rad of a bar to its course; a tip pushes straight or not at all
STEEPEST = 1.0  # rad of a head to straight away
RIM = 0.04  # m that stay between a pushed object and the table's edge
ROOM = 0.01  # m around the object where it ends up


def push(robot: Robot, args: tuple[str, ...]) -> FailureReason:
    """See `base.Skill`."""
    return sweep_with_tool(robot, args, "push", _sweeps)


def _sweeps(robot: Robot, tool: HeldTool, obj: str) -> Iterator[Sweep]:
    """Ways to push the object out of reach, or at least farther away, the best first."""
    x, y, _ = robot.perception.pose(obj).translation()
    place = (float(x), float(y))
    radius = outer_radius(robot.domain.objects[obj].shape)
    others = obstacles(robot, obj)
    low = [c for capsules in others.values() for c in capsules]
    skews = SKEWS if tool.shape.bar > 0 else (0.0,)
    ranked = []
    for distance, course, skew in itertools.product(DISTANCES, COURSES, skews):
        if abs(course + skew) > STEEPEST:
            continue
        # Along a bar that is not square to the course things slide: they move at right angles to the bar.
        end = (place[0] - distance, place[1] - distance * math.tan(course + skew))
        path = Capsule(place, end, radius)
        if not on_table(disc(end, radius), RIM) or smallest_gap([path], low) < 0.005:
            continue
        if smallest_gap([disc(end, radius)], low) < ROOM:
            continue
        near = any(robot.kinematics.reaches(hand, *end) for hand in HANDS)
        far = distance / (math.cos(skew) * math.cos(course + skew))
        sweep = _sweep(tool, place, far, course, skew, radius)
        cost = discomfort(tool, sweep) + abs(course) + abs(skew) + far + (1.0 if near else 0.0)
        ranked.append((cost, sweep))
    for _, flat in sorted(ranked, key=lambda row: row[0]):
        for pitch in PITCHES:
            sweep = replace(flat, pitch=pitch)
            if is_free(robot, tool, sweep, others):
                yield sweep


def _sweep(tool: HeldTool, place: Point, far: float, course: float, skew: float, radius: float) -> Sweep:
    """The middle of the head's far face comes to the object at `place` and goes on for `far` metres."""
    yaw = course + skew
    ahead = tool.shape.width / 2 + radius

    def head(along: float) -> Point:
        start = (place[0] + ahead * math.cos(yaw), place[1] + ahead * math.sin(yaw))
        return (start[0] - along * math.cos(course), start[1] - along * math.sin(course))

    return Sweep(yaw, head(-BEFORE), head(far))
