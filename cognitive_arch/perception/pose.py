"""Where a thing of known shape lies, from the places of its visible points.

What stands on its flat underside is found by its outline as seen from above: walls and the rim of the upper
face lie on it. What is made of balls is found by its surface. Edges at which something nearer begins say
nothing about a thing and are to be left out, so that one that is partly covered is found as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.shapes import Box, Compound, Cylinder, Shape, Sphere, ToolShape

Points = NDArray[np.float64]
Distance = Callable[[Points], NDArray[np.float64]]  # (n, 2) or (n, 3) places, m, to signed distances, m
Bare = Callable[[Points], NDArray[np.bool_]]  # (n, 3) places, m, to whether one sees that nothing is there

BAND = 0.003  # m below the highest points that still belong to the upper face
HIGHEST = 97.0  # percentile of heights that counts as the highest
STEPS, SETTLED = 12, 1e-6  # of Gauss and Newton; m or rad
OUTLIER = 0.003  # m from where on a point counts less (Huber)
MOST = 240  # points that are looked at
LEAST = 12  # points without which nothing can be said
FLOOR = 0.0008  # m, the best that an estimate is believed to be
UNSEEN = 0.012  # m of uncertainty of a thing of which nothing is seen
DOUBTFUL = 0.1  # of a thing nowhere where something is seen, above which other poses are tried
ROUNDS = 3
SHIFTS = [np.array([x, y, 0.0]) for x in (-0.02, 0.0, 0.02) for y in (-0.02, 0.0, 0.02) if x or y]  # m
AMISS = 0.02  # m of residual of a thing that is nowhere where something is seen


@dataclass(frozen=True, slots=True)
class PoseEstimate:
    """`position` (3,) of the thing's frame, m, `yaw` in rad, `sigma` the standard deviation in x and in y,
    m, `residual` how far off its points are, m (root mean square), `seen` the part of it that is in view."""

    position: NDArray[np.float64]
    yaw: float
    sigma: float
    residual: float
    seen: float

    def matrix(self) -> NDArray[np.float64]:
        """X_WO, (4, 4): it stands upright."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        X_WO = np.eye(4)
        X_WO[:2, :2] = ((c, -s), (s, c))
        X_WO[:3, 3] = self.position
        return X_WO


def estimate_pose(
    shape: Shape, surface: Points, outline: Points, bare: Bare | None = None
) -> PoseEstimate | None:
    """Where a standing thing of `shape` is.

    `surface` (n, 3) are places of all its visible points, `outline` (m, 3) of those at its own edges, metres.
    `bare` tells of places where one sees what is behind them: a thing that is half in view does not lie so
    that the other half should be seen. None where there are too few points.
    """
    if len(surface) < LEAST or (len(outline) < LEAST and not _is_ball(shape)):
        return None
    highest = float(np.percentile(surface[:, 2], HIGHEST))
    top = float(np.median(surface[surface[:, 2] > highest - BAND, 2]))
    if _is_ball(shape):
        return _by_surface(shape, _some(surface), float(surface[:, 2].max()))
    return _by_outline(shape, surface, _some(outline)[:, :2], top, bare)


def _is_ball(shape: Shape) -> bool:
    return isinstance(shape, Sphere) or (isinstance(shape, Compound) and shape.rolls and shape.is_round)


def _some(points: Points) -> Points:
    """At most `MOST` of them, evenly chosen."""
    if len(points) <= MOST:
        return np.asarray(points, dtype=np.float64)
    return np.asarray(points[np.linspace(0, len(points) - 1, MOST).astype(int)], dtype=np.float64)


# -- by the outline -----------------------------------------------------------------------------------


def _by_outline(
    shape: Shape, surface: Points, edge: Points, top: float, bare: Bare | None
) -> PoseEstimate | None:
    distance, inside = outline_distance(shape), _cells(shape)
    covered = surface[:, :2]

    def fitted(start: NDArray[np.float64]) -> tuple[float, float, NDArray[np.float64]]:
        """How far off in all, how much of it is amiss, and where."""
        pose = _fit(distance, edge, start, turns=not shape.is_round)
        outside = float(np.mean(distance(_local(covered, pose)) > 2 * OUTLIER))
        seen_past = bare(_placed(inside, pose, top)) if bare is not None else np.zeros(0)
        missing = float(np.mean(seen_past)) if len(seen_past) else 0.0
        off = math.hypot(_rms(distance(_local(edge, pose))), AMISS * outside, AMISS * missing)
        return off, max(outside, missing), pose

    best = min((fitted(start) for start in _starts(shape, covered, edge)), key=_off)
    if isinstance(shape, ToolShape) and shape.bar > 0 and best[1] > DOUBTFUL:
        # Where a corner is in view, the smallest rectangle around it lies as bar and shaft do.
        yaw = math.radians(cv2.minAreaRect(covered.astype(np.float32))[2])
        starts = [s for turn in (0.0, math.pi / 2) for s in _tool_starts(shape, covered, yaw + turn)]
        best = min([best, *map(fitted, starts)], key=_off)
        for _ in range(ROUNDS):
            if best[1] <= DOUBTFUL:
                break
            best = min([best, *(fitted(best[2] + shift) for shift in SHIFTS)], key=_off)
    rms, _, (x, y, yaw) = best
    position = np.array([x, y, top - shape.height / 2])
    seen = _seen(shape, inside, _local(covered, best[2]))
    return PoseEstimate(position, _wrapped(shape, yaw), FLOOR + rms / 2 + UNSEEN * (1 - seen), rms, seen)


