"""From one look with colour and depth to detections: which things may be where.

What rises above the table is cut into regions where colour or height change at a step. Each region is
recognised by its look and fitted with the shapes of the things that it may be; both together tell how likely
it is each of them. What lies under something else shows a rim at most, and is left to memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.perception.camera import Camera
from cognitive_arch.perception.pose import PoseEstimate, estimate_pose
from cognitive_arch.perception.segmentation import DepthSegmenter
from cognitive_arch.shapes import Shape

Mask = NDArray[np.bool_]  # (height, width)
Classify = Callable[[NDArray[np.uint8], Mask], list[tuple[str, float]]]
UNKNOWN = "unknown"

SMOOTH, SMOOTH_DEPTH = 3, 5  # pixels; side of the square of which the median counts
STEP = 0.006  # m of height between neighbouring pixels of different things
SHADE = 0.02  # of chromaticity between neighbouring pixels of different things
DARK = 120.0  # sum of the three colours below which chromaticity means less
SMALLEST = 40  # pixels
NEARER = 0.006  # m by which what covers an edge is nearer
MISFIT = 0.003  # m of residual at which a shape becomes unlikely
SEEN = 0.25  # of a thing, below which its place is not told
WHOLE = 0.9  # of a thing, from which on its shape is taken to be in view
SURE = 0.5  # probability from which on a region is taken to be one thing
SLACK = 0.002  # m below a thing's underside that may still be its own
POSSIBLE = 1e-3  # probability below which a label is not tried


@dataclass(frozen=True, slots=True)
class Region:
    """Pixels of one thing, as far as one can tell: `mask` (height, width), the places of all of them,
    `surface` (n, 3), and of those at its own edges, `outline` (m, 3), metres."""

    mask: Mask
    surface: NDArray[np.float64]
    outline: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What a region would be as a certain thing."""

    probability: float
    estimate: PoseEstimate


@dataclass(frozen=True, slots=True)
class Sighting:
    """A region and what it may be, by name, and how likely it is something else."""

    region: Region
    hypotheses: Mapping[str, Hypothesis]
    unknown: float

    @property
    def glimpse(self) -> bool:
        """Whether so little is seen that its place cannot be told."""
        name = self.label
        return name != UNKNOWN and self.hypotheses[name].estimate.seen < SEEN

    @property
    def whole(self) -> bool:
        """Whether it is known, and nearly all of it in view."""
        name = self.label
        return name != UNKNOWN and self.hypotheses[name].estimate.seen > WHOLE

    @property
    def chance(self) -> float:
        """How likely it is what it most likely is, 0 for something unknown."""
        return 0.0 if self.label == UNKNOWN else self.hypotheses[self.label].probability

    @property
    def label(self) -> str:
        """What it is most likely."""
        best = max(self.hypotheses.items(), key=lambda item: item[1].probability, default=None)
        return best[0] if best is not None and best[1].probability > self.unknown else UNKNOWN


