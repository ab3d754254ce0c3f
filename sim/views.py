"""Rendered views of a domain's objects, and of strangers, to learn to recognise them from.

Single things and clutter, flat, stacked, held up and fallen over, under lights of many kinds and from the
distances the eyes have. Which pixels show what is read from the renderer: this is how examples are made,
no part of how the robot sees.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from cognitive_arch.domain import Domain
from cognitive_arch.perception.camera import Camera
from cognitive_arch.perception.recognition import UNKNOWN
from sim.eyes import EYE_SIZE, EYE_VIEW
from sim.rendering import ROOM, Light, Renderer, look_from
from sim.strangers import Thing, known_thing, stranger

TABLE = (0.62, 0.50, 0.38)
TABLE_TOP = -0.096  # m
PLACES_X, PLACES_Y = (-0.80, -0.22), (-0.34, 0.34)  # m
APART = 0.085  # m between the middles of things beside each other
STRANGERS = 8  # in every room
VIEWS_PER_ROOM = 5  # to test with
VIEWS_TO_LEARN = 2  # in a room: few, so that there are many strangers
AWAY = RigidTransform([0.0, 0.0, -9.0])
MIN_PIXELS = 60
MARGIN = 3  # pixels around a thing that are kept of the picture
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2


@dataclass(frozen=True, eq=False)
class Example:
    """One thing as it is seen: the part of the picture with it (height, width, 3) uint8 RGB, which pixels
    show it, what it is (`unknown` for strangers), and how much of it is in view, about, 0..1."""

    image: NDArray[np.uint8]
    mask: NDArray[np.bool_]
    name: str
    visible: float


class _Room:
    """A table and things under lights that stay; what lies where is told for every picture."""

    def __init__(self, things: Mapping[str, Thing], rng: np.random.Generator) -> None:
        self.things = things
        builder = DiagramBuilder()
        self.plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0)
        self.bodies = {}
        inertia = SpatialInertia.SolidCubeWithDensity(1000, 0.05)
        for name, thing in things.items():
            body = self.plant.AddRigidBody(name, self.plant.AddModelInstance(name), inertia)
            for n, (X_OP, shape) in enumerate(thing.parts):
                color = [*thing.color, 1.0]
                self.plant.RegisterVisualGeometry(body, X_OP, shape, f"{name}_{n}", color)
            self.bodies[name] = body
        X_WT = RigidTransform([-0.50, 0, TABLE_TOP - 0.02])
        tone = rng.uniform(0.1, 1.0, 3) if rng.uniform() < 0.3 else np.array(TABLE) * rng.uniform(0.8, 1.2)
        table = [*np.clip(tone, 0, 1), 1.0]
        self.plant.RegisterVisualGeometry(
            self.plant.world_body(), X_WT, Box(0.7, 0.9, 0.04), "table", np.array(table)
        )
        self.plant.Finalize()
        self.renderer = Renderer(graph, random_lights(rng), shadows=bool(rng.uniform() < 0.3))
        self._diagram = builder.Build()
        self.context = self._diagram.CreateDefaultContext()
        self._plant_context = self.plant.GetMyMutableContextFromRoot(self.context)

    def arrange(self, poses: Mapping[str, RigidTransform]) -> None:
        """Everything where it is to be; what has no pose is out of sight."""
        for name, body in self.bodies.items():
            self.plant.SetFreeBodyPose(self._plant_context, body, poses.get(name, AWAY))


def random_lights(rng: np.random.Generator) -> list[Light]:
    """The room's lights, each turned, brighter or darker, and a little yellowish or bluish."""
    bright = rng.uniform(0.75, 1.15)
    lights = []
    for light in ROOM:
        turned = np.array(light.direction) + rng.normal(0, 0.25, 3)
        turned[2] = min(turned[2], -0.1)
        red, green, blue = 1.0 + rng.uniform(-0.05, 0.0, 3)
        strength = float(light.intensity * bright * rng.uniform(0.75, 1.25))
        direction = (float(turned[0]), float(turned[1]), float(turned[2]))
        lights.append(Light(direction, strength, (red, green, blue)))
    return lights


def random_camera(rng: np.random.Generator) -> Camera:
    """Mostly about where the robot's eyes are, sometimes closer to something."""
    if rng.uniform() < 0.7:
        place = np.array([-0.20, 0.0, 0.32]) + rng.normal(0, [0.04, 0.03, 0.03])
        target = np.array([-0.46, 0.0, -0.10]) + rng.normal(0, [0.05, 0.05, 0.01])
    else:
        target = np.array([rng.uniform(*PLACES_X), rng.uniform(*PLACES_Y), -0.09])
        away, height, turn = rng.uniform(0.25, 0.55), rng.uniform(0.5, 1.45), rng.normal(0, 0.5)
        sideways = away * math.cos(height)
        place = target + np.array(
            [
                sideways * math.cos(turn),
                sideways * math.sin(turn),
                away * math.sin(height),
            ]
        )
    return Camera.with_view(EYE_SIZE, EYE_VIEW, look_from(list(place), list(target)).GetAsMatrix4())


