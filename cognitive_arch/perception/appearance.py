"""How a region looks, in numbers that change little with light, distance and direction.

Colours are taken as shares of red and green in the whole, where the region is lit: brighter light leaves
them as they are. Shapes are told by ratios, of the whole region and of its lit part, which for most things
is their upper side. The one number that is not free of the light is how bright the lit part is, for that
is all that tells grey from black or white.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from cv2.typing import MatLike
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]
LIT = 0.72  # of the brightest shade: what is brighter counts as lit
BRIGHTEST = 0.90  # share of the pixels that are darker than what counts as the brightest shade
SHADES = (0.05, 0.25, 0.50, 0.75)
DARK = 6.0  # grey levels added to colours before they are divided: the darkest ones are mostly rounding
SAMPLE = 400  # pixels that tell how much the colour varies
OUTLINE_SAMPLE = 1200  # pixels that tell its form
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
    tones = cv2.transform(colors, np.full((1, 3), 1 / 3))
    shades = _percentiles(tones, region)
    lit = cv2.bitwise_and(cv2.inRange(tones, LIT * shades[-1], 255), region)
    places, lit_places = _places(region), _places(lit)
    numbers = [math.log((shades[-1] + 1) / 256), *_colors(colors, tones, region, lit, lit_places)]
    numbers += [(shade + 1) / (shades[-1] + 1) for shade in shades[:-1]]
    of_whole, middle, area = _shape(region, places)
    of_lit, lit_middle, _ = _shape(lit, lit_places)
    size = math.sqrt(area)
    numbers += [*of_whole, *of_lit]
    numbers += [(lit_middle[0] - middle[0]) / size, (lit_middle[1] - middle[1]) / size]
    return np.array(numbers, dtype=np.float32)


def _percentiles(tones: MatLike, region: MatLike) -> list[float]:
    """The shades that `SHADES` and `BRIGHTEST` of the region's pixels stay below."""
    counts = cv2.calcHist([tones], [0], region, [256], [0, 256]).ravel()
    below = np.cumsum(counts)
    wanted = np.array([*SHADES, BRIGHTEST]) * below[-1]
    return [float(shade) for shade in np.searchsorted(below, wanted)]


def _places(region: MatLike) -> NDArray[np.int32]:
    """x and y (2, n) of its pixels, row by row."""
    return np.asarray(cv2.findNonZero(region), np.int32).reshape(-1, 2).T


def _colors(
    colors: Image, tones: MatLike, region: MatLike, lit: MatLike, lit_places: NDArray[np.int32]
) -> list[float]:
    red, green, blue = (value + DARK for value in cv2.mean(colors, lit)[:3])
    all_red, all_green, all_blue = (value + DARK for value in cv2.mean(colors, region)[:3])
    count = lit_places.shape[1]
    x, y = lit_places[:, :: count // SAMPLE + 1]
    chosen = colors[y, x].T + DARK
    shares = chosen[:2] / (chosen[0] + chosen[1] + chosen[2])
    shares -= shares.mean(axis=1, keepdims=True)
    spread = np.sqrt(np.square(shares).mean(axis=1))
    mean, deviation = cv2.meanStdDev(tones, mask=lit)
    total, all_total = red + green + blue, all_red + all_green + all_blue
    return [
        red / total,
        green / total,
        math.log(red / green),
        math.log(green / blue),
        all_red / all_total,
        all_green / all_total,
        float(spread[0]),
        float(spread[1]),
        count / cv2.countNonZero(region),
        float(deviation[0, 0] / (mean[0, 0] + 1)),
    ]


def _shape(region: MatLike, places: NDArray[np.int32]) -> tuple[list[float], tuple[float, float], float]:
    """Numbers for `_SHAPE`, the middle (x, y) in pixels, and the area in pixels.

    In this order: the shorter by the longer half axis; the area by that of the ellipse with the same
    moments; by that of the convex hull; by that of the smallest rectangle around it; its shorter by its
    longer side; 4 pi area / perimeter^2; then those of `_form`.
    """
    moments = cv2.moments(region, binaryImage=True)
    area = moments["m00"]
    middle = (moments["m10"] / area, moments["m01"] / area)
    # A pixel is a square, not a point: a twelfth each way.
    xx, yy, xy = moments["mu20"] / area + 1 / 12, moments["mu02"] / area + 1 / 12, moments["mu11"] / area
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
    numbers = [
        math.sqrt(shorter / longer),
        area / (4 * math.pi * math.sqrt(longer * shorter)),
        area / hull_area,
        area / (long * short),
        short / long,
        4 * math.pi * area / perimeter**2,
        *_form(places, middle, (xx, yy, xy)),
    ]
    return numbers, middle, area


def _form(
    places: NDArray[np.int32], middle: tuple[float, float], second: tuple[float, float, float]
) -> tuple[float, ...]:
    """Moments of third and fourth order after stretching the region until it is as wide as it is high.

    A slanted view of something flat is such a stretching, about: a disc has the moments of a disc from
    wherever one looks at it. None depends on how the stretched region is turned.
    """
    sample = places[:, :: places.shape[1] // OUTLINE_SAMPLE + 1]
    x, y = sample[0] - middle[0], sample[1] - middle[1]
    xx, yy, xy = second
    u = x / math.sqrt(xx)
    v = (y - xy / xx * x) / math.sqrt(max(yy - xy * xy / xx, 1 / 12))
    z = u + 1j * v
    square = z * z
    radius = u * u + v * v
    n = len(z)
    return (
        float(radius @ radius) / n / 4,
        float(abs(radius @ z)) / n,
        float(abs(square @ z)) / n,
        float(abs(square @ square)) / n,
        float(abs(square @ radius)) / n,
    )
