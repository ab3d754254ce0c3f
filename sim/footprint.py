"""What objects, tools and fingers cover of the table, by their poses in the simulator."""

from __future__ import annotations

import math

from pydrake.math import RigidTransform

from cognitive_arch import footprint as flat
from cognitive_arch.footprint import Capsule, Point, disc, gap, outer_radius, smallest_gap, tool_footprint
from cognitive_arch.shapes import Box, Shape
from sim.scenario import TABLE_CENTRE_X, TABLE_SIZE

__all__ = [
    "Capsule",
    "Point",
    "disc",
    "footprint",
    "gap",
    "outer_radius",
    "slab",
    "smallest_gap",
    "tool_footprint",
]


def footprint(shape: Shape, X_WO: RigidTransform) -> tuple[Capsule, ...]:
    """What an object that lies flat at `X_WO` covers."""
    x, y, _ = X_WO.translation()
    return flat.footprint(shape, (float(x), float(y)), float(X_WO.rotation().ToRollPitchYaw().yaw_angle()))


def slab(shape: Box, X_WO: RigidTransform) -> tuple[Capsule, ...]:
    """What a box covers that stands upright at `X_WO`: less than the circle around it, if it is long."""
    x, y, _ = X_WO.translation()
    along = X_WO.rotation().matrix()[:2, int(shape.size[1] > shape.size[0])]
    long, wide = max(shape.extent), min(shape.extent)
    dx, dy = ((long - wide) / 2 * along).tolist()
    return (Capsule((float(x) + dx, float(y) + dy), (float(x) - dx, float(y) - dy), wide / math.sqrt(2)),)


def on_table(capsule: Capsule, rim: float = 0.0) -> bool:
    """Whether all of it is on the table, at least `rim` metres from the edge."""
    inside = capsule.radius + rim
    return all(
        abs(x - TABLE_CENTRE_X) <= TABLE_SIZE[0] / 2 - inside and abs(y) <= TABLE_SIZE[1] / 2 - inside
        for x, y in (capsule.a, capsule.b)
    )
