"""Principal components of blocks of descriptors (thesis Sec. 5.3.2, Figs. 39 and 43)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cognitive_arch.affordances.trials import Floats
from cognitive_arch.errors import AffordanceError


@dataclass(frozen=True, eq=False)
class Components:
    """`mean` (d,), `axes` (k, d), and `share` (k,): the part of the variance each explains."""

    mean: Floats
    axes: Floats
    share: Floats

    @classmethod
    def fit(cls, values: Floats, count: int) -> Components:
        """The `count` main components of `values` (n, d), computed on the values as they are (not scaled).

        The sign of an axis is fixed by its largest entry, so that equal data give equal networks.
        """
        if not 1 <= count <= values.shape[1]:
            raise AffordanceError(f"{count} components of {values.shape[1]} descriptors")
        mean = values.mean(axis=0)
        _, singular, axes = np.linalg.svd(values - mean, full_matrices=False)
        axes = np.vstack([axes, np.zeros((max(0, count - len(axes)), values.shape[1]))])[:count]
        largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1)
        variance = np.zeros(count)
        variance[: len(singular[:count])] = singular[:count] ** 2
        total = float((singular**2).sum())
        return cls(mean, axes * np.where(largest < 0, -1.0, 1.0), variance / total if total else variance)

    def __call__(self, values: Floats) -> Floats:
        """Coefficients (n, k) of `values` (n, d)."""
        coefficients: Floats = (values - self.mean) @ self.axes.T
        return coefficients
