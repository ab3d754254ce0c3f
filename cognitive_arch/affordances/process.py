"""p(effect | action, manipulator, object, start) by way of how far things go: Gaussian process regression.

Displacements are continuous and change smoothly with shapes: a broader bar taps a little farther. For each
action and axis the displacement is a Gaussian process over all descriptors and the place, with noise; the
probability of a bin is how much of the predicted normal distribution lies in it. So what is known of things
of other sizes carries over to one in between.

The process is approximated by Bayesian linear regression on likenesses to some of the trials (Nystroem); what
variance the approximation loses is given back, so that of something unlike everything tried little is said.
Length scale, noise and amplitude are those with the greatest evidence (Rasmussen and Williams 2006, Ch. 5),
amplitudes under an inverse gamma prior around the spread of all actions' effects together: of an action tried
once or twice the spread is not what these trials happen to show. Rows of one trial (views) count as one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtr

from cognitive_arch.affordances.features import Scaling, Similarity, polar
from cognitive_arch.affordances.trials import ACTIONS, EDGES, N_BINS, Floats, TrialTable

LENGTHS = (0.7, 1.4, 2.8)
"""Length scales to choose from, times the root of the number of inputs."""
RATIOS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Of the variance of noise by that of the process, to choose from."""
RATIO_WIDTH = 1.5
"""Prior standard deviation of a ratio's logarithm: few trials cannot show that there is hardly any noise."""
CENTRES = 100
LIMIT = 3.0  # standard deviations; inputs are cut off there
LEAST_NOISE = 0.004
"""Metres, standard deviation: a floor, not an estimate, under what the evidence says of the noise. Two trials
that agree to the millimetre, as those of a simulation may, do not make the next one certain."""
FARTHEST = 0.03
"""Metres beyond the outermost edges at which displacements are cut off. The bin is the same, and one thing
that rolled away does not tell how far others go."""
PRIOR_TRIALS = 3.0
"""As how many trials the spread of all actions' effects counts in the spread of each, and their mean in its
mean; and `PRIOR_SPREAD` in the spread of all."""
PRIOR_SPREAD = 0.04
"""Metres, standard deviation of effects before anything was tried: about as wide as the bins."""


class Regression(NamedTuple):
    """Of each action and axis: `mean` (actions, 2), `weights` (actions, 2, c), their `covariance` (actions,
    2, c, c), variances of the process and of noise (actions, 2), in metres and square metres. What few trials
    leave open of the mean is part of the noise."""

    mean: Floats
    weights: Floats
    covariance: Floats
    process: Floats
    noise: Floats


@dataclass(frozen=True, eq=False)
class ProcessCPD:
    """`scale` and `like` make features of inputs: descriptors, and the place if `with_start`."""

    scale: Scaling
    like: Similarity
    found: Regression
    with_start: bool

    @classmethod
    def fit(cls, table: TrialTable, rng: np.random.Generator, with_start: bool | None = None) -> ProcessCPD:
        """The length scale is chosen for all actions, noise and amplitude for each action and axis.

        The place is looked at if it is known of every trial, unless `with_start` says otherwise.
        """
        with_start = table.has_start if with_start is None else with_start
        inputs = _inputs(table, with_start)
        scale = _scaling(table, with_start)
        scaled = scale(inputs)
        different = np.unique(scaled, axis=0)
        centres = different[np.sort(rng.permutation(len(different))[:CENTRES])]
        best: tuple[float, Similarity, Regression] | None = None
        for length in LENGTHS:
            like = Similarity.at(centres, length * np.sqrt(inputs.shape[1]))
            evidence, found = _regressed(like(scaled), table)
            if best is None or evidence > best[0]:
                best = evidence, like, found
        assert best is not None
        return cls(scale, best[1], best[2], with_start)

    def marginals(self, table: TrialTable) -> Floats:
        """p(bin) along x and y of each row, (n, 2, 5)."""
        features = self.like(self.scale(_inputs(table, self.with_start)))
        lost = np.maximum(1.0 - (features**2).sum(axis=1), 0.0)
        answer = np.zeros((len(table), 2, N_BINS))
        for action in np.unique(table.action):
            rows = table.action == action
            part = features[rows]
            for axis in range(2):
                mean = self.found.mean[action, axis] + part @ self.found.weights[action, axis]
                spread = ((part @ self.found.covariance[action, axis]) * part).sum(axis=1)
                variance = np.maximum(spread, 0.0) + self.found.process[action, axis] * lost[rows]
                variance += self.found.noise[action, axis]
                answer[rows, axis] = _in_bins(mean, np.sqrt(variance))
        return answer

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "scale": self.scale.to_json(),
            "like": self.like.to_json(),
            **{name: part.tolist() for name, part in self.found._asdict().items()},
            # Many numbers, on which little hangs but how sure the answers are.
            "covariance": [float(f"{value:.3g}") for value in self.found.covariance.ravel()],
            "with_start": self.with_start,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> ProcessCPD:
        """From `to_json`."""
        parts = {name: np.array(data[name], np.float64) for name in Regression._fields}
        weights = parts["weights"]
        parts["covariance"] = parts["covariance"].reshape(*weights.shape, weights.shape[2])
        return cls(
            Scaling.from_json(data["scale"]),
            Similarity.from_json(data["like"]),
            Regression(**parts),
            bool(data["with_start"]),
        )


