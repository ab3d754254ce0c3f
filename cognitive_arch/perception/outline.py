"""The outline of one blob, what is measured along it, and its two halves.

Places are pixels, x right and y down, with whole coordinates at a pixel's centre. The outline runs through
the centres of the outermost pixels, so that a block of 5 by 3 pixels has an outline of 4 by 2 (OpenCV's
convention, and that of the published programs). Holes are not part of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError
from cognitive_arch.kernel_cache import kernels_kept

with kernels_kept(Path(__file__).parent):
    from cognitive_arch.perception import outline_kernels as kernels

Mask = NDArray[np.uint8] | NDArray[np.bool_]
Points = NDArray[np.int32]

MOMENTS = kernels.MOMENTS
DEEP = 8.0  # pixels; bays that are less deep are not counted


class Rectangle(NamedTuple):
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

    `contour` is (n, 1, 2) int32, pixels, `area` in square pixels, `perimeter` in pixels; `hull` (k, 2)
    float32 are the corners of the convex hull, `hull_perimeter` its length in pixels. `rectangle` is the
    smallest one around it, the longest of several that are equally small: every triangle has three of them,
    so that without a rule a turn would exchange its main axis. `ellipse_ratio` is the minor by the major axis
    of the ellipse that fits the outline best; where none does (fewer than five points, no area, or points of
    two lines), the short by the long side of the rectangle. `bays` is how many there are deeper than
    `DEEP`. `moments` are the central normalised ones of the area inside, those named in `MOMENTS`, 0 where
    there is none; they are those of the blob turned so that the unit vector `up` (x, y) points up.
    """

    def __init__(self, contour: Points, up: tuple[float, float] = (0.0, -1.0)) -> None:
        self.contour = contour
        numbers = np.empty(kernels.FIRST_MOMENT + len(kernels.MOMENTS))
        self.hull = kernels.measure(contour[:, 0], *up, DEEP, numbers)
        measured = numbers.tolist()
        self.area: float = measured[kernels.AREA]
        self.perimeter: float = measured[kernels.PERIMETER]
        self.hull_perimeter: float = measured[kernels.HULL]
        self.bays: float = measured[kernels.BAYS]
        self.ellipse_ratio: float = measured[kernels.ELLIPSE]
        upwards = (measured[kernels.UP_X], measured[kernels.UP_Y])
        long, short, middle = measured[kernels.LONG], measured[kernels.SHORT], measured[kernels.MIDDLE]
        self.rectangle = Rectangle(long, short, upwards, middle)
        self.moments: Sequence[float] = measured[kernels.FIRST_MOMENT :]

    @property
    def circle_area(self) -> float:
        """Square pixels of the smallest circle around it."""
        return math.pi * float(cv2.minEnclosingCircle(self.hull)[1]) ** 2

    @property
    def rectangle_area(self) -> float:
        """Square pixels of the smallest rectangle around it."""
        return self.rectangle.long * self.rectangle.short

    def simplified(self, share: float) -> Outline:
        """Without the corners that lie nearer to the rest than `share` of the perimeter."""
        return Outline(np.asarray(cv2.approxPolyDP(self.contour, share * self.perimeter, True), np.int32))


def ratio(part: float, whole: float) -> float:
    """`part` by `whole`, 0 where there is nothing to divide by."""
    return part / whole if whole > 0 else 0.0


def pixels(mask: Mask) -> NDArray[np.uint8]:
    """`mask` (h, w) as uint8; raises `PerceptionError` for what is no mask."""
    if mask.ndim != 2 or mask.dtype not in (np.bool_, np.uint8):
        raise PerceptionError(
            f"a mask of shape {mask.shape} and type {mask.dtype}; valid: (h, w) of uint8 or bool"
        )
    return np.ascontiguousarray(mask).view(np.uint8)


def cropped(mask: Mask) -> NDArray[np.uint8]:
    """The rectangle of `mask` (h, w) that holds all of its pixels that are not 0, as uint8.

    Raises `PerceptionError` for what is no mask, or an empty one.
    """
    filled = pixels(mask)
    x, y, width, height = cv2.boundingRect(filled) if filled.size else (0, 0, 0, 0)
    if not width:
        raise PerceptionError("a mask without a pixel that is not 0; valid: one blob")
    return np.ascontiguousarray(filled[y : y + height, x : x + width])


def outline(blob: NDArray[np.uint8], up: tuple[float, float] = (0.0, -1.0)) -> Outline:
    """Of the largest piece of `blob` (h, w) uint8, which has a pixel that is not 0."""
    contours = cv2.findContours(blob, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]
    if len(contours) == 1:
        return Outline(np.asarray(contours[0], np.int32), up)
    pieces: list[Points] = [np.asarray(contour, np.int32) for contour in contours]
    return Outline(max(pieces, key=_extent), up)


def halves(blob: NDArray[np.uint8], whole: Outline) -> tuple[Outline, Outline]:
    """The top and the bottom of `blob`, cut across the middle of the main axis of its outline.

    Top is the half at the upper end of the axis in the image, at the left end of a level one. Neither is
    empty; of one in several pieces, the largest counts. Pixels on the cut belong to both. Nothing is sampled
    anew: the halves keep their pixels, and only the frame of their moments is turned, the axis upright.
    """
    rectangle = whole.rectangle
    top, bottom = np.empty_like(blob), np.empty_like(blob)
    kernels.cut(blob, *rectangle.up, rectangle.middle, top, bottom)
    return outline(top, rectangle.up), outline(bottom, rectangle.up)


def _extent(contour: Points) -> tuple[float, int]:
    return float(cv2.contourArea(contour)), len(contour)
