"""How a region looks, in numbers that change little with light, distance and direction.

Colours are taken as shares of red and green in the whole, where the region is lit: brighter light leaves
them as they are. Shapes are told by ratios, of the whole region and of its lit part, which for most things
is their upper side. The one number that is not free of the light is how bright the lit part is, for that
is all that tells grey from black or white. How shade changes from pixel to pixel tells flat sides, which
meet at edges, from round ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError
from cognitive_arch.kernel_cache import kernels_kept

with kernels_kept(Path(__file__).parent):
    from cognitive_arch.perception import region_kernels as kernels

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]
LIT = 0.72  # of the brightest shade: what is brighter counts as lit
BRIGHTEST = 0.90  # share of the pixels that are darker than what counts as the brightest shade
SHADES = (0.05, 0.25, 0.50, 0.75)
DARK = 6.0  # grey levels added to colours before they are divided: the darkest ones are mostly rounding
SAMPLE = 400  # pixels that tell how much the colour varies
OUTLINE_SAMPLE = 1200  # pixels that tell its form
SLOPE_SAMPLE = 2000  # pixels that tell how its shade changes
INNER = np.ones((5, 5), np.uint8)  # pixels no nearer to the border than half of this
STEEP = 0.05  # of the brightest shade from one pixel to the next: more is an edge
_SHAPE = (
    *("roundness", "filling", "convexity", "squareness", "slimness", "circularity"),
    *("spread", "lopsided", "triangular", "square", "two_ended"),
)
COLORS = ("red", "green", "red_over_green", "green_over_blue", "all_red", "all_green")
FEATURES = (
    "brightness",
    *COLORS,
    *("red_varies", "green_varies", "lit_share", "lit_varies"),
    *(f"shade_{round(100 * shade)}" for shade in SHADES),
    *_SHAPE,
    *(f"lit_{name}" for name in _SHAPE),
    *("lit_right", "lit_down"),
    *("slope", "slope_50", "slope_90", "edges"),
)

# Regions are small: handing them to other threads takes up to ten times as long as doing it here.
cv2.setNumThreads(1)


def appearance(image: Image, mask: Mask) -> NDArray[np.float32]:
    """`FEATURES` of the region `mask` (height, width) bool of `image` (height, width, 3) uint8 RGB.

    Raises `PerceptionError` where the two do not fit together or the region is empty.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise PerceptionError(f"an image of {image.shape} {image.dtype}; valid: (height, width, 3) uint8")
    if mask.shape != image.shape[:2] or mask.dtype != np.bool_:
        raise PerceptionError(
            f"a mask of {mask.shape} {mask.dtype}; valid for this image: {image.shape[:2]} bool"
        )
    whole = np.ascontiguousarray(mask).view(np.uint8)
    left, top, width, height = cv2.boundingRect(whole)
    if width == 0:
        raise PerceptionError("a mask without a pixel; valid: a region to look at")
    # A border of one pixel, so that outlines close.
    region = np.zeros((height + 2, width + 2), np.uint8)
    region[1:-1, 1:-1] = whole[top : top + height, left : left + width]
    colors = np.zeros((height + 2, width + 2, 3), np.uint8)
    colors[1:-1, 1:-1] = image[top : top + height, left : left + width]
    tones, lit = np.empty_like(region), np.empty_like(region)
    counts = np.empty(256, np.int64)
    kernels.shade(colors, region, tones, counts)
    shades = _percentiles(counts)
    found, varies = np.empty((2, kernels.FORM + kernels.FORMS)), np.empty(4)
    least = round(LIT * shades[-1])
    kernels.look(colors, tones, region, least, DARK, (SAMPLE, OUTLINE_SAMPLE), lit, found, varies)
    of_all, of_lit = found.tolist()
    numbers = [math.log((shades[-1] + 1) / 256), *_colors(of_all, of_lit, varies.tolist())]
    numbers += [(shade + 1) / (shades[-1] + 1) for shade in shades[:-1]]
    numbers += [*_shape(region, of_all), *_shape(lit, of_lit)]
    size = math.sqrt(of_all[kernels.COUNT])
    numbers += [(of_lit[axis] - of_all[axis]) / size for axis in (kernels.X, kernels.Y)]
    numbers += _slopes(tones, region, shades[-1] + 1, size)
    return np.array(numbers, dtype=np.float32)