def random_poses(things: Mapping[str, Thing], rng: np.random.Generator) -> dict[str, RigidTransform]:
    """Where things are: side by side, some on top of each other, some in the air or fallen over."""
    names = [str(name) for name in rng.permutation(sorted(things))]
    poses: dict[str, RigidTransform] = {}
    free: list[tuple[float, float]] = []
    while names:
        place = (rng.uniform(*PLACES_X), rng.uniform(*PLACES_Y))
        if any(math.dist(place, other) < APART for other in free):
            names.pop()  # the table is full: leave it out this time
            continue
        free.append(place)
        size = int(rng.integers(2, 6)) if rng.uniform() < 0.3 else 1
        bottom = TABLE_TOP + (rng.uniform(0.02, 0.22) if rng.uniform() < 0.15 else 0.0)
        for _ in range(min(size, len(names))):
            name = names.pop()
            height = things[name].height
            x, y = np.array(place) + (rng.normal(0, 0.006, 2) if size > 1 else 0.0)
            tilt = rng.normal(0, 0.02, 2)
            if size == 1 and rng.uniform() < 0.10:
                tilt = rng.uniform(-math.pi, math.pi, 2)
                bottom += 0.02
            turned = RollPitchYaw(tilt[0], tilt[1], rng.uniform(-math.pi, math.pi))
            poses[name] = RigidTransform(RotationMatrix(turned), [x, y, bottom + height / 2])
            bottom += height
    return poses


def examples(
    domain: Domain, views: int, rng: np.random.Generator, *, test: bool = False
) -> Iterator[Example]:
    """Every thing in `views` pictures; with `test` strangers of kinds and hues that are not learnt from."""
    room, per_room = None, VIEWS_PER_ROOM if test else VIEWS_TO_LEARN
    for view in range(views):
        if view % per_room == 0 or room is None:
            things = {name: known_thing(spec) for name, spec in sorted(domain.objects.items())}
            things |= {f"{UNKNOWN}_{n}": stranger(domain, rng, test=test) for n in range(STRANGERS)}
            room = _Room(things, rng)
        yield from _look(room, random_camera(rng), random_poses(room.things, rng))


def _look(room: _Room, camera: Camera, poses: Mapping[str, RigidTransform]) -> Iterator[Example]:
    room.arrange(poses)
    image = room.renderer.color(room.context, camera)
    labels = room.renderer.labels(room.context, camera)
    for name in poses:
        mask = (labels == int(room.bodies[name].index())).astype(np.uint8)
        left, top, width, height = cv2.boundingRect(mask)
        pixels = int(np.count_nonzero(mask))
        if pixels < MIN_PIXELS:
            continue
        visible = min(1.0, pixels / max(_whole(room.things[name], poses[name], camera), 1.0))
        rows = slice(max(0, top - MARGIN), top + height + MARGIN)
        columns = slice(max(0, left - MARGIN), left + width + MARGIN)
        told = UNKNOWN if name.startswith(UNKNOWN) else name
        yield Example(image[rows, columns].copy(), mask[rows, columns].astype(bool), told, visible)


def _whole(thing: Thing, X_WO: RigidTransform, camera: Camera) -> float:
    """About how many pixels a thing covers that nothing hides: the outlines of its parts, filled."""
    covered = np.zeros((camera.size[1], camera.size[0]), np.uint8)
    for X_OP, shape in thing.parts:
        corners = camera.project((X_WO @ X_OP @ _surface(shape).T).T)
        if not np.isfinite(corners).all():
            return math.inf
        # What is outside of the picture counts as hidden.
        left, top, width, height = cv2.boundingRect(np.rint(corners).astype(np.int32))
        if left < 0 or top < 0 or left + width > camera.size[0] or top + height > camera.size[1]:
            return math.inf
        cv2.fillConvexPoly(covered, cv2.convexHull(np.rint(corners).astype(np.int32)), 1)
    return float(np.count_nonzero(covered))


def _surface(shape: Shape) -> NDArray[np.float64]:
    """Points (n, 3) whose hull is about the shape."""
    if isinstance(shape, Box):
        return CORNERS * np.array(shape.size())
    turns = np.linspace(0, 2 * math.pi, 24, endpoint=False)
    ring = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(24)])
    up = np.array([0.0, 0.0, 1.0])
    ball = np.vstack([ring * math.cos(a) + up * math.sin(a) for a in np.linspace(-1.5, 1.5, 9)])
    if isinstance(shape, Sphere):
        return ball * shape.radius()
    if isinstance(shape, Ellipsoid):
        return ball * np.array([shape.a(), shape.b(), shape.c()])
    assert isinstance(shape, Cylinder | Capsule)
    rim = (ring if isinstance(shape, Cylinder) else ball) * shape.radius()
    half = up * shape.length() / 2
    return np.vstack([rim + half, rim - half])
