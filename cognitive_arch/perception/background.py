"""The table behind the things: its colour, and what is seen on it or around it that is no thing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.kernel_cache import kernels_kept

with kernels_kept(Path(__file__).parent):
    from cognitive_arch.perception import background_kernels as kernels

Image = NDArray[np.uint8]  # (height, width, 3), RGB
Mask = NDArray[np.uint8]  # (height, width), 255 on things

SAMPLES = 2500  # pixels, at most, that tell the table's colour
BINS = 32  # of the shares of red and green in a colour
DARK = 6.0  # grey levels added before colours are divided: the darkest ones are mostly rounding
LIT = 0.75  # of the table's pixels that are no brighter than where it is lit
SPAN = 0.4  # of a side of the picture, from which on a piece at the border is not on the table
REACH = 3.0  # pixels to either side of an outline, between which a thing's brightness jumps
SOFT = 0.5  # of its contrast: a bright spot that jumps by less fades out, and is a reflection
WHITISH = 20.0  # grey levels off the table's colour plus some white
MANY = 50  # pieces looked at for reflections; in a picture with more, something else is wrong


@dataclass(frozen=True)
class Background:
    """The table's `colour` (3,), RGB in grey levels, its `noise`, the standard deviation in grey levels of
    what is measured as `deviation`, and its mean brightness where it is `lit`: half of it may be shaded."""

    colour: NDArray[np.float64]
    noise: float
    lit: float

    @property
    def brightness(self) -> float:
        """Mean of the three colours."""
        return float(self.colour.mean())

    @property
    def matrix(self) -> NDArray[np.float32]:
        """See `deviation`, (3, 4)."""
        red, _, blue = self.colour / max(float(self.colour.sum()), 1.0)
        third = 1 / 3
        rows = [[1 - red, -red, -red, 128], [-blue, -blue, 1 - blue, 128], [third, third, third, 0]]
        return np.array(rows, np.float32)

    def deviation(self, image: Image) -> NDArray[np.uint8]:
        """(height, width, 3): by how much there is more red and more blue than the table would have at the
        same brightness, plus 128, and the brightness. Cut off at 0 and 255."""
        return np.asarray(cv2.transform(image, self.matrix), np.uint8)


def estimate_background(image: Image, ignore: NDArray[np.bool_] | None = None) -> Background | None:
    """The commonest colour of `image` (height, width, 3), whatever its brightness, where `ignore` (height,
    width) is not true; None where all is ignored."""
    height, width = image.shape[:2]
    step = max(1, math.ceil(math.sqrt(height * width / SAMPLES)))
    pixels = image[::step, ::step].reshape(-1, 3)
    if ignore is not None:
        pixels = pixels[~ignore[::step, ::step].ravel().astype(np.bool_)]
    if not len(pixels):
        return None
    pixels, colours = np.ascontiguousarray(pixels), np.empty((2, 3))
    count, tones = len(pixels), np.zeros((3, 256), np.int64)
    counts = np.zeros((BINS + 2, BINS + 2), np.int64)
    kernels.commonest_colour(pixels, BINS, DARK, LIT, np.empty(count, np.int64), counts, tones, colours)
    lit = float(colours[1].mean())
    # Over all of the picture: a table whose colour changes from place to place is noisy in this sense, too.
    off = np.abs(Background(colours[0], 0.0, lit).matrix[:2, :3] @ pixels.T.astype(np.float32))
    off.partition(((count - 1) // 2, count // 2), axis=1)  # the median's middle two, with half its overhead
    noise = (off[:, (count - 1) // 2] + off[:, count // 2]) / 2
    return Background(colours[0], 1.4826 * float(noise.max()), lit)


def without_surroundings(mask: Mask, ignore: NDArray[np.bool_] | None = None) -> Mask:
    """`mask` without what lies around the table: pieces in a corner of the picture, and pieces along
    more than `SPAN` of one of its sides. What is ignored between them does not interrupt them."""
    height, width = mask.shape
    if height < 3 or width < 3:
        return mask
    for x, y in ((0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)):
        if mask[y, x]:
            cv2.floodFill(mask, None, (x, y), (0,), flags=8)
    for axis, place in ((0, 0), (0, height - 1), (1, 0), (1, width - 1)):
        line = mask[place] if axis == 0 else mask[:, place]
        gap = None if ignore is None else (ignore[place] if axis == 0 else ignore[:, place])
        covered = line > 0 if gap is None else (line > 0) | gap.astype(np.bool_)
        if np.count_nonzero(covered) <= SPAN * len(line):
            continue
        ends = np.flatnonzero(np.diff(np.concatenate([[False], covered, [False]]).astype(np.int8)))
        for start, end in zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True):
            if np.count_nonzero(line[start:end]) > SPAN * len(line):
                for at in range(start, end):
                    x, y = (at, place) if axis == 0 else (place, at)
                    if mask[y, x]:
                        cv2.floodFill(mask, None, (x, y), (0,), flags=8)
    return mask


def without_reflections(mask: Mask, image: Image, table: Background) -> Mask:
    """`mask` without the bright spots that a lamp makes on the table: of the table's colour with some white
    added, and fading out at their border, where a thing of that colour has an edge."""
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    for contour in contours[:MANY]:
        if len(contour) >= 8 and _is_reflection(np.asarray(contour, np.int32), mask, image, table):
            cv2.drawContours(mask, [contour], -1, 0, cv2.FILLED)
    return mask


def _is_reflection(contour: NDArray[np.int32], mask: Mask, image: Image, table: Background) -> bool:
    x, y, width, height = cv2.boundingRect(contour)
    rows, columns = slice(y, y + height), slice(x, x + width)
    own = mask[rows, columns]
    inside = cv2.mean(image[rows, columns], own)[:3]
    added = [one - usual for one, usual in zip(inside, table.colour.tolist(), strict=True)]
    white = sum(added) / 3
    if min(added) <= 0 or max(abs(one - white) for one in added) > WHITISH + 0.25 * white:
        return False
    outline = contour[:: max(1, len(contour) // 48), 0].astype(np.float32)
    outwards = outline - np.array([x + (width - 1) / 2, y + (height - 1) / 2], np.float32)
    outwards /= np.maximum(np.linalg.norm(outwards, axis=1), 1e-6)[:, None]
    limits = np.array([image.shape[1] - 1, image.shape[0] - 1])
    inner, outer = (
        np.clip(np.rint(outline + shift * outwards).astype(np.int64), 0, limits) for shift in (-REACH, REACH)
    )
    light = image[inner[:, 1], inner[:, 0]].mean(axis=1) - image[outer[:, 1], outer[:, 0]].mean(axis=1)
    contrast = float(np.percentile(image[rows, columns][own > 0].mean(axis=1), 95)) - table.brightness
    return float(np.median(light)) < SOFT * contrast
