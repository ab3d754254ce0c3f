"""From a binary mask to blobs: connected pieces, numbered from 1 (thesis 3.3, the sequential labeler)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError

MIN_AREA = 60  # pixels; what is smaller is taken for noise
_CHILD, _PARENT = 2, 3  # columns of OpenCV's tree of outlines


@dataclass(frozen=True, eq=False)
class Blob:
    """One connected piece of a mask.

    `bbox` is (x, y, width, height), `area` the number of its pixels, all in pixels;
    `mask` (height, width) uint8 is 1 where it is, within its box; `contour` (n, 2) int32, x and y in the
    whole image, its outer outline.
    """

    bbox: tuple[int, int, int, int]
    area: int
    mask: NDArray[np.uint8]
    contour: NDArray[np.int32]

    @cached_property
    def centroid(self) -> tuple[float, float]:
        """(x, y) in pixels."""
        moments = cv2.moments(self.mask, binaryImage=True)
        return self.bbox[0] + moments["m10"] / self.area, self.bbox[1] + moments["m01"] / self.area


@dataclass(frozen=True, eq=False)
class Labelling:
    """The blobs of a mask of `shape` (height, width), from the top downwards."""

    shape: tuple[int, int]
    blobs: tuple[Blob, ...]

    @cached_property
    def labels(self) -> NDArray[np.int32]:
        """The labelled image, (height, width): 0 on the background, n on the n-th blob from 1."""
        labels = np.zeros(self.shape, np.int32)
        for number, blob in enumerate(self.blobs, start=1):
            x, y, width, height = blob.bbox
            labels[y : y + height, x : x + width][blob.mask > 0] = number
        return labels


def label_blobs(mask: NDArray[np.uint8] | NDArray[np.bool_], min_area: int = MIN_AREA) -> Labelling:
    """The connected pieces (8 neighbours) of `mask` (height, width), not 0 on things, of `min_area` pixels
    or more. Raises `PerceptionError` for what is no mask."""
    if mask.ndim != 2 or mask.dtype not in (np.bool_, np.uint8) or mask.size == 0:
        raise PerceptionError(
            f"a mask of shape {mask.shape} and type {mask.dtype}; valid: (height, width) of uint8 or bool"
        )
    binary = np.ascontiguousarray(mask).view(np.uint8)
    shape = (mask.shape[0], mask.shape[1])
    # Following outlines takes a seventh of the time of labelling every pixel: most of the picture is table.
    contours, tree = cv2.findContours(binary, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return Labelling(shape, ())
    outer = np.flatnonzero(np.asarray(tree)[0, :, _PARENT] < 0).tolist()
    with_holes = np.asarray(tree)[0, :, _CHILD] >= 0
    blobs = []
    for number in outer:
        contour = np.asarray(contours[number], np.int32)
        x, y, width, height = cv2.boundingRect(contour)
        if width * height < min_area:
            continue
        own = np.zeros((height, width), np.uint8)
        cv2.drawContours(own, [contour], -1, 1, cv2.FILLED, offset=(-x, -y))
        if with_holes[number]:
            own = _piece(binary[y : y + height, x : x + width], own, contour[0, 0] - (x, y))
        area = cv2.countNonZero(own)
        if area >= min_area:
            blobs.append(Blob((x, y, width, height), area, own, contour.reshape(-1, 2)))
    return Labelling(shape, tuple(sorted(blobs, key=lambda blob: (blob.bbox[1], blob.bbox[0]))))


def _piece(part: NDArray[np.uint8], filled: NDArray[np.uint8], start: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Of the pixels of `part` within `filled`, those connected with `start` (x, y): what lies in a hole of a
    blob is another blob."""
    _, labels = cv2.connectedComponents(np.where(part > 0, filled, 0).astype(np.uint8), connectivity=8)
    return (labels == labels[start[1], start[0]]).view(np.uint8)
