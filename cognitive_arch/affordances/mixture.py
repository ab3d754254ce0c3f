"""The default model: a network whose effect nodes have a mixture of learned CPDs.

    p(effect | a, m, o, s) = sum over k of w_k p_k(effect | a, m, o, s)

The parts are the action's own distribution (a Dirichlet estimate), the hierarchical softmax, the ensemble of
tree CPDs, and the Gaussian process of how far things go. The weights are found by expectation-maximisation
on predictions for trials that the parts have not seen: folds of the training trials, by object where there
are enough of them, for it is new things that the robot asks about. Each action has weights of its own, drawn
towards those of all: whether a pull works hangs on the tool, whether a push does hardly. So is found an
exponent per action and axis, which makes the distributions as sure as they are right, and the dependence
between the two effects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from cognitive_arch.affordances.forest import TREES, ForestCPD
from cognitive_arch.affordances.model import coupled, coupling
from cognitive_arch.affordances.process import ProcessCPD
from cognitive_arch.affordances.softmax import SoftmaxCPD
from cognitive_arch.affordances.trials import ACTIONS, N_BINS, Floats, Ints, TrialTable, joined

FOLDS = 4
OBJECTS_FOR_FOLDS = 6
"""With at least so many objects each fold holds out some of them entirely."""
MOST_ROWS = 4000
TREES_FOR_WEIGHTS = 24
EXPONENT_WIDTH = 0.5
"""Prior standard deviation of the logarithm of an exponent."""
SHARED_WEIGHTS = 20.0
"""Trials that the weights found for all actions count as in those of each."""
PLACES = 48
"""Places kept to average over where the place is not told."""


@dataclass(frozen=True, eq=False)
class ActionCPD:
    """p(effect | action): `probabilities` (actions, 2, 5)."""

    probabilities: Floats

    @classmethod
    def fit(cls, table: TrialTable) -> ActionCPD:
        """Frequencies, with one pseudo-trial spread as the effects of all actions together are."""
        counts = np.zeros((len(ACTIONS), 2, N_BINS))
        for axis in range(2):
            np.add.at(counts[:, axis], (table.action, table.bins[:, axis]), 1.0)
        overall = counts.sum(axis=0) + 1.0
        raised = counts + overall / overall.sum(axis=1, keepdims=True)
        return cls(raised / raised.sum(axis=2, keepdims=True))

    def marginals(self, table: TrialTable) -> Floats:
        """p(bin) along x and y of each row, (n, 2, 5)."""
        answer: Floats = self.probabilities[table.action]
        return answer


@dataclass(eq=False)
class MixtureModel:
    """`weights` (actions, 4) of the parts, `exponents` (actions, 2) (sharper above 1), `ratio` (actions, 5,
    5) the dependence of the effects, `places` (k, 2) metres to average over, `seen` what it learned from."""

    action: ActionCPD
    softmax: SoftmaxCPD
    forest: ForestCPD
    process: ProcessCPD
    weights: Floats
    exponents: Floats
    ratio: Floats
    places: Floats
    seen: TrialTable | None = None

    @classmethod
    def fit(cls, table: TrialTable, rng: np.random.Generator) -> MixtureModel:
        """Learn parts, weights, exponent and dependence from `table` alone.

        Of more than `MOST_ROWS` rows (mostly views of the same trials) as many are drawn.
        """
        table = _drawn(table, rng, MOST_ROWS)
        parts = _fit_parts(table, rng)
        held_out = _held_out(table, rng, parts[1])
        weights = _weights_by_action(held_out, table)
        mixed = _mixed(held_out, weights, table)
        exponents = _exponents(mixed, table)
        ratio = coupling(_sharpened(mixed, exponents[table.action]), table)
        return cls(*parts, weights, exponents, ratio, _places(table, rng), table)

    def joint(self, table: TrialTable) -> Floats:
        """See `EffectModel`."""
        unknown = ~self.counts(table.start)
        if not (len(self.places) and unknown.any()):
            return self._joint(table)
        answer = np.zeros((len(table), N_BINS, N_BINS))
        if not unknown.all():
            answer[~unknown] = self._joint(table.take(~unknown))
        part = table.take(unknown)
        # p(E | A, M, O) sums over where things use to stand.
        spread = part.take(np.repeat(np.arange(len(part)), len(self.places)))
        spread = replace(spread, start=np.tile(self.places, (len(part), 1)))
        answer[unknown] = self._joint(spread).reshape(len(part), -1, N_BINS, N_BINS).mean(axis=1)
        return answer

    def counts(self, start: Floats) -> NDArray[np.bool_]:
        """See `EffectModel`: a place farther out than those tried tells as little as one that is not told."""
        return self.softmax.within(start) & (len(self.places) > 0)

    def _joint(self, table: TrialTable) -> Floats:
        each = _marginals((self.action, self.softmax, self.forest, self.process), table)
        mixed = _sharpened(_mixed(each, self.weights, table), self.exponents[table.action])
        return coupled(mixed, self.ratio[table.action])

    def update(self, table: TrialTable, rng: np.random.Generator) -> None:
        """Further trials: the parts are learned again from all trials, the weights stay as they are.

        A model that was loaded from a file has no trials: give it those it was learned from. Of more than
        `MOST_ROWS` rows earlier ones are left out.
        """
        if self.seen is not None:
            table = joined([_drawn(self.seen, rng, max(1, MOST_ROWS - len(table))), table])
        self.seen = table
        self.action, self.softmax, self.forest, self.process = _fit_parts(self.seen, rng, self.softmax)
        self.places = _places(self.seen, rng)

    def to_json(self) -> dict[str, Any]:
        """See `EffectModel`; the trials themselves are left out."""
        return {
            "action": self.action.probabilities.tolist(),
            "softmax": self.softmax.to_json(),
            "forest": self.forest.to_json(),
            "process": self.process.to_json(),
            "weights": self.weights.tolist(),
            "exponents": self.exponents.tolist(),
            "ratio": self.ratio.tolist(),
            "places": self.places.tolist(),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> MixtureModel:
        """See `EffectModel`."""
        return cls(
            ActionCPD(np.array(data["action"])),
            SoftmaxCPD.from_json(data["softmax"]),
            ForestCPD.from_json(data["forest"]),
            ProcessCPD.from_json(data["process"]),
            np.array(data["weights"]),
            np.array(data["exponents"]),
            np.array(data["ratio"]),
            np.array(data["places"]).reshape(-1, 2),
        )


Parts = tuple[ActionCPD, SoftmaxCPD, ForestCPD, ProcessCPD]
PARTS = 4


def _drawn(table: TrialTable, rng: np.random.Generator, most: int) -> TrialTable:
    """At most so many of the rows, in their order."""
    if len(table) <= most:
        return table
    return table.take(np.sort(rng.choice(len(table), most, replace=False)))


def _places(table: TrialTable, rng: np.random.Generator) -> Floats:
    """Some of the places where things stood, (at most `PLACES`, 2)."""
    places: Floats = table.start[np.isfinite(table.start).all(axis=1)]
    return places if len(places) <= PLACES else places[rng.choice(len(places), PLACES, replace=False)]


def _fit_parts(
    table: TrialTable,
    rng: np.random.Generator,
    guess: SoftmaxCPD | None = None,
    trees: int = TREES,
    with_start: bool | None = None,
) -> Parts:
    return (
        ActionCPD.fit(table),
        SoftmaxCPD.fit(table, start=guess),
        ForestCPD.fit(table, rng, trees, with_start=with_start),
        ProcessCPD.fit(table, rng, with_start),
    )


def _marginals(parts: Parts, table: TrialTable) -> Floats:
    """p(bin) of each part along x and y of each row, (4, n, 2, 5).

    Trees take what is unlike anything they were shown for the nearest of it, be it ever so far. They are
    trusted as far as the things are familiar; beyond that the softmax speaks, which then knows averages only.
    """
    action, soft, forest, process = (part.marginals(table) for part in parts)
    trust = parts[1].familiarity(table)[:, None, None]
    return np.stack([action, soft, trust * forest + (1 - trust) * soft, process])


def _folds(table: TrialTable, rng: np.random.Generator) -> Ints:
    """Which fold each row belongs to, (n,): rows of one trial, or of one object, belong to the same."""
    objects = np.unique(table.object)
    groups = table.object if len(objects) >= OBJECTS_FOR_FOLDS else table.trial
    names, which = np.unique(groups, return_inverse=True)
    fold: Ints = (rng.permutation(len(names)) % FOLDS)[which]
    return fold


def _held_out(table: TrialTable, rng: np.random.Generator, guess: SoftmaxCPD) -> Floats:
    """Predictions of each part for each row by parts that were not shown it, (4, n, 2, 5)."""
    fold = _folds(table, rng)
    answer = np.full((PARTS, len(table), 2, N_BINS), 1 / N_BINS)
    for k in range(FOLDS):
        out = fold == k
        if out.any() and not out.all():
            # The parts that are weighed look at the same as those that the weights are for.
            parts = _fit_parts(table.take(~out), rng, guess, TREES_FOR_WEIGHTS, table.has_start)
            answer[:, out] = _marginals(parts, table.take(out))
    return answer


def _mixed(each: Floats, weights: Floats, table: TrialTable) -> Floats:
    """Predictions (4, n, 2, 5) of the parts, weighted as each row's action has it, (n, 2, 5)."""
    mixed: Floats = np.einsum("nk,knxb->nxb", weights[table.action], each)
    return mixed


