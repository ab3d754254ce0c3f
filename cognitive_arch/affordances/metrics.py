"""How good predictions of effects are: accuracy and distance (thesis Sec. 5.4.1), and what the probabilities
are worth: log-likelihood, Brier score, calibration. Pure functions; per axis, averaged over both."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.affordances.model import marginals_of
from cognitive_arch.affordances.trials import N_BINS, Floats, Ints

TIE = 1e-9
FLOOR = 1e-12


@dataclass(frozen=True)
class Scores:
    """Means over trials. `accuracy`, `distance` (0..1 of the largest there is), `log_likelihood` (nats)
    and `brier` (0..2) are per axis, averaged; `joint_accuracy` and `joint_log_likelihood` are over 25 cells;
    `ece` is the expected calibration error of the bin predicted."""

    accuracy: float
    distance: float
    log_likelihood: float
    brier: float
    ece: float
    joint_accuracy: float
    joint_log_likelihood: float


SCORE_NAMES = tuple(f.name for f in fields(Scores))


def scores(joint: Floats, bins: Ints) -> Scores:
    """Scores of predictions (n, 5, 5) where the bins (n, 2) came about."""
    marginals = marginals_of(joint)
    rows = np.arange(len(bins))
    p = np.stack([marginals[rows, axis, bins[:, axis]] for axis in range(2)], axis=1)
    best = winners(marginals)
    flat = joint.reshape(len(joint), -1)
    cell = bins[:, 0] * N_BINS + bins[:, 1]
    confidence, right = confidences(marginals, bins)
    observed = np.eye(N_BINS)[bins]
    steps = np.abs(np.arange(N_BINS) - bins[:, :, None])
    return Scores(
        accuracy=float(right.mean()),
        distance=float((best * steps).sum(axis=2).mean() / (N_BINS - 1)),
        log_likelihood=float(np.log(np.maximum(p, FLOOR)).mean()),
        brier=float(((marginals - observed) ** 2).sum(axis=2).mean()),
        ece=calibration_error(confidence, right),
        joint_accuracy=float(winners(flat)[rows, cell].mean()),
        joint_log_likelihood=float(np.log(np.maximum(flat[rows, cell], FLOOR)).mean()),
    )


def winners(distributions: Floats) -> Floats:
    """Where each distribution (along the last axis) is largest; ties share the 1 that a prediction is worth,
    so that a uniform distribution is a random prediction."""
    top = distributions >= distributions.max(axis=-1, keepdims=True) - TIE
    return top / top.sum(axis=-1, keepdims=True)


def confidences(marginals: Floats, bins: Ints) -> tuple[Floats, Floats]:
    """How sure the predicted bin is, and how right (0..1), for every trial and axis: (2 n,) each."""
    right = (winners(marginals) * np.eye(N_BINS)[bins]).sum(axis=2)
    return marginals.max(axis=2).ravel(), right.ravel()


@dataclass(frozen=True, eq=False)
class Reliability:
    """A reliability diagram: per group of similar probabilities their mean, how often what was predicted came
    about, and how many there were."""

    predicted: Floats
    observed: Floats
    count: Ints

    @property
    def error(self) -> float:
        """Expected calibration error: the mean gap, weighted by counts."""
        if not self.count.sum():
            return 0.0
        return float(np.abs(self.predicted - self.observed) @ self.count / self.count.sum())


def reliability(p: Floats, came: Floats | NDArray[np.bool_], groups: int = 10) -> Reliability:
    """Groups of equal width over 0..1 of predictions `p` (n,) of what `came` about (n,); empty ones are left
    out."""
    which = np.minimum((p * groups).astype(int), groups - 1)
    count = np.bincount(which, minlength=groups)
    some = count > 0
    predicted = np.bincount(which, p, groups)[some] / count[some]
    observed = np.bincount(which, came, groups)[some] / count[some]
    return Reliability(predicted, observed, count[some].astype(np.int64))


def calibration_error(p: Floats, came: Floats | NDArray[np.bool_], groups: int = 10) -> float:
    """Expected calibration error of `p` (n,)."""
    return reliability(p, came, groups).error


def match_distance(a: Floats, b: Floats) -> float:
    """How much of one histogram (5,) must move how many bins to give the other (thesis Table 10)."""
    return float(np.abs(np.cumsum(a) - np.cumsum(b)).sum())
