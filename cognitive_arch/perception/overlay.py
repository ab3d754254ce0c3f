"""What was made of an image, drawn into it: outlines, names, how sure the robot is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.perception.scene import Sighting

Pixels = NDArray[np.uint8]  # (height, width, 3), RGB
NAMELESS = "?"
SEEN, DOUBTED, REMEMBERED, OWN = (20, 130, 60), (200, 60, 30), (40, 80, 200), (120, 120, 120)
PAPER, INK = (255, 255, 255), (20, 20, 20)
FONT, SIZE = cv2.FONT_HERSHEY_SIMPLEX, 0.42


def draw(
    color: Pixels,
    sightings: Sequence[Sighting],
    names: Mapping[int, str],
    own: NDArray[np.bool_] | None = None,
    remembered: Mapping[str, tuple[float, float]] | None = None,
) -> Pixels:
    """A copy of `color` with what is in view outlined and named: `names` says, by index, what sightings are
    taken to be, and the others are `NAMELESS`. `own` is the robot's body, greyed, and `remembered` are the
    pixels of things that are believed to be there and not seen."""
    picture = color.copy()
    if own is not None:
        picture[own] = (picture[own] // 2 + np.array(OWN, np.uint8) // 2).astype(np.uint8)
    for index, sighting in enumerate(sightings):
        name = names.get(index)
        shade = DOUBTED if name is None else SEEN
        mask = sighting.region.mask.astype(np.uint8)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        cv2.drawContours(picture, contours, -1, shade, 1, cv2.LINE_AA)
        x, y, width, _ = cv2.boundingRect(mask)
        text = NAMELESS if name is None else f"{name} {sighting.hypotheses[name].probability:.2f}"
        label(picture, text, (x + width / 2, y - 6), shade)
    for name, place in (remembered or {}).items():
        if np.isfinite(place).all():
            cv2.drawMarker(picture, _pixel(place), REMEMBERED, cv2.MARKER_TILTED_CROSS, 10, 1, cv2.LINE_AA)
            label(picture, f"({name})", (place[0], place[1] + 24), REMEMBERED)
    return picture


def label(picture: Pixels, text: str, place: Iterable[float], color: tuple[int, int, int] = INK) -> None:
    """Write `text` on a light ground, its middle just above `place` (pixels), inside the picture."""
    (width, height), below = cv2.getTextSize(text, FONT, SIZE, 1)
    x, y = _pixel(place)
    x = int(np.clip(x - width // 2, 2, max(2, picture.shape[1] - width - 2)))
    y = int(np.clip(y, height + 4, max(height + 4, picture.shape[0] - below - 2)))
    cv2.rectangle(picture, (x - 2, y - height - 2), (x + width + 2, y + below), PAPER, cv2.FILLED)
    cv2.putText(picture, text, (x, y), FONT, SIZE, color, 1, cv2.LINE_AA)


def _pixel(place: Iterable[float]) -> tuple[int, int]:
    x, y = (round(float(value)) for value in place)
    return x, y