def _weights_by_action(held_out: Floats, table: TrialTable) -> Floats:
    """Weights of the mixture, (actions, 4): those of all trials count as `SHARED_WEIGHTS` trials of each."""
    parts = len(held_out)
    overall = _weights(held_out, table.bins, np.ones(parts))
    prior = overall * SHARED_WEIGHTS
    return np.stack(
        [
            _weights(held_out[:, table.action == action], table.bins[table.action == action], prior)
            for action in range(len(ACTIONS))
        ]
    )


def _weights(held_out: Floats, bins: Ints, prior: Floats, steps: int = 100) -> Floats:
    """Weights of the mixture by expectation-maximisation, (4,); `prior` (4,) counts like trials."""
    rows = np.arange(len(bins))
    likelihood = np.stack([held_out[:, rows, axis, bins[:, axis]] for axis in range(2)], axis=2).reshape(
        len(held_out), -1
    )
    weights = prior / prior.sum()
    for _ in range(steps):
        joint = weights[:, None] * likelihood
        weights = (joint / joint.sum(axis=0)).sum(axis=1) + prior
        weights /= weights.sum()
    return weights


def _sharpened(marginals: Floats, exponent: Floats) -> Floats:
    """Marginals (n, axes, 5) to the power of `exponent` (n, axes), normalised again."""
    raised = marginals ** exponent[:, :, None]
    sharpened: Floats = raised / raised.sum(axis=2, keepdims=True)
    return sharpened


def _exponents(marginals: Floats, table: TrialTable) -> Floats:
    """For each action and axis the exponent under which the held-out bins are most likely, (actions, 2)."""
    found = np.ones((len(ACTIONS), 2))
    for action in range(len(ACTIONS)):
        rows = table.action == action
        for axis in range(2) if rows.any() else ():
            found[action, axis] = _exponent(marginals[rows, axis], table.bins[rows, axis])
    return found


def _exponent(marginals: Floats, bins: Ints) -> float:
    """For marginals (n, 5) and bins (n,)."""
    rows = np.arange(len(bins))

    def loss(log_exponent: float) -> float:
        p = _sharpened(marginals[:, None], np.full((len(bins), 1), np.exp(log_exponent)))[:, 0]
        found = np.log(p[rows, bins] + 1e-12).sum()
        return 0.5 * (log_exponent / EXPONENT_WIDTH) ** 2 - float(found)

    return float(np.exp(minimize_scalar(loss, bounds=(-1.1, 1.1), method="bounded").x))
