"""The outline of one blob, what is measured along it, and its two halves.

Places are pixels, x right and y down, with whole coordinates at a pixel's centre. The outline runs through
the centres of the outermost pixels, so that a block of 5 by 3 pixels has an outline of 4 by 2 (OpenCV's
convention, and that of the published programs). Holes are not part of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError

Mask = NDArray[np.uint8] | NDArray[np.bool_]
Points = NDArray[np.int32]

SAME_AREA = 1e-9  # relative; enclosing rectangles that differ by less are equally small
ON_THE_CUT = 1e-6  # pixels; what is nearer to the middle lies on it


@dataclass(frozen=True)
class Rectangle:
    """The smallest rectangle around a blob: its sides in pixels, `long` not below `short`, and its main axis.

    `up` is the unit vector (x, y) of the long side that points up in the image (to the left if it is level),
    `middle` the coordinate of the rectangle's centre along it, in pixels.
    """

    long: float
    short: float
    up: tuple[float, float]
    middle: float


class Outline:
    """What can be measured along a closed outline.

    `contour` is (n, 1, 2) int32, pixels, `area` in square pixels, `perimeter` in pixels; `hull` (k, 1, 2)
    int32 are the corners of the convex hull, `hull_perimeter` its length in pixels. The moments are those of
    the blob turned so that the unit vector `up` (x, y) points up, or as it is in the image without one.
    """

    def __init__(self, contour: Points, up: tuple[float, float] | None = None) -> None:
        self.contour = contour
        self._up = up
        self.area = float(cv2.contourArea(contour))
        self.perimeter = float(cv2.arcLength(contour, True))
        self._hull_indices = cv2.convexHull(contour, returnPoints=False).reshape(-1, 1)
        self.hull: Points = contour[self._hull_indices[:, 0]]
        self.hull_perimeter = float(cv2.arcLength(self.hull, True))

    @property
    def circle_area(self) -> float:
        """Square pixels of the smallest circle around it."""
        return math.pi * float(cv2.minEnclosingCircle(self.hull)[1]) ** 2

    @cached_property
    def rectangle(self) -> Rectangle:
        """The smallest rectangle around it; the longest of several that are equally small.

        Every triangle has three of them, so that without a rule a turn would exchange its main axis.
        """
        corners = self.hull[:, 0].astype(np.float64)
        if len(corners) == 1:
            return Rectangle(0.0, 0.0, (0.0, -1.0), -float(corners[0, 1]))
        count = len(corners)
        axes = np.empty((2, 2 * count))  # unit vectors, x and y: along each edge, then across
        edges = axes[:, :count]
        edges[:, 1:] = (corners[1:] - corners[:-1]).T
        edges[:, 0] = corners[0] - corners[-1]
        edges /= np.sqrt(edges[0] * edges[0] + edges[1] * edges[1])
        axes[0, count:], axes[1, count:] = -edges[1], edges[0]
        places = corners @ axes
        low, high = places.min(axis=0), places.max(axis=0)
        sides = (high - low).tolist()
        areas = [along * across for along, across in zip(sides[:count], sides[count:], strict=True)]
        limit = min(areas) * (1 + SAME_AREA) + SAME_AREA
        longest, best = max((sides[n], n) for n in range(2 * count) if areas[n % count] <= limit)
        x, y = axes[:, best].tolist()
        middle = float(low[best] + high[best]) / 2
        if y > 0 or (y == 0 and x > 0):
            x, y, middle = -x, -y, -middle
        return Rectangle(longest, sides[(best + count) % (2 * count)], (x, y), middle)

    @property
    def rectangle_area(self) -> float:
        """Square pixels of the smallest rectangle around it."""
        width, height = cv2.minAreaRect(self.hull)[1]
        return float(width) * float(height)

    @property
    def ellipse_ratio(self) -> float:
        """Minor by major axis of the ellipse that fits the outline best; where none does (fewer than five
        points, or no area), the short by the long side of the rectangle."""
        if len(self.contour) >= 5 and self.area > 0:
            axes = cv2.fitEllipse(self.contour)[1]
            short, long = min(axes), max(axes)
            if math.isfinite(long) and long > 0 and math.isfinite(short):
                return float(short / long)
        return ratio(self.rectangle.short, self.rectangle.long)

    @property
    def defect_depths(self) -> NDArray[np.float64]:
        """How far, in pixels, each bay of the outline reaches below the hull, (d,)."""
        if len(self._hull_indices) < 3 or len(self.contour) < 4:
            return np.zeros(0)
        # OpenCV wants the indices in the outline's order. That of the hull is another where the outline runs
        # back along itself, as around lines one pixel wide.
        indices = np.sort(self._hull_indices, axis=0)
        defects = cv2.convexityDefects(self.contour, indices)
        if defects is None:
            return np.zeros(0)
        return np.asarray(defects, np.float64).reshape(-1, 4)[:, 3] / 256  # OpenCV's fixed point

    @cached_property
    def moments(self) -> Mapping[str, float]:
        """Central normalised moments of the area inside, `nu20` to `nu03`; 0 where there is none."""
        found = cv2.moments(self.contour)
        if self._up is None:
            return found
        # x' = a x - b y and y' = b x + a y, in which the axis points against y'.
        b, a = -self._up[0], -self._up[1]
        xx, xy, yy = found["nu20"], found["nu11"], found["nu02"]
        xxx, xxy, xyy, yyy = found["nu30"], found["nu21"], found["nu12"], found["nu03"]
        aa, ab, bb = a * a, a * b, b * b
        return {
            "nu20": aa * xx - 2 * ab * xy + bb * yy,
            "nu11": ab * (xx - yy) + (aa - bb) * xy,
            "nu02": bb * xx + 2 * ab * xy + aa * yy,
            "nu30": a * aa * xxx - 3 * a * ab * xxy + 3 * b * ab * xyy - b * bb * yyy,
            "nu21": a * ab * xxx + a * (aa - 2 * bb) * xxy + b * (bb - 2 * aa) * xyy + b * ab * yyy,
            "nu12": b * ab * xxx + b * (2 * aa - bb) * xxy + a * (aa - 2 * bb) * xyy - a * ab * yyy,
            "nu03": b * bb * xxx + 3 * b * ab * xxy + 3 * a * ab * xyy + a * aa * yyy,
        }

    def simplified(self, share: float) -> Outline:
        """Without the corners that lie nearer to the rest than `share` of the perimeter."""
        return Outline(np.asarray(cv2.approxPolyDP(self.contour, share * self.perimeter, True), np.int32))


def ratio(part: float, whole: float) -> float:
    """`part` by `whole`, 0 where there is nothing to divide by."""
    return part / whole if whole > 0 else 0.0


def cropped(mask: Mask) -> NDArray[np.uint8]:
    """The rectangle of `mask` (h, w) that holds all of its pixels that are not 0, as uint8, 0 or 1.

    Raises `PerceptionError` for what is no mask, or an empty one.
    """
    if mask.ndim != 2 or mask.dtype not in (np.bool_, np.uint8):
        raise PerceptionError(
            f"a mask of shape {mask.shape} and type {mask.dtype}; valid: (h, w) of uint8 or bool"
        )
    filled = np.ascontiguousarray(mask).view(np.uint8)
    x, y, width, height = cv2.boundingRect(filled) if filled.size else (0, 0, 0, 0)
    if not width:
        raise PerceptionError("a mask without a pixel that is not 0; valid: one blob")
    return cv2.threshold(filled[y : y + height, x : x + width], 0, 1, cv2.THRESH_BINARY)[1].astype(
        np.uint8, copy=False
    )


def outline(blob: NDArray[np.uint8], up: tuple[float, float] | None = None) -> Outline:
    """Of the largest piece of `blob` (h, w) uint8, which has a pixel that is not 0."""
    contours = cv2.findContours(blob, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    pieces: list[Points] = [np.asarray(contour, np.int32) for contour in contours]
    return Outline(pieces[0] if len(pieces) == 1 else max(pieces, key=_extent), up)


def halves(blob: NDArray[np.uint8], whole: Outline) -> tuple[Outline, Outline]:
    """The top and the bottom of `blob`, cut across the middle of the main axis of its outline.

    Top is the half at the upper end of the axis in the image, at the left end of a level one. Neither is
    empty; of one in several pieces, the largest counts. Pixels on the cut belong to both. Nothing is sampled
    anew: the halves keep their pixels, and only the frame of their moments is turned, the axis upright.
    """
    rectangle = whole.rectangle
    x, y = rectangle.up
    height, width = blob.shape
    # How far a pixel lies above the cut is a sum of one part per column and one per row. Comparing the parts
    # saves a matrix of their sums, which would be eight times as large as the image.
    columns = x * np.arange(width) - rectangle.middle
    rows = -y * np.arange(height)[:, None]
    top = (columns >= rows - ON_THE_CUT).view(np.uint8)
    bottom = (columns <= rows + ON_THE_CUT).view(np.uint8)
    top &= blob
    bottom &= blob
    return outline(top, rectangle.up), outline(bottom, rectangle.up)


def _extent(contour: Points) -> tuple[float, int]:
    return float(cv2.contourArea(contour)), len(contour)
