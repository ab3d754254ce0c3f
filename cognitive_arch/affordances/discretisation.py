"""Levels of what is measured: equally frequent bins, fitted on training data only (thesis Sec. 5.3.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cognitive_arch.affordances.trials import Floats, Ints
from cognitive_arch.errors import AffordanceError

LEVELS = ("L", "M", "H")
"""Low, medium, high: the three levels of a descriptor (thesis Sec. 3.3.1)."""


@dataclass(frozen=True, eq=False)
class Discretisation:
    """`edges` (d, levels - 1): between the levels of each of d columns, ascending in each row."""

    edges: Floats

    @classmethod
    def fit(cls, values: Floats, levels: int) -> Discretisation:
        """Equally frequent levels of each column of `values` (n, d); NaN is left out.

        Where many values are the same, edges lie between different values, so that a level may stay
        empty but two values that differ more than others are not put together.
        """
        if levels < 2:
            raise AffordanceError(f"{levels} levels; valid: at least 2")
        edges = np.zeros((values.shape[1], levels - 1))
        for column in range(values.shape[1]):
            known = np.sort(values[:, column][~np.isnan(values[:, column])])
            if not len(known):
                raise AffordanceError(f"descriptor {column + 1} is missing in every trial")
            edges[column] = [_cut(known, part / levels) for part in range(1, levels)]
        return cls(np.maximum.accumulate(edges, axis=1))

    @property
    def levels(self) -> int:
        """Number of levels."""
        return self.edges.shape[1] + 1

    def __call__(self, values: Floats) -> Ints:
        """Levels 0.. of `values` (n, d); -1 where a value is NaN. Values beyond the training range belong
        to the outermost level on their side."""
        levels = (values[:, :, None] >= self.edges[None]).sum(axis=2)
        return np.where(np.isnan(values), -1, levels).astype(np.int64)


def _cut(known: Floats, part: float) -> float:
    """The gap between different values that is nearest to the quantile `part` of sorted values."""
    gaps = np.flatnonzero(np.diff(known) > 0)
    if not len(gaps):
        return float(known[0])
    gap = int(gaps[np.argmin(np.abs((gaps + 1) / len(known) - part))])
    return float((known[gap] + known[gap + 1]) / 2)
