"""What things cover of the table: capsules in the plane, and the gaps between them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from cognitive_arch.shapes import Shape, ToolShape

Point = tuple[float, float]


@dataclass(frozen=True)
class Capsule:
    """All points within `radius` of the segment from `a` to `b`, metres."""

    a: Point
    b: Point
    radius: float

    def moved(self, dx: float, dy: float) -> Capsule:
        """The capsule elsewhere, metres."""
        return Capsule((self.a[0] + dx, self.a[1] + dy), (self.b[0] + dx, self.b[1] + dy), self.radius)


def disc(centre: Point, radius: float) -> Capsule:
    """A capsule of no length."""
    return Capsule(centre, centre, radius)


def gap(first: Capsule, second: Capsule) -> float:
    """Free space between two capsules, metres; negative where they overlap."""
    return _distance(first, second) - first.radius - second.radius


def smallest_gap(some: Iterable[Capsule], others: Iterable[Capsule], default: float = 1.0) -> float:
    """The smallest gap between capsules of two groups, metres."""
    others = tuple(others)
    return min((gap(a, b) for a in some for b in others), default=default)


def footprint(shape: Shape, centre: Point, yaw: float = 0.0) -> tuple[Capsule, ...]:
    """What a thing covers that lies flat with its middle at `centre` (metres), turned by `yaw` (radians)."""
    if isinstance(shape, ToolShape):
        return tool_footprint(shape, centre, yaw)
    return (disc(centre, outer_radius(shape)),)


def outer_radius(shape: Shape) -> float:
    """Radius of the smallest circle about the middle that encloses the thing, metres."""
    x, y = shape.extent
    return x / 2 if shape.is_round else math.hypot(x, y) / 2


def tool_footprint(shape: ToolShape, centre: Point, yaw: float) -> tuple[Capsule, ...]:
    """What a level tool with its shaft's middle at `centre` (metres) and this yaw (radians) covers."""
    cos, sin = math.cos(yaw), math.sin(yaw)

    def at(along: float, across: float) -> Point:
        return (centre[0] + along * cos - across * sin, centre[1] + along * sin + across * cos)

    half, width = shape.length / 2, shape.width / 2
    shaft = Capsule(at(width - half, 0.0), at(half - width, 0.0), width)
    if shape.bar <= 0:
        return (shaft,)
    low, high = shape.sides
    return (shaft, Capsule(at(width - half, low + width), at(width - half, high - width), width))


def gets_behind(tool: ToolShape, shape: Shape) -> bool:
    """Whether the tool has a bar that gets behind the middle of a thing, the shaft beside it."""
    return max(abs(side) for side in tool.sides) >= tool.width / 2 + outer_radius(shape)


def _distance(first: Capsule, second: Capsule) -> float:
    a, b, c, d = first.a, first.b, second.a, second.b
    if _turn(a, b, c) * _turn(a, b, d) < 0 and _turn(c, d, a) * _turn(c, d, b) < 0:
        return 0.0
    return min(_to_segment(a, c, d), _to_segment(b, c, d), _to_segment(c, a, b), _to_segment(d, a, b))


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _to_segment(p: Point, a: Point, b: Point) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    along = 0.0 if square <= 0 else ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square
    along = min(1.0, max(0.0, along))
    return math.hypot(p[0] - a[0] - along * dx, p[1] - a[1] - along * dy)
