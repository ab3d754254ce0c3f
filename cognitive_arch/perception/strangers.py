"""Things that are seen and are none of those that may be there: what encloses them is to be kept clear of.

Each is a box that stands upright and encloses what is seen of it. One that is hidden is remembered where it
was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.perception.pose import outline_distance
from cognitive_arch.shapes import Box, Shape
from cognitive_arch.world.tracking import Place, Pose, check_pose

Thing = tuple[Shape, Pose]

LEAST = 80  # places on its surface that make a stranger, not a rim or a sliver
SHORTEST = 0.010  # m that it is long at least
ROUND = 0.008  # m around a known thing that still belong to it
OWN = 0.5  # of its places: where more are on a known thing, it is a piece of that
HIGHEST = 99.0  # percentile of heights that counts as its upper side
MOST = (0.5, 99.5)  # percentiles of places along a side between which the box is: the rest is noise
SHRUNK = 0.9  # of the area that it covered: below, a part of it is hidden
ANGLES = np.arange(0.0, math.pi / 2, math.radians(3))  # of the box's sides, to choose from


@dataclass(frozen=True)
class Stranger:
    """A box, and where its middle is, (4, 4) in the root frame, m."""

    shape: Box
    pose: Pose


def enclosing(surface: NDArray[np.float64], bottom: float) -> Stranger:
    """The smallest upright box around nearly all of places (n, 3), from a height (m) upwards."""
    best: tuple[float, float, NDArray[np.float64], NDArray[np.float64]] | None = None
    for angle in ANGLES:
        c, s = math.cos(angle), math.sin(angle)
        turned = surface[:, :2] @ np.array(((c, -s), (s, c)))
        low, high = np.percentile(turned, MOST, axis=0)
        area = float(np.prod(high - low))
        if best is None or area < best[0]:
            best = area, float(angle), low, high
    assert best is not None
    _, angle, low, high = best
    c, s = math.cos(angle), math.sin(angle)
    top = float(np.percentile(surface[:, 2], HIGHEST))
    x, y, z = (min(max(size, 1e-3), 2.0) for size in (*(high - low), top - bottom))
    pose = np.eye(4)
    pose[:2, :2] = ((c, -s), (s, c))
    pose[:2, 3] = pose[:2, :2] @ ((low + high) / 2)
    pose[2, 3] = bottom + z / 2
    return Stranger(Box(type="box", size=(x, y, z)), pose)


@dataclass
class Strangers:
    """Those that are believed to be there, on a table of that height (m)."""

    table: float
    known: list[Stranger] = field(default_factory=list)

    def update(
        self,
        nameless: Sequence[NDArray[np.float64]],
        things: Sequence[Thing],
        place: Callable[[Shape, Pose], Place],
    ) -> None:
        """Fold one look in: `nameless` are the places (n, 3) on what was seen and not known, `things` what is
        believed to be where; `place` tells what is to be seen where something should be."""
        seen = []
        for surface in nameless:
            if len(surface) < LEAST or _on(surface, things).mean() > OWN:
                continue
            stranger = enclosing(surface, _floor(surface, things, self.table))
            if max(stranger.shape.extent) >= SHORTEST:
                seen.append(stranger)
        for old in self.known:
            same = [new for new in seen if _overlap(old, new)]
            found = place(old.shape, old.pose)
            if not same and found is Place.HIDDEN:
                seen.append(old)
            # Of what something stands in front of, less is seen than was before.
            elif len(same) == 1 and _area(same[0]) < SHRUNK * _area(old) and found is not Place.EMPTY:
                seen[:] = [old if one is same[0] else one for one in seen]
        self.known = seen

    def named(self) -> dict[str, Stranger]:
        """With names that no thing has."""
        return {f"?{n}": stranger for n, stranger in enumerate(self.known, start=1)}

    def to_json(self) -> list[dict[str, Any]]:
        """Plain data; `restore` reads it back."""
        return [{"size": list(one.shape.size), "pose": one.pose.tolist()} for one in self.known]

    def restore(self, saved: Sequence[Mapping[str, Any]]) -> None:
        """The inverse of `to_json`; raises `ValueError` for what is none."""
        known = [
            Stranger(Box(type="box", size=tuple(row["size"])), np.array(row["pose"], float)) for row in saved
        ]
        for one in known:
            check_pose(one.pose)
        self.known = known


def _on(surface: NDArray[np.float64], things: Iterable[Thing]) -> NDArray[np.bool_]:
    """Which places are on known things, or next to them."""
    found = np.zeros(len(surface), np.bool_)
    for shape, pose in things:
        local = (surface - pose[:3, 3]) @ pose[:3, :3]
        level = np.abs(local[:, 2]) < shape.height / 2 + ROUND
        found |= level & (outline_distance(shape)(local[:, :2]) < ROUND)
    return found


def _floor(surface: NDArray[np.float64], things: Iterable[Thing], table: float) -> float:
    """Height of what something stands on: of a known thing below it, or of the table."""
    lowest, middle = float(surface[:, 2].min()), np.median(surface[:, :2], axis=0)
    floor = table
    for shape, pose in things:
        top = float(pose[2, 3]) + shape.height / 2
        if top < lowest + ROUND and math.dist(middle, pose[:2, 3]) < min(shape.extent) / 2:
            floor = max(floor, top)
    return floor


def _area(stranger: Stranger) -> float:
    return math.prod(stranger.shape.extent)


def _overlap(one: Stranger, other: Stranger) -> bool:
    """Whether both may be the same: their middles are within one of them."""
    apart = math.dist(one.pose[:2, 3], other.pose[:2, 3])
    return apart < max(*one.shape.extent, *other.shape.extent) / 2
