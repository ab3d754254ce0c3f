"""Shape descriptors of a blob, of its whole and of the two halves along its main axis (thesis Table 2).

A descriptor is a function of an `Outline` and a row in a table below. There are two tables, after the two
programs whose published data there are; they differ in some formulas (docs/perception.md compares them):

- `shapeDescriptor` (2017), the default: from the outline as it is, eccentricity from the fitted ellipse as in
  Table 2, and convexity and compactness that lie between 0 and 1 (a perfect disc).
- `blobDescriptor` (2014-16): the whole's outline is first simplified, which takes small bends from a blob and
  some percent from its area, and makes it another measure than that of its halves. Where it starts, and so
  how the blob lies among the pixels, matters.

What no number can be given for is 0: all ratios of a single pixel, area and moments of a line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError, unknown
from cognitive_arch.perception.outline import MOMENTS, Mask, Outline, cropped, halves, outline, pixels, ratio

AREA_UNIT = 3000.0  # square pixels; the constant behind the published areas
PARTS = ("whole", "top", "bottom")
SHAPE, BLOB = "shapeDescriptor", "blobDescriptor"
DEFAULT = SHAPE


def area(blob: Outline) -> float:
    """Area inside of the outline, in units of `AREA_UNIT` square pixels.

    Keeps under translation and rotation, grows with the square of the scale.
    """
    return blob.area / AREA_UNIT


def convexity(blob: Outline) -> float:
    """Perimeter of the convex hull by that of the outline, 0 to 1. Keeps under all three."""
    return ratio(blob.hull_perimeter, blob.perimeter)


def squared_convexity(blob: Outline) -> float:
    """`convexity` squared, 0 to 1. Keeps under all three."""
    return convexity(blob) ** 2


def ellipse_eccentricity(blob: Outline) -> float:
    """Minor by major axis of the fitted ellipse, 0 to 1 (a disc). Keeps under all three."""
    return blob.ellipse_ratio


def rectangle_eccentricity(blob: Outline) -> float:
    """Short by long side of the smallest enclosing rectangle, 0 to 1. Keeps under all three."""
    return ratio(blob.rectangle.short, blob.rectangle.long)


def plain_compactness(blob: Outline) -> float:
    """Area by perimeter squared, at most 1 / (4 pi) but for the pixels' size. Keeps under all three."""
    return ratio(blob.area, blob.perimeter**2)


def compactness(blob: Outline) -> float:
    """4 pi times the area by perimeter squared, cut off at 1 (a disc). Keeps under all three."""
    return min(1.0, 4 * np.pi * plain_compactness(blob))


def circularity(blob: Outline) -> float:
    """Area by that of the smallest enclosing circle, 0 to 1 (a disc). Keeps under all three."""
    return ratio(blob.area, blob.circle_area)


def squareness(blob: Outline) -> float:
    """Area by that of the smallest enclosing rectangle, 0 to 1 (a rectangle). Keeps under all three."""
    return ratio(blob.area, blob.rectangle_area)


def convexity_defects(blob: Outline) -> float:
    """Number of bays in the outline that are deeper than `outline.DEEP` pixels.

    Keeps under translation and rotation; not under a change of scale, as the depth is in pixels.
    """
    return blob.bays


def normalised_moment(name: str) -> Callable[[Outline], float]:
    """The descriptor of one central normalised moment of the area, `nu20` to `nu03`.

    Keeps under translation and scale. Turns with the whole; those of a half are taken with the main axis
    upright and so keep under rotation.
    """

    place = MOMENTS.index(name)

    def moment(blob: Outline) -> float:
        return blob.moments[place]

    moment.__name__ = name
    return moment


@dataclass(frozen=True, slots=True)
class Descriptor:
    """A row of a table: its name, its function, and what it keeps under, of "translation", "rotation" and
    "scale" (as far as pixels allow)."""

    name: str
    compute: Callable[[Outline], float]
    invariant: frozenset[str]


