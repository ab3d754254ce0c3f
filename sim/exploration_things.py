"""What the robot explores with and on: a family of tools, postures of its hands, objects of eight forms.

The tools are sticks, rakes (a bar across), and hooks (the bar on one side), in several sizes, so that what is
learnt can be of their shapes. The objects follow thesis Fig. 45: seven forms in three sizes, so that it can
be learnt what sizes do; the eighth, in one size, is for testing what was learnt from the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from cognitive_arch.affordances.explored import HELD_OUT
from cognitive_arch.domain import Domain, ObjectSpec
from cognitive_arch.shapes import Box, Compound, Cylinder, Part, Shape, Solid, Sphere, ToolShape

TOOL_COLOR, OBJECT_COLOR = (0.50, 0.30, 0.10), (0.20, 0.45, 0.75)
DENSITY = 350.0  # kg/m^3, hollow toys and light wood


def _tool(length: float, width: float, bar: float = 0.0, offset: float = 0.0) -> ToolShape:
    return ToolShape(type="tool", length=length, width=width, bar=bar, offset=offset)


def _hook(length: float, width: float, bar: float, side: int) -> ToolShape:
    """With a bar that begins at the shaft; `side` +1 is to the robot's right."""
    return _tool(length, width, bar, side * (bar - width) / 2)


TOOLS: Mapping[str, ToolShape] = {
    "Stick": _tool(0.34, 0.018),
    "Short-stick": _tool(0.26, 0.020),
    "Thick-stick": _tool(0.31, 0.030),
    "Rake": _tool(0.34, 0.018, 0.14),
    "Short-rake": _tool(0.26, 0.018, 0.11),
    "Wide-rake": _tool(0.32, 0.020, 0.20),
    "Small-rake": _tool(0.31, 0.018, 0.07),
    "Lopsided-rake": _tool(0.33, 0.018, 0.13, 0.030),
    "Hook-left": _hook(0.34, 0.018, 0.090, -1),
    "Hook-right": _hook(0.34, 0.018, 0.090, 1),
    "Short-hook": _hook(0.26, 0.020, 0.070, 1),
    "Long-hook": _hook(0.32, 0.018, 0.130, -1),
    "Nail": _hook(0.30, 0.018, 0.040, 1),
}


def _box(x: float, y: float, z: float) -> Box:
    return Box(type="box", size=(x, y, z))


def _cylinder(radius: float, height: float) -> Cylinder:
    return Cylinder(type="cylinder", radius=radius, height=height)


_PEAR = Compound(
    type="compound",
    parts=(
        Part(solid=Sphere(type="sphere", radius=0.030)),
        Part(solid=Sphere(type="sphere", radius=0.018), above=0.042),
    ),
)
_BRICK = Compound(
    type="compound",
    parts=(
        Part(solid=_box(0.064, 0.032, 0.024)),
        Part(solid=_cylinder(0.009, 0.006), place=(-0.016, 0.0), above=0.024),
        Part(solid=_cylinder(0.009, 0.006), place=(0.016, 0.0), above=0.024),
    ),
)
_FORMS: Mapping[str, Solid | Compound] = {
    "Ball": Sphere(type="sphere", radius=0.020),
    "Cube": _box(0.045, 0.045, 0.040),
    "Plate": _cylinder(0.046, 0.014),
    "Can": _cylinder(0.026, 0.060),
    "Brick": _BRICK,
    "Pear": _PEAR,
    "Plank": _box(0.110, 0.030, 0.020),
}
_SIZES: Mapping[str, float] = {"Small-": 0.75, "": 1.0, "Large-": 1.3}


def _scaled(form: Solid | Compound, factor: float) -> Solid | Compound:
    """The same form in another size."""
    if isinstance(form, Compound):
        parts = (
            Part(
                solid=_scaled_solid(part.solid, factor),
                place=(factor * part.place[0], factor * part.place[1]),
                above=factor * part.above,
            )
            for part in form.parts
        )
        return Compound(type="compound", parts=tuple(parts))
    return _scaled_solid(form, factor)


def _scaled_solid(solid: Solid, factor: float) -> Solid:
    if isinstance(solid, Sphere):
        return Sphere(type="sphere", radius=factor * solid.radius)
    if isinstance(solid, Cylinder):
        return _cylinder(factor * solid.radius, factor * solid.height)
    x, y, z = solid.size
    return _box(factor * x, factor * y, factor * z)


OBJECTS: Mapping[str, Shape] = {
    **{
        (size + form.lower() if size else form): _scaled(shape, factor)
        for form, shape in _FORMS.items()
        for size, factor in _SIZES.items()
    },
    HELD_OUT: _box(0.080, 0.055, 0.034),
}


def _volume(shape: Shape) -> float:
    """Cubic metres of a thing's parts, those that lie in each other counted twice."""
    if isinstance(shape, Compound):
        return sum(_volume(part.solid) for part in shape.parts)
    x, y = shape.extent
    if isinstance(shape, Sphere):
        return math.pi / 6 * x**3
    return x * y * shape.height * (math.pi / 4 if shape.is_round else 1.0)


def exploration_domain() -> Domain:
    """All of them as one domain; it has no rules and no scenes."""
    things = {
        name: ObjectSpec(kind="tool", shape=shape, mass=0.05, color=TOOL_COLOR)
        for name, shape in TOOLS.items()
    }
    things |= {
        name: ObjectSpec(shape=shape, mass=round(DENSITY * _volume(shape), 4), color=OBJECT_COLOR)
        for name, shape in OBJECTS.items()
    }
    return Domain(name="exploration", title="Finding out what tools and hands do", objects=things)
