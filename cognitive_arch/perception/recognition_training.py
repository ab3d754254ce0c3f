"""Training of an `ObjectRecogniser` on examples: regions of pictures with their names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from cv2.typing import MatLike
from numpy.typing import NDArray

from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.appearance import Image, Mask, appearance
from cognitive_arch.perception.recognition import COLOR_COLUMNS, UNKNOWN, Forest, ObjectRecogniser

if TYPE_CHECKING:
    from sklearn.ensemble import HistGradientBoostingClassifier

ROUNDS, DEPTH, LEAVES, RATE = 120, 7, 24, 0.1  # of gradient boosting
SMALLEST_LEAF, RESTRAINT = 10, 2.0  # without the latter the leaves' numbers run away
FEWEST = 20  # examples of every name
KEPT_PIXELS = 50  # of a region that was cut
CUT = 0.25  # share of the variants that something hides a part of
SURE, LIMIT_FACTOR = 0.998, 1.15  # this share of an object's examples is within its limit; and some more room
KNOWN_RIGHT = (
    0.996  # share of known things that must keep their name; then as few strangers get one as can be
)
READINESS = np.linspace(-4.0, 1.0, 51)  # of which one is added to the score of unknown
RIDGE = 1e-5  # added to variances of colours: what never varied is not known to the last digit


@dataclass(frozen=True, eq=False)
class Labelled:
    """Features of regions (n, n_features) with the name of each."""

    features: NDArray[np.float32]
    names: tuple[str, ...]


def variants(image: Image, mask: Mask, rng: np.random.Generator, number: int) -> Iterable[tuple[Image, Mask]]:
    """The region as it is, and `number` times as it might be seen: lit and tinted otherwise, partly
    hidden, with its outline a little off, with noise."""
    yield image, mask
    for _ in range(number):
        gain = rng.uniform(0.75, 1.15) * (1 + rng.uniform(-0.02, 0.02, 3))
        noise = rng.normal(0, rng.uniform(0, 4), image.shape)
        changed = np.clip(np.rint(image * gain + noise), 0, 255).astype(np.uint8)
        yield changed, _altered(mask, rng)


def _altered(mask: Mask, rng: np.random.Generator) -> Mask:
    region: MatLike = mask.astype(np.uint8)
    change = rng.integers(4)
    if change == 0:
        region = cv2.erode(region, np.ones((3, 3), np.uint8))
    elif change == 1:
        region = cv2.dilate(region, np.ones((3, 3), np.uint8))
    if rng.uniform() < CUT:
        region = _cut(region, rng)
    # Labelling tells pieces apart that do not touch: it is the largest that is looked at.
    count, pieces, statistics, _ = cv2.connectedComponentsWithStats(region)
    if count > 2:
        region = (pieces == 1 + np.argmax(statistics[1:, cv2.CC_STAT_AREA])).astype(np.uint8)
    return region.astype(bool) if np.count_nonzero(region) >= KEPT_PIXELS else mask


def _cut(region: MatLike, rng: np.random.Generator) -> MatLike:
    """Without what a thick line across it hides, as an arm does."""
    rows, columns = np.nonzero(region)
    if not len(rows):
        return region
    at = rng.integers(len(rows))
    size = max(np.ptp(rows), np.ptp(columns)) + 1
    turn = rng.uniform(0, np.pi)
    along = 2 * size * np.array([np.cos(turn), np.sin(turn)])
    middle = np.array([columns[at], rows[at]])
    ends = [tuple(map(int, middle + sign * along)) for sign in (-1, 1)]
    return cv2.line(region.copy(), ends[0], ends[1], 0, max(2, int(size * rng.uniform(0.15, 0.6))))


def describe(
    examples: Iterable[tuple[Image, Mask, str]], rng: np.random.Generator, number: int = 0
) -> Labelled:
    """Features of examples, each with `number` variants."""
    features, names = [], []
    for image, mask, name in examples:
        for changed, altered in variants(image, mask, rng, number):
            features.append(appearance(changed, altered))
            names.append(name)
    if not features:
        raise PerceptionError("there is nothing to learn from: no view shows anything")
    return Labelled(np.array(features), tuple(names))


def fit(labelled: Labelled, objects: Sequence[str], told: Mapping[str, Any], seed: int) -> ObjectRecogniser:
    """A recogniser of `objects`; the same examples and seed give the same one.

    Raises `PerceptionError` where there are too few examples of one of them, or of unknown things.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    names = (*sorted(objects), UNKNOWN)
    given = np.array(labelled.names)
    for name in names:
        if np.count_nonzero(given == name) < FEWEST:
            raise PerceptionError(f"too few views show {name} to learn from them; valid: more views")
    order = np.array([names.index(name) for name in labelled.names])
    trees = HistGradientBoostingClassifier(
        max_iter=ROUNDS,
        max_depth=DEPTH,
        max_leaf_nodes=LEAVES,
        learning_rate=RATE,
        min_samples_leaf=SMALLEST_LEAF,
        l2_regularization=RESTRAINT,
        early_stopping=False,
        random_state=seed,
    )
    trees.fit(labelled.features, order)
    means, whitenings = _spreads(labelled.features, order, len(names) - 1)
    ones = np.ones(len(names) - 1, np.float32)
    recogniser = ObjectRecogniser(names, _forest(trees), means, whitenings, ones, dict(told))
    for n in range(len(names) - 1):
        own = [recogniser.color_distances(each)[n] for each in labelled.features[order == n]]
        recogniser.limits[n] = LIMIT_FACTOR * np.quantile(own, SURE)
    return recogniser