@dataclass(frozen=True, slots=True)
class Formulas:
    """A table of descriptors: `forms` of its own, then the moments, which all tables have. By `simplified` of
    its perimeter the whole's outline is simplified first."""

    forms: tuple[Descriptor, ...]
    simplified: float = 0.0

    @property
    def rows(self) -> tuple[Descriptor, ...]:
        """All descriptors, in order."""
        return (*self.forms, *_MOMENTS)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all descriptors, in order."""
        return tuple(row.name for row in self.rows)


_MOVED = frozenset({"translation"})
_TURNED = _MOVED | {"rotation"}
_SCALED = _MOVED | {"scale"}
_ALL = _TURNED | _SCALED
_MOMENTS = tuple(Descriptor(name, normalised_moment(name), _SCALED) for name in MOMENTS)
FORMULAS: Mapping[str, Formulas] = {
    SHAPE: Formulas(
        (
            Descriptor("area", area, _TURNED),
            Descriptor("convexity", squared_convexity, _ALL),
            Descriptor("eccentricity", ellipse_eccentricity, _ALL),
            Descriptor("compactness", compactness, _ALL),
            Descriptor("circularity", circularity, _ALL),
            Descriptor("squareness", squareness, _ALL),
            Descriptor("convexity_defects", convexity_defects, _TURNED),
        )
    ),
    BLOB: Formulas(
        (
            Descriptor("area", area, _TURNED),
            Descriptor("convexity", convexity, _ALL),
            Descriptor("eccentricity", rectangle_eccentricity, _ALL),
            Descriptor("compactness", plain_compactness, _ALL),
            Descriptor("circularity", circularity, _ALL),
            Descriptor("squareness", squareness, _ALL),
            Descriptor("convexity_defects", convexity_defects, _TURNED),
        ),
        simplified=0.02,
    ),
}


@dataclass(frozen=True, slots=True)
class Descriptions:
    """The descriptors of a blob by name, in the order of their table: of the `whole` and of both halves."""

    whole: Mapping[str, float]
    top: Mapping[str, float]
    bottom: Mapping[str, float]
    formulas: str = field(default=DEFAULT)

    def vector(self, parts: Sequence[str] = PARTS, names: Sequence[str] | None = None) -> NDArray[np.float64]:
        """(len(parts) * len(names),) float64: the descriptors `names` (all without) of each of `parts`.

        Raises `PerceptionError` for an unknown part or descriptor.
        """
        wanted = tuple(self.whole) if names is None else names
        for part in parts:
            if part not in PARTS:
                raise PerceptionError(unknown("part of a blob", part, PARTS))
        for name in wanted:
            if name not in self.whole:
                raise PerceptionError(unknown("descriptor", name, self.whole))
        return np.array([getattr(self, part)[name] for part in parts for name in wanted])


def describe(mask: Mask, formulas: str = DEFAULT, contour: NDArray[np.int32] | None = None) -> Descriptions:
    """The descriptors of one blob.

    `mask` is (h, w) uint8 or bool, not 0 where the blob is; the crop may be wider than the blob. Of a blob in
    several pieces the largest is described; its holes count as filled. `formulas` names a table of
    `FORMULAS`. `contour` (n, 2), x and y in `mask`, is its outline where that is known. Raises
    `PerceptionError` for an unknown name, for what is no mask, and for an empty one.
    """
    table = FORMULAS.get(formulas)
    if table is None:
        raise PerceptionError(unknown("set of formulas", formulas, FORMULAS))
    if contour is None:
        blob = cropped(mask)
        whole = outline(blob)
    else:
        blob = pixels(mask)
        whole = Outline(contour[:, None])
    top, bottom = halves(blob, whole)
    if table.simplified:
        whole = whole.simplified(table.simplified)
    return Descriptions(_row(table, whole), _row(table, top), _row(table, bottom), formulas)


def _row(table: Formulas, blob: Outline) -> dict[str, float]:
    row = {form.name: form.compute(blob) for form in table.forms}
    row.update(zip(MOMENTS, blob.moments, strict=True))
    return row
