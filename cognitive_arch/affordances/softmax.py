"""p(effect | action, manipulator, object, start) as a function: a hierarchical softmax over similarities.

In the network this is the CPD of an effect node. Each action has a distribution of its own; likeness of the
manipulator to those tried, likeness of the object, and the place relative to the robot shift it. Every shift
is a sum of one shared by all actions and one of this action, with Gaussian priors whose widths say how far
each may go; so few trials stay near the action's own distribution, and tools share what they have in common.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_softmax, softmax

from cognitive_arch.affordances.features import Scaling, Similarity, polar, products, soft_bins
from cognitive_arch.affordances.trials import ACTIONS, N_BINS, Floats, Ints, TrialTable

N_ACTIONS = len(ACTIONS)
LIKENESS = 1.4
"""Scale of descriptors before similarities are computed: two unlike shapes are about 2 apart."""


@dataclass(frozen=True)
class Priors:
    """Prior widths (standard deviations of weights), length scales and sizes.

    Manipulators are few and matter most, and what was learned of one carries far; objects matter less, and a
    shorter length keeps one that was never tried near the average of all. Within these orders of magnitude
    results hardly change with the values.
    """

    action: float = 3.0
    manipulator: float = 0.7
    object: float = 0.5
    start: float = 0.5
    shared: float = 0.7
    interplay: float = 0.5
    length_m: float = 2.0
    length_o: float = 0.5
    length_s: float = 1.0
    centres: int = 12


@dataclass(eq=False)
class SoftmaxCPD:
    """One CPD for each axis. `weights` (2, actions, features, bins)."""

    priors: Priors
    scale_m: Scaling
    scale_o: Scaling
    scale_s: Scaling
    like_m: Similarity
    like_o: Similarity
    like_s: Similarity
    weights: Floats

    @classmethod
    def fit(cls, table: TrialTable, priors: Priors = Priors(), start: SoftmaxCPD | None = None) -> SoftmaxCPD:
        """Maximum a posteriori weights; `start` gives the optimiser a guess (the result is the same)."""
        place = polar(table.start)
        scale_m, scale_o = Scaling.of(table.shape_m, 3.0), Scaling.of(table.shape_o, 3.0)
        scale_s = Scaling.of(place, 2.5, robust=True)
        cpd = cls(
            priors,
            scale_m,
            scale_o,
            scale_s,
            Similarity.of(_shape(scale_m, table.shape_m), priors.length_m, priors.centres),
            Similarity.of(_shape(scale_o, table.shape_o), priors.length_o, priors.centres),
            Similarity.of(scale_s(place), priors.length_s, priors.centres),
            np.zeros(0),
        )
        features, own, shared = cpd._features(table)
        guess = None
        if start is not None and start.weights.shape[2] == features.shape[1]:
            guess = start.weights
        cpd.weights = np.stack(
            [
                _maximise(
                    features,
                    table.action,
                    soft_bins(table.effect[:, axis]),
                    own,
                    shared,
                    None if guess is None else guess[axis],
                )
                for axis in range(2)
            ]
        )
        return cpd

    def _features(self, table: TrialTable) -> tuple[Floats, Floats, Floats]:
        """Features (n, d), and for each the prior width of its own (per action) and its shared weight."""
        p, n = self.priors, len(table)
        m = self.like_m(_shape(self.scale_m, table.shape_m))
        o = self.like_o(_shape(self.scale_o, table.shape_o))
        place = polar(table.start)
        z = self.scale_s(place)
        s = np.hstack([0.5 * z, self.like_s(z)])
        s[~np.isfinite(place).all(axis=1)] = 0.0
        blocks = [
            (np.ones((n, 1)), p.action, 0.0),
            (m, p.manipulator, p.manipulator * p.shared),
            (o, p.object, p.object * p.shared),
        ]
        if np.isfinite(self.scale_s.centre).all() and (self.scale_s.width != 1.0).any():
            blocks += [
                (s, p.start, p.start * p.shared),
                (products(m, s[:, :2]), p.start * 2 * p.interplay, 0.0),
            ]
        widths = [(np.full(b.shape[1], own), np.full(b.shape[1], shared)) for b, own, shared in blocks]
        return (
            np.hstack([b for b, _, _ in blocks]),
            np.concatenate([own for own, _ in widths]),
            np.concatenate([shared for _, shared in widths]),
        )

    def familiarity(self, table: TrialTable) -> Floats:
        """How like the things of each row are to those tried, (n,): 1 the same, 0 nothing of the kind."""
        m = self.like_m.nearest(_shape(self.scale_m, table.shape_m))
        o = self.like_o.nearest(_shape(self.scale_o, table.shape_o))
        return m * o

    def within(self, start: Floats) -> NDArray[np.bool_]:
        """Whether places (n, 2) lie where things were tried, (n,); False where they are not known."""
        scaled = (polar(start) - self.scale_s.centre) / self.scale_s.width
        return np.asarray((np.abs(scaled) <= self.scale_s.limit).all(axis=1))

    def marginals(self, table: TrialTable) -> Floats:
        """p(bin) along x and y of each row, (n, 2, 5)."""
        features, _, _ = self._features(table)
        answer = np.zeros((len(table), 2, N_BINS))
        for action in range(N_ACTIONS):
            rows = table.action == action
            for axis in range(2):
                answer[rows, axis] = softmax(features[rows] @ self.weights[axis, action], axis=1)
        return answer

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        parts = ("scale_m", "scale_o", "scale_s", "like_m", "like_o", "like_s")
        return {
            "priors": {f: getattr(self.priors, f) for f in Priors.__dataclass_fields__},
            **{part: getattr(self, part).to_json() for part in parts},
            "weights": self.weights.tolist(),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> SoftmaxCPD:
        """From `to_json`."""
        return cls(
            Priors(**data["priors"]),
            Scaling.from_json(data["scale_m"]),
            Scaling.from_json(data["scale_o"]),
            Scaling.from_json(data["scale_s"]),
            Similarity.from_json(data["like_m"]),
            Similarity.from_json(data["like_o"]),
            Similarity.from_json(data["like_s"]),
            np.array(data["weights"]),
        )


def _shape(scale: Scaling, shape: Floats) -> Floats:
    """Descriptors (n, d) so that likeness does not depend on how many there are."""
    scaled: Floats = scale(shape) * LIKENESS / np.sqrt(max(1, shape.shape[1]))
    return scaled


def _maximise(
    features: Floats, action: Ints, target: Floats, own: Floats, shared: Floats, guess: Floats | None
) -> Floats:
    """Weights (actions, d, bins) that maximise log p(target) + log prior.

    A weight of an action is a sum of independent Gaussians, own and shared, so their prior is that of the
    optimum over all ways to split it: both parts are optimised, in units of their widths.
    """
    d = features.shape[1]
    parts = [np.flatnonzero(action == a) for a in range(N_ACTIONS)]
    blocks = [features[rows] for rows in parts]
    targets = [target[rows] for rows in parts]
    some = shared > 0
    size = N_ACTIONS * d * N_BINS

    def split(flat: Floats) -> Floats:
        weights = flat[:size].reshape(N_ACTIONS, d, N_BINS) * own[:, None]
        common = np.zeros((d, N_BINS))
        common[some] = flat[size:].reshape(-1, N_BINS) * shared[some, None]
        return weights + common

    def loss(flat: Floats) -> tuple[float, Floats]:
        weights = split(flat)
        value, gradient = 0.5 * float(flat @ flat), np.zeros((N_ACTIONS, d, N_BINS))
        for a, (block, wanted) in enumerate(zip(blocks, targets, strict=True)):
            if len(block):
                log_p = log_softmax(block @ weights[a], axis=1)
                value -= float((wanted * log_p).sum())
                gradient[a] = block.T @ (np.exp(log_p) - wanted)
        common = gradient.sum(axis=0)[some] * shared[some, None]
        return value, flat + np.concatenate([(gradient * own[:, None]).ravel(), common.ravel()])

    first = np.zeros(size + int(some.sum()) * N_BINS)
    if guess is not None:
        first[:size] = (guess / own[:, None]).ravel() * 0.5
    found = minimize(loss, first, jac=True, method="L-BFGS-B", options={"maxiter": 200, "ftol": 1e-6})
    return split(found.x)