class SceneView:
    """One look at a table of a known height (m): colour (height, width, 3), depth (height, width) in metres,
    and the robot's own body in it, (height, width). Of a `noisy` one the noise of single pixels is taken from
    the depth, which costs slim things a pixel of their outline."""

    def __init__(
        self,
        color: NDArray[np.uint8],
        depth: NDArray[np.float32],
        own: Mask,
        camera: Camera,
        table: float,
        noisy: bool = False,
    ) -> None:
        self.color, self.own, self.camera, self.table = color, own, camera, table
        self.depth = np.asarray(depth, np.float32)
        if noisy:
            self.depth = np.asarray(cv2.medianBlur(self.depth, SMOOTH_DEPTH), np.float32)
        self.points = camera.points(self.depth)

    def raised(self) -> Mask:
        """What rises above the table and is not the robot itself."""
        segmenter = DepthSegmenter(self.camera, self.table)
        return segmenter.segment(self.color, self.own, self.depth) > 0

    def regions(self) -> Iterator[Region]:
        """The things in view, cut apart."""
        raised = self.raised()
        x, y, width, height = cv2.boundingRect(raised.view(np.uint8))
        if width == 0:
            return
        rows, columns = slice(y, y + height), slice(x, x + width)
        core = raised[rows, columns] & ~self._steps(rows, columns)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(core.view(np.uint8), connectivity=4)
        for label in range(1, count):
            if stats[label, cv2.CC_STAT_AREA] < SMALLEST:
                continue
            mask = np.zeros(raised.shape, np.bool_)
            mask[rows, columns] = labels == label
            yield self.region(_grown(mask, raised))

    def _steps(self, rows: slice, columns: slice) -> Mask:
        """Where colour or height differ from the pixel to the left or above."""
        # On a dark side two grey levels of noise are as large as a step.
        color = cv2.medianBlur(self.color[rows, columns], SMOOTH).astype(np.float32)
        total = color.sum(axis=2) + 1e-3
        chroma = color[:, :, :2] / total[:, :, None]
        lit = np.minimum(total / DARK, 1.0)
        z = np.nan_to_num(self.points[rows, columns, 2], nan=-1.0)
        found = np.zeros(z.shape, np.bool_)
        for axis in (0, 1):
            after, before = [slice(None)] * 2, [slice(None)] * 2
            after[axis], before[axis] = slice(1, None), slice(None, -1)
            a, b = tuple(after), tuple(before)
            shade = np.abs(chroma[a] - chroma[b]).max(axis=2) * np.minimum(lit[a], lit[b])
            found[a] |= (shade > SHADE) | (np.abs(z[a] - z[b]) > STEP)
        return found

    def region(self, mask: Mask) -> Region:
        """The places of these pixels, and of those at their own edges."""
        inner = cv2.erode(mask.view(np.uint8), np.ones((3, 3), np.uint8), borderValue=0)
        edge = mask & (inner == 0)
        edge[[0, -1]] = edge[:, [0, -1]] = False  # where the image ends the thing may go on
        rows, columns = np.nonzero(edge)
        covered = np.zeros(len(rows), np.bool_)
        own_depth = self.depth[rows, columns]
        for dy in (-2, 0, 2):
            for dx in (-2, 0, 2):
                r = np.clip(rows + dy, 0, mask.shape[0] - 1)
                c = np.clip(columns + dx, 0, mask.shape[1] - 1)
                covered |= ~mask[r, c] & (self.depth[r, c] < own_depth - NEARER)
        outline = self.points[rows[~covered], columns[~covered]].astype(np.float64)
        return Region(mask, self.points[mask].astype(np.float64), outline)

    def bare(self, places: NDArray[np.float64]) -> Mask:
        """Whether one sees that there is nothing at `places` (n, 3), m, because one sees past them, (n,)."""
        pixels = np.rint(self.camera.project(places))
        width, height = self.camera.size
        inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] < width) & (pixels[:, 1] < height)
        columns, rows = pixels[inside].astype(np.int64).T
        expected = ((places[inside] - self.camera.position) @ self.camera.X_WC[:3, :3])[:, 2]
        found = np.zeros(len(places), np.bool_)
        found[inside] = ~self.own[rows, columns] & (self.depth[rows, columns] > expected + NEARER)
        return found

    def union(self, one: Region, other: Region) -> Region:
        """Two regions as one."""
        return Region(
            one.mask | other.mask,
            np.vstack([one.surface, other.surface]),
            np.vstack([one.outline, other.outline]),
        )


def _grown(mask: Mask, raised: Mask) -> Mask:
    """With the pixels back that were lost to the step at its edge."""
    wider = cv2.dilate(mask.view(np.uint8), np.array([[0, 0, 0], [0, 1, 1], [0, 1, 1]], np.uint8))
    return (wider > 0) & raised


def sightings(view: SceneView, classify: Classify, shapes: Mapping[str, Shape]) -> list[Sighting]:
    """What is in view. `shapes` are those of all things that there may be; `classify` names regions."""
    found = [part for region in view.regions() for part in _layers(view, region, classify, shapes)]
    return _joined(found, view, shapes)


