"""Training and testing: splits by trial, one thing left out, the leaky published protocol; reports.

A trial that was seen under many views gives as many rows; unless all of them are on one side of a split,
the test is of memory. `published` makes that mistake on purpose, to compare with published numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from cognitive_arch.affordances.metrics import SCORE_NAMES, Scores, scores
from cognitive_arch.affordances.registry import model_class
from cognitive_arch.affordances.trials import Floats, Ints, TrialTable
from cognitive_arch.errors import AffordanceError, unknown

PROTOCOLS = ("trial", "views", "published", "leave-one-object-out", "leave-one-manipulator-out")
TEST_SHARE = 0.2
SPLITS = 20
NOISE = 0.02
"""Metres: uniform noise that the published protocol put on effects of hands."""
VIEWS = 20
"""Pairs of views per trial in the protocol `views`."""


@dataclass(frozen=True, eq=False)
class Split:
    """One division: rows to learn from and rows to test on, and what it is called."""

    train: TrialTable
    test: TrialTable
    name: str


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Scores of one model on every split, (splits,), and their test rows; all test predictions pooled."""

    model: str
    protocol: str
    scores: tuple[Scores, ...]
    sizes: Ints
    joint: Floats
    bins: Ints
    random: float

    def mean(self, name: str) -> float:
        """Mean of a score over splits (weighted by test rows where one thing is left out)."""
        values = np.array([getattr(s, name) for s in self.scores])
        weights = self.sizes if self.protocol.startswith("leave") else np.ones(len(values))
        return float(np.average(values, weights=weights))

    def interval(self, name: str) -> tuple[float, float]:
        """5th and 95th percentile over splits."""
        low, high = np.percentile([getattr(s, name) for s in self.scores], [5, 95])
        return float(low), float(high)

    def to_json(self) -> dict[str, Any]:
        """Means and intervals."""
        return {
            "model": self.model,
            "protocol": self.protocol,
            "splits": len(self.scores),
            "random_predictions": self.random,
            **{name: self.mean(name) for name in SCORE_NAMES},
            "intervals": {name: list(self.interval(name)) for name in SCORE_NAMES},
            "pooled": asdict(scores(self.joint, self.bins)),
        }


def splits(table: TrialTable, protocol: str, count: int, rng: np.random.Generator) -> Iterator[Split]:
    """The divisions of `table` by `protocol`: `count` random ones, or one for each thing to leave out."""
    if protocol not in PROTOCOLS:
        raise AffordanceError(unknown("protocol", protocol, PROTOCOLS))
    if protocol.startswith("leave"):
        yield from _left_out(table, table.object if "object" in protocol else table.manipulator)
        return
    if protocol == "published":
        yield from _leaky(table, count, rng)
        return
    rows = table if protocol == "trial" else _views(table, rng)
    trials = np.unique(rows.trial)
    held = max(1, round(TEST_SHARE * len(trials)))
    if len(trials) - held < 1:
        raise AffordanceError(f"{table.source}: {len(trials)} trials cannot be split")
    for number in range(count):
        chosen = np.isin(rows.trial, rng.permutation(trials)[:held])
        yield Split(rows.take(~chosen), rows.take(chosen), f"split {number + 1}")


def _left_out(table: TrialTable, names: Any) -> Iterator[Split]:
    things = np.unique(names)
    if len(things) < 2:
        raise AffordanceError(f"{table.source} has one thing only, so none can be left out")
    for thing in things:
        out = names == thing
        yield Split(table.take(~out), table.take(out), str(thing))


def _views(table: TrialTable, rng: np.random.Generator) -> TrialTable:
    """Some pairs of views of every trial."""
    grown = table.augmented()
    order = rng.permutation(len(grown))
    place = np.empty(len(grown), dtype=np.int64)
    by_trial = order[np.argsort(grown.trial[order], kind="stable")]
    _, first, size = np.unique(grown.trial[by_trial], return_index=True, return_counts=True)
    place[by_trial] = np.arange(len(grown)) - np.repeat(first, size)
    return grown.take(place < VIEWS)


def _leaky(table: TrialTable, count: int, rng: np.random.Generator) -> Iterator[Split]:
    """All pairs of views, noise on hands' effects, and then a random split of rows."""
    for number in range(count):
        grown = noisy_hands(table.augmented(), rng)
        order = rng.permutation(len(grown))
        held = round(TEST_SHARE * len(grown))
        yield Split(grown.take(order[held:]), grown.take(order[:held]), f"split {number + 1}")


def noisy_hands(table: TrialTable, rng: np.random.Generator) -> TrialTable:
    """The published augmentation: up to 2 cm of uniform noise on the effects of hands."""
    noise = rng.uniform(-NOISE, NOISE, table.effect.shape) * (table.kind == "hand")[:, None]
    return replace(table, effect=table.effect + noise)


def without_start(table: TrialTable) -> TrialTable:
    """The same trials, as if it were not known where things stood."""
    return replace(table, start=np.full_like(table.start, np.nan))


def evaluate(
    table: TrialTable, model: str, protocol: str = "trial", count: int = SPLITS, seed: int = 0
) -> Evaluation:
    """Learn and test `model` on every split; the splits depend on `seed` alone, not on the model."""
    return assess(splits(table, protocol, count, np.random.default_rng(seed)), model, protocol, seed)


def assess(divisions: Iterator[Split], model: str, protocol: str, seed: int) -> Evaluation:
    """Learn and test `model` on given splits."""
    kind = model_class(model)
    found: list[Scores] = []
    sizes, joints, bins, unseen = [], [], [], []
    for number, split in enumerate(divisions):
        fitted = kind.fit(split.train, np.random.default_rng([seed, number]))
        joint = fitted.joint(split.test)
        found.append(scores(joint, split.test.bins))
        sizes.append(len(split.test))
        joints.append(joint)
        bins.append(split.test.bins)
        if hasattr(fitted, "unseen"):
            unseen.append(fitted.unseen(split.test))
    return Evaluation(
        model,
        protocol,
        tuple(found),
        np.array(sizes),
        np.concatenate(joints),
        np.concatenate(bins),
        float(np.concatenate(unseen).mean()) if unseen else 0.0,
    )


def compare(
    table: TrialTable, models: Sequence[str], protocol: str = "trial", count: int = SPLITS, seed: int = 0
) -> list[Evaluation]:
    """`evaluate` for several models, on the same splits."""
    return [evaluate(table, model, protocol, count, seed) for model in models]
