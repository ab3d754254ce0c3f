"""What every model of effects can do, and how the joint distribution of both effects is made of marginals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.affordances.trials import ACTIONS, N_BINS, Floats, TrialTable

SWEEPS = 30
SHRINK = 50.0
"""Pseudo-trials for independence of the two effects, per action."""
STILL = 2
"""The bin of no movement."""


class EffectModel(Protocol):
    """p(EffectX, EffectY | action, manipulator, object, start), learned from a table of trials."""

    @classmethod
    def fit(cls, table: TrialTable, rng: np.random.Generator) -> Self:
        """Learn from trials."""

    def joint(self, table: TrialTable) -> Floats:
        """The distribution of each trial's effects, (n, 5, 5): x (longitudinal) first, then y."""

    def counts(self, start: Floats) -> NDArray[np.bool_]:
        """Whether it makes a difference that things stand at these places (n, 2), (n,)."""

    def update(self, table: TrialTable, rng: np.random.Generator) -> None:
        """Learn from further trials, be it a single one."""

    def to_json(self) -> dict[str, Any]:
        """Plain data, from which `from_json` makes an equal model."""

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """The model `to_json` described."""


def marginals_of(joint: Floats) -> Floats:
    """p(bin) along x and along y, (n, 2, 5), of (n, 5, 5)."""
    return np.stack([joint.sum(axis=2), joint.sum(axis=1)], axis=1)


def coupling(marginals: Floats, table: TrialTable) -> Floats:
    """How much more often than by independence two bins came together, per action, (actions, 5, 5).

    `marginals` (n, 2, 5) are predictions for the trials of `table` that were made without them. What is told
    apart is only whether the thing moved along each axis: 25 ratios per action follow chance rather than
    anything else, even from a thousand trials.
    """
    moved = np.arange(N_BINS) != STILL
    still = np.stack([moved, ~moved], axis=1).astype(np.float64)
    ratio = np.ones((len(ACTIONS), N_BINS, N_BINS))
    for action in range(len(ACTIONS)):
        rows = table.action == action
        if not rows.any():
            continue
        expected = np.einsum("ni,nj->ij", marginals[rows, 0] @ still, marginals[rows, 1] @ still)
        share = expected / expected.sum()
        seen = np.zeros((2, 2))
        np.add.at(seen, tuple((table.bins[rows] == STILL).astype(int).T), 1.0)
        ratio[action] = still @ ((seen + SHRINK * share) / (expected + SHRINK * share)) @ still.T
    return ratio


def coupled(marginals: Floats, ratio: Floats) -> Floats:
    """Joint distributions (n, 5, 5) with exactly these marginals (n, 2, 5) and the dependence `ratio`
    (n, 5, 5), by iterative proportional fitting."""
    joint = np.einsum("ni,nj->nij", marginals[:, 0], marginals[:, 1]) * ratio
    for _ in range(SWEEPS):
        joint *= (marginals[:, 0] / np.maximum(joint.sum(axis=2), 1e-300))[:, :, None]
        joint *= (marginals[:, 1] / np.maximum(joint.sum(axis=1), 1e-300))[:, None, :]
    normalised: Floats = joint / joint.sum(axis=(1, 2), keepdims=True)
    return normalised