def calibrate(recogniser: ObjectRecogniser, labelled: Labelled) -> None:
    """Make the recogniser as ready to say "unknown" as it can be while `KNOWN_RIGHT` of the known things
    among these examples, which it has not learnt from, are still called by their names."""
    known = [n for n, name in enumerate(labelled.names) if name != UNKNOWN]
    if not known:
        raise PerceptionError("there is nothing to calibrate with: no view shows a known thing")
    right = np.array([recogniser.names.index(labelled.names[n]) for n in known])
    likely = np.array([recogniser.probabilities(labelled.features[n]) for n in known])
    chosen = READINESS[0]
    for more in READINESS:
        weighed = likely * np.exp(np.append(np.zeros(likely.shape[1] - 1), more))
        if np.mean(weighed.argmax(axis=1) == right) < KNOWN_RIGHT:
            break
        chosen = more
    recogniser.forest.start[-1] += chosen


def _forest(trees: HistGradientBoostingClassifier) -> Forest:
    """The trees as arrays, the two children of a node beside each other."""
    feature: list[int] = []
    threshold: list[float] = []
    child: list[int] = []
    value: list[float] = []
    roots: list[int] = []
    for grown in trees._predictors:
        for tree in grown:
            nodes = tree.nodes
            # New numbers: a node's children follow each other, so that one number tells both.
            first = len(feature)
            order, places = [0], {0: first}
            for old in order:
                if not nodes["is_leaf"][old]:
                    for next_one in (int(nodes["left"][old]), int(nodes["right"][old])):
                        places[next_one] = first + len(order)
                        order.append(next_one)
            roots.append(first)
            for old in order:
                node, leaf = nodes[old], bool(nodes["is_leaf"][old])
                feature.append(0 if leaf else int(node["feature_idx"]))
                threshold.append(np.inf if leaf else float(node["num_threshold"]))
                child.append(places[old] if leaf else places[int(node["left"])])
                value.append(float(node["value"]) if leaf else 0.0)
    start = np.ravel(trees._baseline_prediction).astype(np.float32)
    return Forest(
        np.array(roots, np.int32).reshape(-1, len(start)),
        np.array(feature, np.int16),
        np.array(threshold, np.float32),
        np.array(child, np.int32),
        np.array(value, np.float32),
        start,
        DEPTH,
    )


def _spreads(
    features: NDArray[np.floating], order: NDArray[np.int_], count: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    means, whitenings = [], []
    for n in range(count):
        own = features[order == n][:, COLOR_COLUMNS].astype(np.float64)
        covariance = np.cov(own.T) + RIDGE * np.eye(own.shape[1])
        means.append(own.mean(axis=0))
        # L L' is the covariance: its inverse makes the examples a ball.
        whitenings.append(np.linalg.inv(np.linalg.cholesky(covariance)))
    return np.array(means, np.float32), np.array(whitenings, np.float32)