def _off(found: tuple[float, float, NDArray[np.float64]]) -> float:
    return found[0]


def _placed(local: Points, pose: NDArray[np.float64], height: float) -> Points:
    """Places (n, 3) on the upper side of a thing, from those in its own frame (n, 2)."""
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    columns = (x + c * local[:, 0] - s * local[:, 1], y + s * local[:, 0] + c * local[:, 1])
    return np.column_stack([*columns, np.full(len(local), height)])


def _local(points: Points, pose: NDArray[np.float64]) -> Points:
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = points[:, 0] - x, points[:, 1] - y
    return np.column_stack([c * dx + s * dy, c * dy - s * dx])


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.minimum(np.square(values), (3 * OUTLIER) ** 2))))


def _fit(distance: Distance, edge: Points, start: NDArray[np.float64], turns: bool) -> NDArray[np.float64]:
    """Gauss and Newton's iteration over x, y and perhaps yaw; far-off points count less."""
    pose = start.copy()
    steps = np.array([1e-5, 1e-5, 1e-4])
    free = 3 if turns else 2
    for _ in range(STEPS):
        error = distance(_local(edge, pose))
        slope = np.empty((len(edge), free))
        for axis in range(free):
            ahead = pose.copy()
            ahead[axis] += steps[axis]
            slope[:, axis] = (distance(_local(edge, ahead)) - error) / steps[axis]
        weight = np.minimum(1.0, OUTLIER / np.maximum(np.abs(error), 1e-9))
        normal = slope.T @ (slope * weight[:, None]) + np.diag([1e-6, 1e-6, 1e-9][:free])
        change = np.linalg.solve(normal, slope.T @ (weight * error))
        change = np.clip(change, -0.03, 0.03) if free == 2 else np.clip(change, -0.03, [0.03, 0.03, 0.3])
        pose[:free] -= change
        if float(np.abs(change).max()) < SETTLED:
            break
    return pose


def _starts(shape: Shape, covered: Points, edge: Points) -> list[NDArray[np.float64]]:
    """Where to begin: the middle of what is seen, in every direction that it might have."""
    low, high = edge.min(axis=0), edge.max(axis=0)
    middle = (low + high) / 2
    if shape.is_round:
        return [np.array([*middle, 0.0])]
    spread = covered - covered.mean(axis=0)
    along = np.linalg.eigh(spread.T @ spread)[1][:, 1]
    yaw = math.atan2(along[1], along[0])
    if isinstance(shape, ToolShape):
        return _tool_starts(shape, covered, yaw)
    turns = (0.0, math.pi / 2, math.pi / 4, -math.pi / 4)
    return [np.array([*middle, yaw + turn]) for turn in turns]


def _tool_starts(shape: ToolShape, covered: Points, yaw: float) -> list[NDArray[np.float64]]:
    """With the bar at either end, both ends of the shaft where something is seen."""
    along = np.array([math.cos(yaw), math.sin(yaw)])
    across = np.array([-along[1], along[0]])
    places, sideways = covered @ along, covered @ across
    starts = []
    for end in (places.min() + shape.length / 2, places.max() - shape.length / 2):
        for turn in (0.0, math.pi) if shape.bar > 0 else (0.0,):
            starts.append(np.array([*(end * along + np.median(sideways) * across), yaw + turn]))
    return starts


def _wrapped(shape: Shape, yaw: float) -> float:
    """The same for all yaws that look alike."""
    if shape.is_round:
        return 0.0
    turn = 2 * math.pi
    if isinstance(shape, Box) or (isinstance(shape, ToolShape) and shape.bar <= 0):
        turn = math.pi
    if isinstance(shape, Box) and abs(shape.size[0] - shape.size[1]) < 1e-6:
        turn = math.pi / 2
    return (yaw + turn / 2) % turn - turn / 2


def _cell(shape: Shape) -> float:
    slim = shape.width if isinstance(shape, ToolShape) else min(shape.extent) / 2
    return max(0.005, slim / 3)


