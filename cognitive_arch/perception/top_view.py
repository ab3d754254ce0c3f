"""Things as seen from straight above, always at the same scale, wherever the camera was.

A camera sees what lies on the table askew and in perspective, so that the descriptors of a blob change with
where it lies. Where depth tells how far away each pixel is, its place on the table is known, and the blob can
be drawn as from above: up in the picture is away from the robot (-x), right is the robot's right (+y). The
upper half of a tool whose handle points to the robot is its effector half then.
"""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.descriptors import Descriptions, describe
from cognitive_arch.shapes import Box, Compound, Cylinder, Shape, Sphere, ToolShape

Mask = NDArray[np.uint8]  # (h, w), 1 where the thing is

PIXEL = 0.001  # m per pixel
LARGEST = 2.0  # m; nothing on a table is larger
FINER = 3  # places for each of the camera's pixels, along rows and columns
GAP = 5  # pixels from above over which a thing is taken to go on
BORDER = 4  # pixels around the thing


def top_view(mask: NDArray[np.bool_], surface: NDArray[np.floating]) -> Mask:
    """A blob as seen from above, (h, w).

    `mask` (height, width) is true on the blob's pixels in the camera's image, `surface` (n, 3) are their
    places in the root frame, metres, in the order of the image's rows. Raises `PerceptionError` where they do
    not belong together, or for what is no blob of a thing on a table.
    """
    if mask.ndim != 2 or surface.shape != (int(mask.sum()), 3) or not len(surface):
        raise PerceptionError(f"a blob of {int(mask.sum())} pixels, and places of shape {surface.shape}")
    x, y, width, height = cv2.boundingRect(mask.view(np.uint8))
    places = np.full((height, width, 2), np.nan, np.float32)
    places[mask[y : y + height, x : x + width]] = surface[:, :2]
    # Between neighbours that both belong to the blob there is more of it; NaN keeps out what does not.
    finer = cv2.resize(places, (width * FINER, height * FINER), interpolation=cv2.INTER_LINEAR)
    points = np.vstack([finer[np.isfinite(finer).all(axis=2)], surface[:, :2]])
    low, high = points.min(axis=0), points.max(axis=0)
    if not np.isfinite(points).all() or (high - low).max() > LARGEST:
        raise PerceptionError("places of a blob that is larger than a table, or nowhere")
    rows, columns = np.rint((points - low) / PIXEL).astype(np.int64).T + BORDER
    seen = np.zeros((int(rows.max()) + BORDER + 1, int(columns.max()) + BORDER + 1), np.uint8)
    seen[rows, columns] = 1
    # Gaps are as wide as pixels lie apart, and corners that stick out of a straight edge are pixels, too.
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (GAP, GAP))
    smooth = cv2.medianBlur(cv2.morphologyEx(seen, cv2.MORPH_CLOSE, kernel), GAP)
    # The places are those of the middles of the camera's pixels, which reach half a pixel further.
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    return np.asarray(cv2.dilate(smooth, cross), np.uint8)


def silhouette(shape: Shape, yaw: float = 0.0) -> Mask:
    """A thing of known shape as seen from above, (h, w), turned by `yaw` radians; with 0 the handle of a tool
    points to the robot."""
    outlines = _outlines(shape)
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    turned = [outline @ turn for outline in outlines]
    low = np.vstack(turned).min(axis=0)
    high = np.vstack(turned).max(axis=0)
    size = np.ceil((high - low) / PIXEL).astype(int) + 2 * BORDER + 1
    seen = np.zeros((int(size[0]), int(size[1])), np.uint8)
    for outline in turned:
        corners = np.rint((outline - low) / PIXEL).astype(np.int32) + BORDER
        cv2.fillConvexPoly(seen, np.ascontiguousarray(corners[:, ::-1]), 1)
    return seen


Vectors = tuple[tuple[float, ...], tuple[float, ...]]


def vectors(found: Descriptions) -> Vectors:
    """Descriptors as the world state keeps them: of the whole; of the upper half, then of the lower."""
    whole, halves = (found.vector(parts).tolist() for parts in (("whole",), ("top", "bottom")))
    return tuple(whole), tuple(halves)


@lru_cache(maxsize=256)
def described(shape: Shape) -> Vectors:
    """The descriptors of a thing of known shape, seen from above with its handle to the robot."""
    return vectors(describe(silhouette(shape)))


Outline = NDArray[np.float64]  # (n, 2), corners of a convex area, x and y in metres


def _outlines(shape: Shape) -> list[Outline]:
    """Convex areas that a thing covers, in its own frame."""
    if isinstance(shape, ToolShape):
        parts = [_rectangle((0.0, 0.0), (shape.length, shape.width))]
        if shape.bar > 0:
            head = shape.width / 2 - shape.length / 2
            parts.append(_rectangle((head, shape.offset), (shape.width, shape.bar)))
        return parts
    if isinstance(shape, Compound):
        return [_of_solid(part.solid, part.place) for part in shape.parts]
    return [_of_solid(shape, (0.0, 0.0))]


def _of_solid(solid: Cylinder | Box | Sphere, place: tuple[float, float]) -> Outline:
    if isinstance(solid, Box):
        return _rectangle(place, solid.extent)
    angle = np.linspace(0.0, 2 * np.pi, 60, endpoint=False)
    return np.array(place) + solid.radius * np.column_stack([np.cos(angle), np.sin(angle)])


def _rectangle(place: tuple[float, float], extent: tuple[float, float]) -> Outline:
    corners = np.array([(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)])
    return np.array(place) + corners * np.array(extent)