def _layers(
    view: SceneView, region: Region, classify: Classify, shapes: Mapping[str, Shape]
) -> list[Sighting]:
    """The region as one thing; or, where that fits nothing, as a thing on top of others.

    Layers of one colour, or with dark sides, are not cut apart by any step: a slice from above shows which
    thing is on top, and what is below its underside is something else.
    """
    whole = _sighting(view, region, classify, shapes)
    if whole.chance > SURE:
        return [whole]
    height, top = view.points[:, :, 2], _top(region)
    slices = []
    for thickness in sorted({shape.height for shape in shapes.values()}):
        part = region.mask & (height > top - thickness - SLACK)
        if SMALLEST <= np.count_nonzero(part) <= np.count_nonzero(region.mask) - SMALLEST:
            one = _sighting(view, view.region(part), classify, shapes)
            if one.chance > SURE and shapes[one.label].height >= thickness:
                slices.append(one)
    if not slices:
        return [whole]
    above = max(slices, key=lambda one: one.chance)
    lower = region.mask & (height < top - shapes[above.label].height - SLACK)
    if np.count_nonzero(lower) < SMALLEST:
        return [whole]
    above = replace(above, region=view.region(region.mask & ~lower))
    return [above, *_layers(view, view.region(lower), classify, shapes)]


def _sighting(view: SceneView, region: Region, classify: Classify, shapes: Mapping[str, Shape]) -> Sighting:
    likely = dict(classify(view.color, region.mask))
    known = {name: p for name, p in likely.items() if name in shapes and p > POSSIBLE}
    unknown = 1.0 - sum(known.values())
    hypotheses = _fitted(view, known, region, shapes)
    # What the recogniser never learned is told by its shape alone, from what it calls unknown.
    if unknown > POSSIBLE:
        strangers = _fitted(view, dict.fromkeys(set(shapes) - set(likely), 1.0), region, shapes)
        share = unknown / max(1.0, sum(fit.probability for fit in strangers.values()))
        for name, fit in sorted(strangers.items()):
            hypotheses[name] = Hypothesis(share * fit.probability, fit.estimate)
            unknown -= share * fit.probability
    return Sighting(region, hypotheses, max(unknown, POSSIBLE))


def _fitted(
    view: SceneView, likely: Mapping[str, float], region: Region, shapes: Mapping[str, Shape]
) -> dict[str, Hypothesis]:
    """What the region would be as each of the things, each as `likely` beforehand as it looks."""
    hypotheses = {}
    for name, probability in likely.items():
        estimate = estimate_pose(shapes[name], region.surface, region.outline, view.bare)
        if estimate is not None:
            fits = math.exp(-((estimate.residual / MISFIT) ** 2) / 2)
            hypotheses[name] = Hypothesis(probability * fits, estimate)
    return hypotheses


def _joined(found: list[Sighting], view: SceneView, shapes: Mapping[str, Shape]) -> list[Sighting]:
    """Things that something in front of them cuts in two, in one piece again."""
    kept: list[Sighting] = []
    for sighting in sorted(found, key=lambda s: -len(s.region.surface)):
        for n, other in enumerate(kept):
            whole = _whole(other, sighting, view, shapes)
            if whole is not None:
                kept[n] = whole
                break
        else:
            kept.append(sighting)
    return kept


def _whole(one: Sighting, other: Sighting, view: SceneView, shapes: Mapping[str, Shape]) -> Sighting | None:
    """Both as one, if what `one` most likely is covers both, at one height, and nothing else does better."""
    name = one.label
    if name == UNKNOWN or other.label not in (name, UNKNOWN):
        return None
    if abs(_top(one.region) - _top(other.region)) > STEP:
        return None
    region = view.union(one.region, other.region)
    estimate = estimate_pose(shapes[name], region.surface, region.outline, view.bare)
    if estimate is None or estimate.residual > MISFIT or estimate.seen < one.hypotheses[name].estimate.seen:
        return None
    hypotheses = {**one.hypotheses, name: Hypothesis(one.hypotheses[name].probability, estimate)}
    return Sighting(region, hypotheses, one.unknown)


def _top(region: Region) -> float:
    return float(np.percentile(region.surface[:, 2], 95))