def _cells(shape: Shape) -> Points:
    """The middles (n, 2) of the cells inside of the outline, in the thing's frame, metres."""
    cell = _cell(shape)
    x, y = (np.arange(-side / 2 + cell / 2, side / 2, cell) for side in shape.extent)
    grid = np.array(np.meshgrid(x, y)).reshape(2, -1).T
    return np.asarray(grid[outline_distance(shape)(grid) < -cell / 4])


def _seen(shape: Shape, inside: Points, local: Points) -> float:
    """The part of the cells `inside` in which some point is seen."""
    if not len(inside):
        return 1.0
    cell = _cell(shape)

    def cells(places: Points) -> NDArray[np.int64]:
        column, row = np.floor((places + np.array(shape.extent) / 2) / cell).astype(np.int64).T
        return column * 100_003 + row

    return float(np.isin(cells(inside), cells(local)).mean())


def outline_distance(shape: Shape) -> Distance:
    """Signed distance (m) from a shape's outline as seen from above, negative inside, in its own frame."""
    if isinstance(shape, Cylinder | Sphere):
        return _disc(shape.radius)
    if isinstance(shape, Box):
        return _rectangle((0.0, 0.0), shape.size[0], shape.size[1])
    if isinstance(shape, ToolShape):
        shaft = _rectangle((0.0, 0.0), shape.length, shape.width)
        if shape.bar <= 0:
            return shaft
        head = _rectangle((-shape.length / 2 + shape.width / 2, shape.offset), shape.width, shape.bar)
        return lambda p: np.minimum(shaft(p), head(p))
    parts = [_part_distance(part.solid, part.place) for part in shape.parts]
    return lambda p: np.min([part(p) for part in parts], axis=0)


def _part_distance(solid: Cylinder | Box | Sphere, place: tuple[float, float]) -> Distance:
    if isinstance(solid, Box):
        return _rectangle(place, solid.size[0], solid.size[1])
    disc = _disc(solid.radius)
    return lambda p: disc(p - np.array(place))


def _disc(radius: float) -> Distance:
    return lambda p: np.hypot(p[:, 0], p[:, 1]) - radius


def _rectangle(place: tuple[float, float], length: float, width: float) -> Distance:
    half, middle = np.array([length / 2, width / 2]), np.array(place)

    def distance(p: Points) -> NDArray[np.float64]:
        beyond = np.abs(p - middle) - half
        outside = np.hypot(np.maximum(beyond[:, 0], 0.0), np.maximum(beyond[:, 1], 0.0))
        inside: NDArray[np.float64] = outside + np.minimum(beyond.max(axis=1), 0.0)
        return inside

    return distance


# -- by the surface -----------------------------------------------------------------------------------


def _by_surface(shape: Shape, surface: Points, top: float) -> PoseEstimate | None:
    """A thing made of balls above each other: all that is seen lies on one of them."""
    balls = [(0.0, shape.radius)] if isinstance(shape, Sphere) else _balls(shape)
    place = np.array([*np.median(surface[:, :2], axis=0), top - shape.height / 2])
    for _ in range(STEPS):
        away = surface - place
        lengths = [np.linalg.norm(away - np.array([0.0, 0.0, z]), axis=1) for z, _ in balls]
        nearest = np.argmin([length - r for length, (_, r) in zip(lengths, balls, strict=True)], axis=0)
        rows = np.arange(len(surface))
        centre = np.array([z for z, _ in balls])[nearest]
        radius = np.array([r for _, r in balls])[nearest]
        length = np.array(lengths)[nearest, rows]
        error = length - radius
        slope = -(away - np.column_stack([np.zeros((len(surface), 2)), centre])) / length[:, None]
        weight = np.minimum(1.0, OUTLIER / np.maximum(np.abs(error), 1e-9))
        normal = slope.T @ (slope * weight[:, None]) + 1e-6 * np.eye(3)
        change = np.clip(np.linalg.solve(normal, slope.T @ (weight * error)), -0.02, 0.02)
        place = place - change
        if float(np.abs(change).max()) < SETTLED:
            break
    rms = _rms(error)
    # A camera never sees more than half of a ball.
    seen = min(1.0, 2 * _seen(shape, _cells(shape), surface[:, :2] - place[:2]))
    return PoseEstimate(place, 0.0, FLOOR + rms / 2 + UNSEEN * (1 - seen), rms, seen)


def _balls(shape: Shape) -> list[tuple[float, float]]:
    """Heights (from the middle) and radii of a compound's balls."""
    assert isinstance(shape, Compound)
    return [
        (part.above + part.solid.radius - shape.height / 2, part.solid.radius)
        for part in shape.parts
        if isinstance(part.solid, Sphere)
    ]
