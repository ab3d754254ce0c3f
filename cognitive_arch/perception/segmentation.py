"""Where things are: from an image to a binary mask, 255 on things and 0 elsewhere (thesis 3.3).

Several segmenters stand behind one interface and are chosen by name (`make_segmenter`). All of them want a
table that fills most of the picture:

- `colour`, the default: what has another colour than the table. Shadows and reflections are no things.
- `texture`: where the local binary patterns are not those of the table (thesis 3.3).
- `depth`: what rises above the table, where there is a depth image and a calibrated camera.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError, unknown
from cognitive_arch.perception.background import (
    estimate_background,
    without_reflections,
    without_surroundings,
)
from cognitive_arch.perception.camera import Camera

Image = NDArray[np.uint8]  # (height, width, 3), RGB
Mask = NDArray[np.uint8]  # (height, width), 255 on things, 0 elsewhere
Ignored = NDArray[np.bool_]  # (height, width), true where nothing is to be found
Depth = NDArray[np.floating]  # (height, width), metres along the camera's z axis

MIN_TOLERANCE = 16.0  # grey levels off the table's colour that are not noise
NOISE_FACTOR = 5.0  # standard deviations of the table's own noise that are not yet a thing
UMBRA = 0.3  # of the table's brightness: what is darker is no shadow any more, but dark itself
MIN_LIGHT, LIGHT = 50.0, 0.25  # grey levels, and share of the table's brightness: what adds more is no shade
BRIGHT_TABLE = 60.0  # mean of the three colours from which on darkness means something
RISE, CEILING = 0.004, 0.45  # m above the table between which things are
FLAT = 8  # grey levels between neighbours that make no texture
WINDOW = 7  # pixels; side of the square in which patterns are counted
RARE = 0.2  # of a window's pixels that have patterns other than the table's


class Segmenter(Protocol):
    """Finds things in pictures."""

    def segment(self, image: Image, ignore: Ignored | None = None, depth: Depth | None = None) -> Mask:
        """The mask of things in `image`.

        Nothing is found where `ignore` is true (the robot's own hands). `depth` is the depth image that
        belongs to it, for those that use it. Raises `PerceptionError` for arrays that do not fit together.
        """
        ...


class _Segmenter:
    """What all have in common: arguments are checked alike, and nothing is found where it is not to be."""

    def segment(self, image: Image, ignore: Ignored | None = None, depth: Depth | None = None) -> Mask:
        """See `Segmenter`."""
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            raise PerceptionError(f"an image of {image.shape} {image.dtype}; valid: (height, width, 3) uint8")
        for what, other in (("mask", ignore), ("depth image", depth)):
            if other is not None and other.shape != image.shape[:2]:
                raise PerceptionError(f"a {what} of {other.shape}; valid for this image: {image.shape[:2]}")
        mask = self._segment(image, ignore, depth)
        if ignore is not None:
            mask[ignore.astype(np.bool_, copy=False)] = 0
        return mask

    def _segment(self, image: Image, ignore: Ignored | None, depth: Depth | None) -> Mask:
        raise NotImplementedError


class ColourSegmenter(_Segmenter):
    """What is off the table's colour.

    A shadow makes the table darker and keeps the shares of red, green and blue; so colours are compared with
    the line from black through the table's colour, not with that colour alone. Bright spots that fade out
    at their border are reflections of a lamp.
    """

    def _segment(self, image: Image, ignore: Ignored | None, depth: Depth | None) -> Mask:
        table = estimate_background(image, ignore)
        if table is None:
            return np.zeros(image.shape[:2], np.uint8)
        limit = max(MIN_TOLERANCE, NOISE_FACTOR * table.noise)
        bright = table.brightness
        darkest = UMBRA * bright if bright > BRIGHT_TABLE else 0.0
        brightest = table.lit + max(MIN_LIGHT, LIGHT * table.lit)
        low, high = (128 - limit, 128 - limit, darkest), (128 + limit, 128 + limit, brightest)
        mask = np.asarray(cv2.bitwise_not(cv2.inRange(table.deviation(image), low, high)), np.uint8)
        mask = np.asarray(cv2.medianBlur(mask, 3), np.uint8)
        if ignore is not None:
            mask[ignore.astype(np.bool_, copy=False)] = 0
        return without_reflections(without_surroundings(mask, ignore), image, table)


class TextureSegmenter(_Segmenter):
    """Where local binary patterns are not those of the table (thesis 3.3).

    The pattern of a pixel has one bit per neighbour: whether it is brighter by more than `FLAT`. Patterns
    that make up most of the table are common; where a fifth of a small window has others, there is a
    thing, or the edge of one, which is filled.
    """

    def _segment(self, image: Image, ignore: Ignored | None, depth: Depth | None) -> Mask:
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        patterns = binary_patterns(np.asarray(cv2.GaussianBlur(grey, (3, 3), 0), np.uint8), FLAT)
        counted = patterns if ignore is None else patterns[~ignore.astype(np.bool_)]
        counts = np.bincount(counted.ravel(), minlength=256)
        order = np.argsort(-counts, kind="stable")
        common = np.cumsum(counts[order]) - counts[order] < 0.9 * counts.sum()
        rare = np.zeros(256, np.uint8)
        rare[order[~common]] = 255
        share = cv2.blur(cv2.LUT(patterns, rare), (WINDOW, WINDOW))
        _, dense = cv2.threshold(share, 255 * RARE, 255, cv2.THRESH_BINARY)
        mask = np.asarray(
            cv2.morphologyEx(dense, cv2.MORPH_CLOSE, np.ones((WINDOW, WINDOW), np.uint8)), np.uint8
        )
        if ignore is not None:
            mask[ignore.astype(np.bool_, copy=False)] = 0
        mask = without_surroundings(mask, ignore)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(mask, contours, -1, 255, cv2.FILLED)
        # A window sees an edge from half its width.
        return np.asarray(
            cv2.erode(mask, np.ones((WINDOW // 2, WINDOW // 2), np.uint8), borderValue=255), np.uint8
        )


class DepthSegmenter(_Segmenter):
    """What rises more than `rise` metres above a table of a known height (m), as a calibrated camera sees it.

    Colour, shadows and reflections do not matter here; what is thinner than `rise` is not seen.
    """

    def __init__(self, camera: Camera, table: float, rise: float = RISE) -> None:
        self.camera, self.table, self.rise = camera, table, rise
        width, height = camera.size
        z_x, z_y, z_z = camera.X_WC[2, :3]
        # How much lower a pixel's place gets with every metre of depth: one part per column, one per row.
        columns = (np.arange(width) - camera.centre[0]) / camera.focal * z_x
        rows = (np.arange(height) - camera.centre[1]) / camera.focal * z_y + z_z
        self._slope = np.add.outer(rows, columns).astype(np.float32)

    def _segment(self, image: Image, ignore: Ignored | None, depth: Depth | None) -> Mask:
        if depth is None:
            raise PerceptionError("segmenter depth needs a depth image; without one: colour, texture")
        if depth.shape != self._slope.shape:
            raise PerceptionError(f"a depth image of {depth.shape}; this camera's are {self._slope.shape}")
        height = cv2.multiply(np.asarray(depth, np.float32), self._slope)
        start = self.table - float(self.camera.position[2])
        # A pixel without depth is infinite, NaN or 0, hence far below the table, nowhere, or at the camera.
        return np.asarray(cv2.inRange(height, start + self.rise, start + CEILING), np.uint8)


SEGMENTERS: dict[str, Callable[..., Segmenter]] = {
    "colour": ColourSegmenter,
    "texture": TextureSegmenter,
    "depth": DepthSegmenter,
}
DEFAULT = "colour"
FOR_PLAIN_IMAGES = ("colour", "texture")
MARGINS = {"colour": 2, "texture": 0}
"""Pixels that a thing in a camera's picture goes on beyond what a segmenter finds: edges are blurred, and
`colour` leaves out what is half table; `texture` sees an edge from both sides. Rendered ones need none."""
MAX_MARGIN = 50


def make_segmenter(name: str = DEFAULT, **settings: Any) -> Segmenter:
    """The segmenter `name` of `SEGMENTERS` with its settings; raises `PerceptionError` for an unknown one,
    or where it needs more settings than were given."""
    if name not in SEGMENTERS:
        raise PerceptionError(unknown("segmenter", name, SEGMENTERS))
    if name == "depth" and not {"camera", "table"} <= set(settings):
        raise PerceptionError(
            "segmenter depth needs the robot's camera and a depth image, which a plain image does not have; "
            f"valid for it: {', '.join(FOR_PLAIN_IMAGES)}"
        )
    return SEGMENTERS[name](**settings)


def check_margin(margin: int) -> None:
    """Raise `PerceptionError` for a margin (pixels) out of range."""
    if not 0 <= margin <= MAX_MARGIN:
        raise PerceptionError(f"a margin of {margin} pixels; valid: 0 to {MAX_MARGIN}")


def widened(mask: Mask, margin: int) -> Mask:
    """The pieces of `mask` (height, width) with `margin` pixels more around each; those that were apart (8
    neighbours) stay apart, by a gap of one pixel. Raises `PerceptionError` for a margin out of range."""
    check_margin(margin)
    if margin == 0:
        return mask
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin + 1,) * 2)
    wider = np.asarray(cv2.dilate(mask, disc), np.uint8)
    if _pieces(wider) == _pieces(mask):
        return wider
    # Each pixel belongs to the nearest piece. Numbers up to 2^24 are exact as float32, which can be dilated.
    _, labels = cv2.distanceTransformWithLabels(
        cv2.bitwise_not(mask), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_CCOMP
    )
    number, side = labels.astype(np.float32), np.ones((3, 3), np.uint8)
    least_around = cv2.erode(np.where(wider > 0, number, np.inf), side)
    own_around = cv2.dilate(np.where(mask > 0, number, 0), side)
    least_own_around = cv2.erode(np.where(mask > 0, number, np.inf), side)
    # An added pixel gives way where it would touch another piece, or what was added to one of a lower number.
    touches = (least_around < number) | (own_around > number) | (least_own_around < number)
    wider[(mask == 0) & touches] = 0
    # What is cut off from its piece by that is nobody's.
    _, joined = cv2.connectedComponents(wider, connectivity=8)
    wider[~np.isin(joined, joined[mask > 0])] = 0
    return wider


def _pieces(mask: Mask) -> int:
    _, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    return 0 if tree is None else int(np.count_nonzero(np.asarray(tree)[0, :, 3] < 0))


def binary_patterns(grey: NDArray[np.uint8], flat: int = 0) -> NDArray[np.uint8]:
    """The local binary pattern of each pixel of `grey` (height, width): bit n is set where the n-th of the
    eight neighbours is brighter by more than `flat` grey levels. At the border the picture is mirrored."""
    height, width = grey.shape
    wide = cv2.copyMakeBorder(grey, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    limit = cv2.add(grey, np.full(1, flat, np.uint8))
    patterns = np.zeros_like(grey)
    around = ((0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0))
    for bit, (y, x) in enumerate(around):
        brighter = (wide[y : y + height, x : x + width] > limit).view(np.uint8)
        patterns |= brighter << np.uint8(bit)
    return patterns