def _slopes(
    tones: NDArray[np.uint8], region: NDArray[np.uint8], brightest: float, size: float
) -> list[float]:
    """By how much of the brightest shade it would change across the region, `size` pixels, if it changed as
    it does from pixel to pixel inside: mean, median, ninth decile; and the share of pixels at edges."""
    smooth = np.asarray(cv2.GaussianBlur(tones, (3, 3), 0), np.uint8)
    inner = np.asarray(cv2.erode(region, INNER, borderValue=0), np.uint8)
    counts = np.empty(kernels.SLOPES, np.int64)
    kernels.slopes(smooth, inner, SLOPE_SAMPLE, counts)
    below = counts.cumsum()
    if not below[-1]:  # too slim to have an inside
        return [0.0] * 4
    unit = size / kernels.SLOPE_UNIT / brightest
    mean = float(counts @ np.arange(kernels.SLOPES)) / float(below[-1])
    median, decile = below.searchsorted(np.array([0.5, 0.9]) * below[-1]).tolist()
    gentle = below[min(int(STEEP * brightest * kernels.SLOPE_UNIT), kernels.SLOPES - 1)] / below[-1]
    return [unit * mean, unit * median, unit * decile, 1 - float(gentle)]


def _percentiles(counts: NDArray[np.int64]) -> list[float]:
    """The shades that `SHADES` and `BRIGHTEST` of the pixels stay below; (256,) `counts` of them."""
    below = counts.cumsum()
    wanted = np.array([*SHADES, BRIGHTEST]) * below[-1]
    places: list[float] = below.searchsorted(wanted).tolist()
    return places


def _colors(of_all: Sequence[float], of_lit: Sequence[float], varies: Sequence[float]) -> list[float]:
    red, green, blue = (of_lit[n] + DARK for n in (kernels.RED, kernels.GREEN, kernels.BLUE))
    all_red, all_green, all_blue = (of_all[n] + DARK for n in (kernels.RED, kernels.GREEN, kernels.BLUE))
    total, all_total = red + green + blue, all_red + all_green + all_blue
    return [
        red / total,
        green / total,
        math.log(red / green),
        math.log(green / blue),
        all_red / all_total,
        all_green / all_total,
        varies[kernels.RED_VARIES],
        varies[kernels.GREEN_VARIES],
        of_lit[kernels.COUNT] / of_all[kernels.COUNT],
        varies[kernels.TONE_VARIES] / (varies[kernels.TONE] + 1),
    ]


def _shape(region: NDArray[np.uint8], found: Sequence[float]) -> list[float]:
    """Numbers for `_SHAPE` of a region in which `kernels.look` found these.

    In this order: the shorter by the longer half axis; the area by that of the ellipse with the same
    moments; by that of the convex hull; by that of the smallest rectangle around it; its shorter by its
    longer side; 4 pi area / perimeter^2; then those of the form.
    """
    area, xx, yy, xy = (found[n] for n in (kernels.COUNT, kernels.XX, kernels.YY, kernels.XY))
    spread = math.sqrt((xx - yy) ** 2 / 4 + xy * xy)
    longer, shorter = (xx + yy) / 2 + spread, max((xx + yy) / 2 - spread, 1 / 12)
    outlines, _ = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = outlines[0] if len(outlines) == 1 else np.vstack(outlines)
    hull = cv2.convexHull(outline)
    perimeter = sum(cv2.arcLength(each, True) for each in outlines) + 4
    # Contours run through the middles of the border's pixels: half a pixel is missing all around.
    hull_area = cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2 + 1
    _, sides, _ = cv2.minAreaRect(hull)
    long, short = max(sides) + 1, min(sides) + 1
    return [
        math.sqrt(shorter / longer),
        area / (4 * math.pi * math.sqrt(longer * shorter)),
        area / hull_area,
        area / (long * short),
        short / long,
        4 * math.pi * area / perimeter**2,
        *found[kernels.FORM :],
    ]