def _inputs(table: TrialTable, with_start: bool) -> Floats:
    parts = [table.shape_m, table.shape_o]
    if with_start:
        parts.append(polar(table.start))
    return np.hstack(parts)


def _in_bins(mean: Floats, deviation: Floats) -> Floats:
    """How much of normal distributions (n,) lies in each bin, (n, 5)."""
    below = ndtr((np.asarray(EDGES)[None] - mean[:, None]) / deviation[:, None])
    padded = np.column_stack([np.zeros(len(mean)), below, np.ones(len(mean))])
    return np.diff(padded, axis=1).reshape(len(mean), N_BINS)


def _scaling(table: TrialTable, with_start: bool) -> Scaling:
    """Of `_inputs`; of places robustly, since what slipped out of sight is metres away."""
    shapes = Scaling.of(np.hstack([table.shape_m, table.shape_o]), LIMIT)
    if not with_start:
        return shapes
    places = Scaling.of(polar(table.start), LIMIT, robust=True)
    return Scaling(np.append(shapes.centre, places.centre), np.append(shapes.width, places.width), LIMIT)


def _regressed(features: Floats, table: TrialTable) -> tuple[float, Regression]:
    """Bayesian linear regression of the displacements on `features` (n, c), and its log evidence."""
    c = features.shape[1]
    shape = (len(ACTIONS), 2)
    effect = np.clip(table.effect, EDGES[0] - FARTHEST, EDGES[-1] + FARTHEST)
    _, trial, views = np.unique(table.trial, return_inverse=True, return_counts=True)
    weight = 1.0 / views[trial]
    usual = np.average(effect, axis=0, weights=weight)
    spread = (PRIOR_TRIALS * PRIOR_SPREAD**2 + weight @ (effect - usual) ** 2) / (PRIOR_TRIALS + weight.sum())
    found = Regression(
        np.tile(usual, (shape[0], 1)),
        np.zeros((*shape, c)),
        np.zeros((*shape, c, c)),
        np.zeros(shape),
        np.tile(spread, (shape[0], 1)),
    )
    evidence = 0.0
    for action in np.unique(table.action):
        rows = table.action == action
        counts = weight[rows]
        mean = (counts @ effect[rows] + PRIOR_TRIALS * usual) / (counts.sum() + PRIOR_TRIALS)
        found.mean[action] = mean
        part = features[rows] * np.sqrt(counts)[:, None]
        rest = (effect[rows] - mean) * np.sqrt(counts)[:, None]
        roots, axes = np.linalg.eigh(part.T @ part)
        roots = np.maximum(roots, 0.0)
        for axis in range(2):
            projected = axes.T @ (part.T @ rest[:, axis])
            square = float(rest[:, axis] @ rest[:, axis])
            value, ratio, process = _best_ratio(roots, projected, square, counts.sum(), spread[axis])
            evidence += value
            turned = axes / (roots + ratio)
            noise = max(ratio * process, LEAST_NOISE**2)
            found.weights[action, axis] = turned @ projected
            found.process[action, axis] = process
            # Where the mean itself is known from few trials only, what comes is less certain.
            found.noise[action, axis] = noise * (1 + 1 / (counts.sum() + PRIOR_TRIALS))
            found.covariance[action, axis] = noise * (turned @ axes.T)
    return evidence, found


def _best_ratio(
    roots: Floats, projected: Floats, square: float, n: float, spread: float
) -> tuple[float, float, float]:
    """The log evidence of the best of `RATIOS`, that ratio, and the variance of the process with it.

    `roots` (c,) are eigenvalues of the features' scatter, `projected` (c,) the features' products with the
    displacements of `n` trials along its axes, `square` the sum of the displacements' squares, m2. The prior
    of process and noise together is an inverse gamma distribution of `PRIOR_TRIALS` trials around `spread`.
    """
    best = (-np.inf, 1.0, 1.0)
    for ratio in RATIOS:
        # Of N(0, process * (features features' + ratio I)), by the matrix inversion and determinant lemmas;
        # the amplitude is integrated out.
        fit = (square - float((projected**2 / (roots + ratio)).sum())) / ratio
        prior = PRIOR_TRIALS * spread / (1 + ratio)
        process = (prior + fit) / (PRIOR_TRIALS + n)
        determinant = float(np.log1p(roots / ratio).sum()) + n * np.log(ratio)
        value = 0.5 * (PRIOR_TRIALS * np.log(prior) - (PRIOR_TRIALS + n) * np.log(prior + fit) - determinant)
        value -= 0.5 * (np.log(ratio) / RATIO_WIDTH) ** 2
        if value > best[0]:
            best = (value, ratio, process)
    return best
