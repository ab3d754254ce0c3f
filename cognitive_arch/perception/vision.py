"""From an image to what is seen in it: mask, blobs, their shapes, their names (thesis 3.3).

The shapes are what affordances are asked with; they never depend on a name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception import descriptors
from cognitive_arch.perception.descriptors import Descriptions, describe
from cognitive_arch.perception.labelling import MIN_AREA, Blob, label_blobs
from cognitive_arch.perception.segmentation import Ignored, Image, Segmenter, widened

OUTLINE, PAPER, INK = (230, 30, 200), (255, 255, 255), (20, 20, 20)
FONT = cv2.FONT_HERSHEY_SIMPLEX


class Recogniser(Protocol):
    """Names what a region shows."""

    def classify(self, image: Image, mask: NDArray[np.bool_]) -> list[tuple[str, float]]:
        """Names with their probabilities, the likeliest first, for the region `mask` (height, width) of
        `image` (height, width, 3) RGB, both of which may be cut to its box; one of the names is "unknown"."""
        ...


@dataclass(frozen=True, eq=False)
class SeenBlob:
    """A blob with its shape and, where something could tell, what it is and how probably."""

    blob: Blob
    descriptions: Descriptions
    label: str | None = None
    probability: float | None = None

    def to_json(self) -> dict[str, Any]:
        """As `cogarch see --json` prints it: pixels, areas in pixels, descriptors by part and name."""
        return {
            "bbox": list(self.blob.bbox),
            "centroid": [round(value, 3) for value in self.blob.centroid],
            "area": self.blob.area,
            "label": self.label,
            "probability": self.probability,
            "descriptors": {part: dict(getattr(self.descriptions, part)) for part in descriptors.PARTS},
        }


def see(
    image: Image,
    segmenter: Segmenter,
    mask: NDArray[np.uint8] | NDArray[np.bool_] | None = None,
    ignore: Ignored | None = None,
    depth: NDArray[np.floating] | None = None,
    recogniser: Recogniser | None = None,
    formulas: str = descriptors.DEFAULT,
    min_area: int = MIN_AREA,
    margin: int = 0,
) -> list[SeenBlob]:
    """The blobs in `image` (height, width, 3) uint8 RGB, from the top downwards.

    `mask` (height, width), not 0 on things, takes the place of the segmenter's. `ignore` is true where
    nothing is to be found. Blobs of less than `min_area` pixels are left out. To what the segmenter finds
    `margin` pixels are added all around; names are given by what it found. Raises `PerceptionError` for
    arrays that do not fit together, for unknown `formulas` and for a margin out of range.
    """
    found: NDArray[np.uint8] | NDArray[np.bool_]
    if mask is None:
        segmented = segmenter.segment(image, ignore, depth)
        found, mask = segmented, widened(segmented, margin)
    else:
        if mask.shape != image.shape[:2]:
            raise PerceptionError(f"a mask of {mask.shape}; valid for this image: {image.shape[:2]}")
        found = mask
    if ignore is not None:
        mask = np.where(ignore, 0, mask).astype(np.uint8)
    seen = []
    for blob in label_blobs(mask, min_area).blobs:
        described = describe(blob.mask, formulas, blob.contour - np.array(blob.bbox[:2], np.int32))
        label, probability = _name(image, blob, found, recogniser)
        seen.append(SeenBlob(blob, described, label, probability))
    return seen


def _name(
    image: Image,
    blob: Blob,
    found: NDArray[np.uint8] | NDArray[np.bool_],
    recogniser: Recogniser | None,
) -> tuple[str | None, float | None]:
    if recogniser is None:
        return None, None
    x, y, width, height = blob.bbox
    part = (slice(y, y + height), slice(x, x + width))
    return recogniser.classify(image[part], blob.mask.view(np.bool_) & (found[part] > 0))[0]


def annotated(image: Image, seen: Sequence[SeenBlob]) -> Image:
    """A copy of `image` with every blob outlined, and its number (from 1) or its name written above it."""
    picture = image.copy()
    thick = 2 if min(image.shape[:2]) >= 400 else 1
    for number, one in enumerate(seen, start=1):
        cv2.drawContours(picture, [one.blob.contour.reshape(-1, 1, 2)], -1, OUTLINE, thick, cv2.LINE_AA)
        x, y, width, _ = one.blob.bbox
        told = str(number) if one.label is None else f"{one.label} {one.probability:.2f}"
        _write(picture, told, (x + width // 2, y - 5))
    return picture


def _write(picture: Image, text: str, place: tuple[int, int]) -> None:
    """Dark letters on a light ground, their middle just above `place`, inside of the picture."""
    scale = max(0.4, min(picture.shape[:2]) / 1100)
    (width, height), below = cv2.getTextSize(text, FONT, scale, 1)
    x = max(2, min(place[0] - width // 2, picture.shape[1] - width - 2))
    y = max(height + 3, min(place[1], picture.shape[0] - below - 2))
    cv2.rectangle(picture, (x - 2, y - height - 2), (x + width + 2, y + below), PAPER, cv2.FILLED)
    cv2.putText(picture, text, (x, y), FONT, scale, INK, 1, cv2.LINE_AA)
