"""What objects, tools and fingers cover of the table, by their poses in the simulator."""

from __future__ import annotations

from pydrake.math import RigidTransform

from cognitive_arch import footprint as flat
from cognitive_arch.footprint import Capsule, Point, disc, gap, outer_radius, smallest_gap, tool_footprint
from cognitive_arch.shapes import Shape

__all__ = ["Capsule", "Point", "disc", "footprint", "gap", "outer_radius", "smallest_gap", "tool_footprint"]


def footprint(shape: Shape, X_WO: RigidTransform) -> tuple[Capsule, ...]:
    """What an object that lies flat at `X_WO` covers."""
    x, y, _ = X_WO.translation()
    return flat.footprint(shape, (float(x), float(y)), float(X_WO.rotation().ToRollPitchYaw().yaw_angle()))
