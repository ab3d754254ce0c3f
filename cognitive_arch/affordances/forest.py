"""p(effect | action, manipulator, object, start) as an ensemble of tree-structured CPDs.

Each tree asks for the action, descriptors and the place, and holds a distribution in every leaf. scikit-learn
grows them; they are kept and read as plain arrays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cognitive_arch.affordances.features import polar, soft_bins
from cognitive_arch.affordances.trials import ACTIONS, N_BINS, Floats, Ints, TrialTable

LEAF = -1
TREES = 50


@dataclass(frozen=True, eq=False)
class ForestCPD:
    """All nodes of all trees in one row: `feature` (n,) or `LEAF`, `threshold` (n,), `left`, `right` (n,)
    numbers of nodes, `value` (n, 10) both axes' distributions; `roots` (trees,). `with_start` says whether
    the place is looked at. Every trial to predict needs its place then."""

    feature: Ints
    threshold: Floats
    left: Ints
    right: Ints
    value: Floats
    roots: Ints
    with_start: bool

    @classmethod
    def fit(
        cls,
        table: TrialTable,
        rng: np.random.Generator,
        trees: int = TREES,
        leaf: int = 3,
        with_start: bool | None = None,
    ) -> ForestCPD:
        """Grow trees with at least `leaf` trials in every leaf on both axes at once.

        They look at the place if it is known of every trial, unless `with_start` says otherwise.
        """
        from sklearn.ensemble import RandomForestRegressor

        with_start = table.has_start if with_start is None else with_start
        grown = RandomForestRegressor(
            trees, min_samples_leaf=leaf, max_features=0.5, random_state=int(rng.integers(2**31))
        ).fit(
            _inputs(table, with_start),
            np.hstack([soft_bins(table.effect[:, axis]) for axis in range(2)]),
        )
        parts = [estimator.tree_ for estimator in grown.estimators_]
        offsets = np.cumsum([0, *(part.node_count for part in parts)])[:-1]
        inner = [part.children_left >= 0 for part in parts]
        shifted = list(zip(parts, offsets, inner, strict=True))
        return cls(
            np.concatenate([np.where(i, p.feature, LEAF) for p, _, i in shifted]),
            np.concatenate([p.threshold for p in parts]),
            np.concatenate([np.where(i, p.children_left + o, LEAF) for p, o, i in shifted]),
            np.concatenate([np.where(i, p.children_right + o, LEAF) for p, o, i in shifted]),
            np.concatenate([p.value[:, :, 0] for p in parts]),
            np.asarray(offsets, dtype=np.int64),
            with_start,
        )

    def marginals(self, table: TrialTable) -> Floats:
        """p(bin) along x and y of each row, (n, 2, 5)."""
        inputs = _inputs(table, self.with_start).astype(np.float32)  # as scikit-learn compares them
        answer = np.zeros((len(table), 2 * N_BINS))
        for root in self.roots:
            at = np.full(len(table), root)
            going = np.arange(len(table))
            while len(going):
                node = at[going]
                going = going[self.feature[node] != LEAF]
                node = at[going]
                to_left = inputs[going, self.feature[node]] <= self.threshold[node]
                at[going] = np.where(to_left, self.left[node], self.right[node])
            answer += self.value[at]
        return (answer / len(self.roots)).reshape(len(table), 2, N_BINS)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        arrays = ("feature", "threshold", "left", "right", "roots")
        # Only leaves are asked for their distributions.
        value = np.where(self.feature[:, None] == LEAF, self.value, 0.0)
        return {
            **{name: getattr(self, name).tolist() for name in arrays},
            "value": np.round(value, 4).tolist(),
            "with_start": self.with_start,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> ForestCPD:
        """From `to_json`."""
        return cls(
            **{name: np.array(data[name], np.int64) for name in ("feature", "left", "right", "roots")},
            threshold=np.array(data["threshold"]),
            value=np.array(data["value"]),
            with_start=bool(data["with_start"]),
        )


def _inputs(table: TrialTable, with_start: bool) -> Floats:
    """What trees may ask for, (n, ...): action, descriptors, and where the thing stands, both ways."""
    parts = [np.eye(len(ACTIONS))[table.action], table.shape_m, table.shape_o]
    if with_start:
        parts += [table.start, polar(table.start)]
    return np.hstack(parts)
