"""Free places on the table, for things that come to lie there without the robot's doing."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from cognitive_arch.outside import Place, on_table
from cognitive_arch.shapes import Shape

CLEARANCE = 0.085  # m between the centres of two things that lie side by side
SMALL = 0.03  # m from the middle of a thing to its side, for which that clearance is meant


def footprint(shape: Shape, yaw: float) -> tuple[Place, ...]:
    """Points of an object relative to its centre (metres): one, four for what is large, or several along
    the shaft of a tool."""
    if shape.type != "tool":
        x, y = (max(0.0, size / 2 - SMALL) for size in shape.extent)
        points = [(0.0, 0.0)] if x == y == 0.0 else [(x, y), (x, -y), (-x, y), (-x, -y)]
    else:
        points = [(shape.length * n / 6, 0.0) for n in range(-3, 4)]
    cos, sin = math.cos(yaw), math.sin(yaw)
    return tuple((x * cos - y * sin, x * sin + y * cos) for x, y in points)


def nearest_free(wanted: Place, others: Sequence[Place], own: Sequence[Place] = ((0.0, 0.0),)) -> Place:
    """The place nearest to `wanted` where a thing may lie: on the table, `CLEARANCE` from all `others`.

    `own` are points of the thing relative to its place (a long tool has several). Sideways goes before
    nearer or farther: that keeps a thing within reach. `wanted` itself if the table is full.
    """
    grid = [0.02 * n for n in range(-24, 25)]
    offsets = sorted(itertools.product(grid, repeat=2), key=lambda d: (math.hypot(*d), abs(d[0]), d))
    for dx, dy in offsets:
        place = (wanted[0] + dx, wanted[1] + dy)
        points = [(place[0] + x, place[1] + y) for x, y in own]
        if on_table(place) and all(math.dist(p, other) >= CLEARANCE for p in points for other in others):
            return place
    return wanted
