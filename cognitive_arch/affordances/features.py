"""What functions learned from trials look at: similarity of shapes, and where a thing stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import ndtr

from cognitive_arch.affordances.trials import EDGES, N_BINS, Floats, TrialTable
from cognitive_arch.errors import AffordanceError, unknown

MEASUREMENT_SIGMA = 0.015
"""Metres: how far off a measured displacement may be (two localisations of about a centimetre each)."""
ROBOT = (0.0, 0.0)
"""Where the robot stands in its root frame, metres."""


def described_by(table: TrialTable, names: Sequence[str]) -> TrialTable:
    """The trials with only these descriptors of things; raises `AffordanceError` for unknown ones."""
    for name in names:
        if name not in table.names_m or name not in table.names_o:
            known = [n for n in table.names_m if n in table.names_o]
            raise AffordanceError(unknown("descriptor", name, known))
    m, h, o = (
        [place for place, name in enumerate(all_) if name in names]
        for all_ in (table.names_m, table.names_h, table.names_o)
    )
    views_m, views_o = (
        None if views is None else {thing: shape[:, kept] for thing, shape in views.items()}
        for views, kept in ((table.views_m, m), (table.views_o, o))
    )
    return replace(
        table,
        shape_m=table.shape_m[:, m],
        shape_h=table.shape_h[:, h],
        shape_o=table.shape_o[:, o],
        names_m=tuple(table.names_m[place] for place in m),
        names_h=tuple(table.names_h[place] for place in h),
        names_o=tuple(table.names_o[place] for place in o),
        views_m=views_m,
        views_o=views_o,
    )


def soft_bins(effect: Floats, sigma: float = MEASUREMENT_SIGMA) -> Floats:
    """p(bin | measured effect) for effects (n,) in metres: (n, 5).

    An effect near an edge counts for both bins, so that a function learned from few trials knows that bins
    are ordered and where their edges are.
    """
    cumulated = ndtr((np.asarray(EDGES)[None] - effect[:, None]) / sigma)
    padded = np.column_stack([np.zeros(len(effect)), cumulated, np.ones(len(effect))])
    return np.diff(padded, axis=1).reshape(len(effect), N_BINS)


def polar(start: Floats) -> Floats:
    """Distance (m) and bearing (rad, left is negative) from the robot of places (n, 2); NaN stays NaN."""
    x, y = start[:, 0] - ROBOT[0], start[:, 1] - ROBOT[1]
    return np.column_stack([np.hypot(x, y), np.arctan2(y, -x)])


@dataclass(frozen=True, eq=False)
class Scaling:
    """`(values - centre) / width`, clipped to +-`limit`; NaN becomes 0, the centre."""

    centre: Floats
    width: Floats
    limit: float

    @classmethod
    def of(cls, values: Floats, limit: float, robust: bool = False) -> Scaling:
        """Centre and width of `values` (n, d): mean and standard deviation, or their robust counterparts
        (places of things that slipped out of sight are metres away)."""
        # A column of which nothing is known stays at 0.
        known = np.where(np.isfinite(values).any(axis=0), values, 0.0)
        if robust:
            centre = np.nanmedian(known, axis=0)
            width = 1.4826 * np.nanmedian(np.abs(known - centre), axis=0)
            # Where more than half of the values are the same, as with a few marked places.
            most = np.clip(known, *np.nanpercentile(known, (5, 95), axis=0))
            width = np.where(width > 1e-9, width, np.nanstd(most, axis=0))
        else:
            centre, width = np.nanmean(known, axis=0), np.nanstd(known, axis=0)
        return cls(centre, np.where(width > 1e-9, width, 1.0), limit)

    def __call__(self, values: Floats) -> Floats:
        """Scaled values (n, d)."""
        scaled = np.clip((values - self.centre) / self.width, -self.limit, self.limit)
        return np.where(np.isnan(scaled), 0.0, scaled)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {"centre": self.centre.tolist(), "width": self.width.tolist(), "limit": self.limit}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Scaling:
        """From `to_json`."""
        return cls(np.array(data["centre"]), np.array(data["width"]), float(data["limit"]))


@dataclass(frozen=True, eq=False)
class Similarity:
    """Features whose inner products are a Gaussian kernel, exact at `centres` (c, d) (Nystroem).

    Something unlike every centre has features near zero: nothing is then known of it beyond what holds for
    all. `root` (c, c) is the inverse square root of the kernel among the centres.
    """

    centres: Floats
    root: Floats
    length: float

    @classmethod
    def of(cls, values: Floats, length: float, most: int) -> Similarity:
        """Centres are the different rows of `values` (n, d), or, if there are more than `most`, the middles
        of that many clusters."""
        centres = np.unique(values, axis=0)
        if len(centres) > most:
            from sklearn.cluster import KMeans

            centres = KMeans(most, n_init=1, random_state=0).fit(values).cluster_centers_
        return cls.at(centres, length)

    @classmethod
    def at(cls, centres: Floats, length: float) -> Similarity:
        """With these centres (c, d)."""
        roots, axes = np.linalg.eigh(_kernel(centres, centres, length))
        return cls(centres, axes / np.sqrt(np.maximum(roots, 1e-6)), length)

    def nearest(self, values: Floats) -> Floats:
        """The likeness of `values` (n, d) to the centre that is most like them, (n,), 0..1."""
        best: Floats = _kernel(values, self.centres, self.length).max(axis=1)
        return best

    def __call__(self, values: Floats) -> Floats:
        """Features (n, c) of `values` (n, d)."""
        features: Floats = _kernel(values, self.centres, self.length) @ self.root
        return features

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {"centres": self.centres.tolist(), "root": self.root.tolist(), "length": self.length}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Similarity:
        """From `to_json`."""
        return cls(np.array(data["centres"]), np.array(data["root"]), float(data["length"]))


def _kernel(a: Floats, b: Floats, length: float) -> Floats:
    square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    kernel: Floats = np.exp(-0.5 * np.maximum(square, 0.0) / length**2)
    return kernel


def products(a: Floats, b: Floats) -> Floats:
    """All products of a column of `a` (n, i) with one of `b` (n, j): (n, i * j)."""
    return (a[:, :, None] * b[:, None, :]).reshape(len(a), -1)
