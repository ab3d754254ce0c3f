"""Things that no domain knows, made at random: what a recogniser must call unknown.

Those to learn from and those to test with share neither kinds of shape nor hues, so that a recogniser
cannot have learnt a stranger by heart.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from cognitive_arch.domain import Domain, ObjectSpec
from cognitive_arch.shapes import Shape as DomainShape
from sim.scenario import drake_shape, solid_parts

Color = tuple[float, float, float]
TEST_HUES = ((0.44, 0.56), (0.74, 0.90))  # cyan and violet: never learnt from
OTHER_COLOR = 0.08  # chromaticity (share of red, of green) by which a colour is another one
TRIES = 1000


@dataclass(frozen=True)
class Thing:
    """Something to look at: solids in its frame, metres, and one colour, 0..1; its frame's origin is
    `height` / 2 above its underside."""

    parts: tuple[tuple[RigidTransform, Shape], ...]
    color: Color
    height: float


def known_thing(spec: ObjectSpec) -> Thing:
    """An object of a domain."""
    return Thing(_parts(spec.shape), spec.color, spec.shape.height)


def _parts(shape: DomainShape) -> tuple[tuple[RigidTransform, Shape], ...]:
    return tuple((part.X_OP, drake_shape(part.solid)) for part in solid_parts(shape))


def chromaticity(color: Color) -> np.ndarray:
    """Shares of red and green in the whole, (2,)."""
    return np.array(color[:2]) / max(sum(color), 1e-6)


def stranger(domain: Domain, rng: np.random.Generator, *, test: bool) -> Thing:
    """A thing of another colour than any in the domain, of another shape, or both.

    With `test` the shape is of a kind, or else the colour of a hue, that is otherwise never made.
    """
    specs = [domain.objects[name] for name in sorted(domain.objects)]
    # Shapes are harder to learn than colours: most to learn from have a colour of the domain.
    kind = rng.integers(3) if test else rng.choice(3, p=(0.2, 0.65, 0.15))
    spec = specs[rng.integers(len(specs))]
    if kind == 0:
        return Thing(_parts(spec.shape), _other_color(specs, rng, test), spec.shape.height)
    parts, height = _other_shape(specs, spec if kind == 1 else None, rng, test)
    if kind == 1:
        faded = np.clip(np.array(spec.color) * rng.uniform(0.9, 1.1), 0, 1)
        return Thing(parts, (float(faded[0]), float(faded[1]), float(faded[2])), height)
    return Thing(parts, _other_color(specs, rng, test), height)


def _other_color(specs: Sequence[ObjectSpec], rng: np.random.Generator, test: bool) -> Color:
    for _ in range(TRIES):
        color = colorsys.hsv_to_rgb(rng.uniform(), rng.uniform(0.0, 1.0), rng.uniform(0.25, 1.0))
        hue, saturation, _value = colorsys.rgb_to_hsv(*color)
        kept = saturation > 0.25 and any(low < hue < high for low, high in TEST_HUES)
        apart = min(float(np.linalg.norm(chromaticity(color) - chromaticity(spec.color))) for spec in specs)
        if kept == test and apart > OTHER_COLOR:
            return color
    raise AssertionError("some colour is always left")


Made = tuple[tuple[tuple[RigidTransform, Shape], ...], float]


def _other_shape(
    specs: Sequence[ObjectSpec], like: ObjectSpec | None, rng: np.random.Generator, test: bool
) -> Made:
    """Parts and height of another kind than the shape of `like`, or than none in particular."""
    kinds = dict(TEST_KINDS if test else LEARNT_KINDS)
    if like is not None:
        kinds.pop(like.shape.type, None)
    names = sorted(kinds)
    return kinds[names[rng.integers(len(names))]](rng)


def _cylinder(rng: np.random.Generator) -> Made:
    radius, height = rng.uniform(0.012, 0.045), rng.uniform(0.04, 0.12)
    return ((RigidTransform(), Cylinder(radius, height)),), height


def _box(rng: np.random.Generator) -> Made:
    x, y, z = rng.uniform(0.02, 0.09, 3)
    return ((RigidTransform(), Box(x, y, z)),), float(z)


def _ball(rng: np.random.Generator) -> Made:
    radius = rng.uniform(0.015, 0.045)
    return ((RigidTransform(), Sphere(radius)),), 2 * radius


def _plank(rng: np.random.Generator) -> Made:
    x, y, z = rng.uniform(0.10, 0.30), rng.uniform(0.03, 0.06), rng.uniform(0.01, 0.03)
    return ((RigidTransform(), Box(x, y, z)),), z


def _angle(rng: np.random.Generator) -> Made:
    long, short, wide = rng.uniform(0.06, 0.12), rng.uniform(0.04, 0.08), rng.uniform(0.012, 0.025)
    X_OS = RigidTransform([long / 2 - wide / 2, short / 2, 0])
    return ((RigidTransform(), Box(long, wide, wide)), (X_OS, Box(wide, short, wide))), wide


def _tower(rng: np.random.Generator) -> Made:
    wide, narrow, low, high = (
        rng.uniform(0.025, 0.045),
        rng.uniform(0.008, 0.018),
        rng.uniform(0.01, 0.03),
        rng.uniform(0.02, 0.06),
    )
    height = low + high
    X_OF = RigidTransform([0, 0, low / 2 - height / 2])
    X_OT = RigidTransform([0, 0, low + high / 2 - height / 2])
    return ((X_OF, Cylinder(wide, low)), (X_OT, Box(2 * narrow, 2 * narrow, high))), height


def _heap(rng: np.random.Generator) -> Made:
    """A few solids grown together anyhow."""
    height = rng.uniform(0.02, 0.06)
    parts = []
    for _ in range(rng.integers(2, 5)):
        a, b = rng.uniform(0.008, 0.04, 2)
        solid: Shape = (Box(2 * a, 2 * b, height), Cylinder(a, height), Sphere(a))[rng.integers(3)]
        X_OP = RigidTransform(RollPitchYaw(0, 0, rng.uniform(0, math.pi)), [*rng.normal(0, 0.025, 2), 0])
        parts.append((X_OP, solid))
    return tuple(parts), height


def _ramp(rng: np.random.Generator) -> Made:
    """A slanted board."""
    x, y, z = rng.uniform(0.04, 0.12), rng.uniform(0.02, 0.06), rng.uniform(0.008, 0.02)
    slant = rng.uniform(0.2, 0.9)
    return ((RigidTransform(RollPitchYaw(0, slant, 0), [0, 0, 0]), Box(x, y, z)),), x * math.sin(slant)


def _rod(rng: np.random.Generator) -> Made:
    radius, length = rng.uniform(0.006, 0.02), rng.uniform(0.06, 0.25)
    lying = RigidTransform(RollPitchYaw(0, math.pi / 2, 0), [0, 0, 0])
    return ((lying, Cylinder(radius, length)),), 2 * radius


def _star(rng: np.random.Generator) -> Made:
    """Three, five or six arms; four would be a cross."""
    arms = (3, 5, 6)[rng.integers(3)]
    long, wide, high = rng.uniform(0.025, 0.06), rng.uniform(0.010, 0.024), rng.uniform(0.008, 0.03)
    parts = []
    for turn in np.arange(arms) * 2 * math.pi / arms:
        place = [long / 2 * math.cos(turn), long / 2 * math.sin(turn), 0]
        parts.append((RigidTransform(RollPitchYaw(0, 0, turn), place), Box(long, wide, high)))
    return tuple(parts), high


def _bracket(rng: np.random.Generator) -> Made:
    """A bar with another one or two standing off it: T, U, or in between."""
    long, short, wide = rng.uniform(0.05, 0.11), rng.uniform(0.02, 0.07), rng.uniform(0.010, 0.022)
    high = rng.uniform(0.01, 0.025)
    parts = [(RigidTransform(), Box(long, wide, high))]
    for place in rng.uniform(-0.5, 0.5, rng.integers(1, 3)):
        X_OS = RigidTransform([place * (long - wide), (wide + short) / 2, 0])
        parts.append((X_OS, Box(wide, short, high)))
    return tuple(parts), high


def _chain(rng: np.random.Generator) -> Made:
    """Three or four balls in a bent row."""
    radius, turn = rng.uniform(0.010, 0.022), 0.0
    place, parts = np.zeros(3), []
    for _ in range(rng.integers(3, 5)):
        parts.append((RigidTransform(place), Sphere(radius)))
        turn += rng.normal(0, 0.5)
        place = place + radius * rng.uniform(1.1, 2.0) * np.array([math.cos(turn), math.sin(turn), 0])
    middle = place / 2
    return tuple((RigidTransform(X_OP.translation() - middle), solid) for X_OP, solid in parts), 2 * radius


def _pebble(rng: np.random.Generator) -> Made:
    """Flat and round from above."""
    a = rng.uniform(0.018, 0.045)
    b, c = a * rng.uniform(0.75, 1.0), a * rng.uniform(0.25, 0.65)
    return ((RigidTransform(), Ellipsoid(a, b, c)),), 2 * c


def _cone(rng: np.random.Generator) -> Made:
    """A staircase of discs that get smaller upwards."""
    radius, height = rng.uniform(0.022, 0.045), rng.uniform(0.02, 0.07)
    steps = int(rng.integers(3, 7))
    point = rng.uniform(0.1, 0.5)
    step = height / steps
    sizes = radius * np.linspace(1, point, steps)
    parts = [
        (RigidTransform([0, 0, (n + 0.5) * step - height / 2]), Cylinder(float(size), step))
        for n, size in enumerate(sizes)
    ]
    return tuple(parts), height


def _prism(rng: np.random.Generator) -> Made:
    """With six or eight corners."""
    count = int(rng.integers(2, 4))
    size, height = rng.uniform(0.03, 0.08), rng.uniform(0.008, 0.06)
    solid = Box(size, size if count == 2 else size / math.sqrt(3), height)
    turns = np.arange(count) * math.pi / (4 if count == 2 else 3)
    return tuple((RigidTransform(RollPitchYaw(0, 0, turn), [0, 0, 0]), solid) for turn in turns), height


def _mushroom(rng: np.random.Generator) -> Made:
    """A round head on a foot."""
    head, foot, high = rng.uniform(0.016, 0.035), rng.uniform(0.008, 0.03), rng.uniform(0.01, 0.04)
    flat = head * rng.uniform(0.6, 1.0)
    height = high + flat
    X_OF = RigidTransform([0, 0, high / 2 - height / 2])
    X_OH = RigidTransform([0, 0, high - height / 2])
    return ((X_OF, Cylinder(foot, high)), (X_OH, Ellipsoid(head, head, flat))), height


def _egg(rng: np.random.Generator) -> Made:
    a, b, c = rng.uniform(0.03, 0.06), rng.uniform(0.012, 0.025), rng.uniform(0.012, 0.025)
    return ((RigidTransform(), Ellipsoid(a, b, c)),), 2 * c


def _sausage(rng: np.random.Generator) -> Made:
    radius, length = rng.uniform(0.010, 0.022), rng.uniform(0.06, 0.14)
    lying = RigidTransform(RollPitchYaw(0, math.pi / 2, 0), [0, 0, 0])
    return ((lying, Capsule(radius, length)),), 2 * radius


def _cross(rng: np.random.Generator) -> Made:
    long, wide, high = rng.uniform(0.06, 0.12), rng.uniform(0.012, 0.022), rng.uniform(0.01, 0.02)
    return (
        (RigidTransform(), Box(long, wide, high)),
        (RigidTransform(), Box(wide, long, high)),
    ), high


def _dumbbell(rng: np.random.Generator) -> Made:
    radius, apart = rng.uniform(0.016, 0.028), rng.uniform(0.05, 0.10)
    return (
        (RigidTransform([-apart / 2, 0, 0]), Sphere(radius)),
        (RigidTransform([apart / 2, 0, 0]), Sphere(radius)),
        (RigidTransform(), Box(apart, radius, radius)),
    ), 2 * radius


# Under the names of domains' shapes where they are of that type: those are not other than it.
LEARNT_KINDS: dict[str, Callable[[np.random.Generator], Made]] = {
    "angle": _angle,
    "box": _box,
    "bracket": _bracket,
    "chain": _chain,
    "cone": _cone,
    "cylinder": _cylinder,
    "heap": _heap,
    "mushroom": _mushroom,
    "pebble": _pebble,
    "plank": _plank,
    "prism": _prism,
    "ramp": _ramp,
    "rod": _rod,
    "sphere": _ball,
    "star": _star,
    "tower": _tower,
}
TEST_KINDS: dict[str, Callable[[np.random.Generator], Made]] = {
    "cross": _cross,
    "dumbbell": _dumbbell,
    "egg": _egg,
    "sausage": _sausage,
}
