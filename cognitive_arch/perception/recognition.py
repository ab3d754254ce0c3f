"""What a region shows: a domain's objects by name, with probabilities, or something unknown.

Decision trees answer that were trained on rendered views of one domain (`cogarch learn objects`) and lie
beside it as plain arrays. Trained on strangers, too, they know "unknown" as an answer; besides, what has
another colour than all that was learnt of an object is not called by that object's name.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cognitive_arch import resources
from cognitive_arch.domain import Domain, domain_names, load_domain
from cognitive_arch.errors import PerceptionError, one_line
from cognitive_arch.perception.appearance import COLORS, FEATURES, Image, Mask, appearance, kernels

UNKNOWN = "unknown"
FILE = "recogniser.npz"
FORMAT = 1
MAX_BYTES = 5_000_000
MAX_DEPTH = 100
COLOR_COLUMNS = [FEATURES.index(name) for name in COLORS]
FALL_OFF = 4.0  # how quickly a name gets unlikely beyond the distance that its examples have
Array = NDArray[np.float32]


def digest(domain: Domain) -> str:
    """Short text that changes with how the domain's objects look, and not with what they are called by."""
    looks = {name: [spec.shape.model_dump(mode="json"), spec.color] for name, spec in domain.objects.items()}
    text = json.dumps(looks, sort_keys=True)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()[:12]


@dataclass(frozen=True, eq=False)
class Forest:
    """Decision trees whose leaves add up: nodes in arrays (n_nodes,), and each tree's first one in `roots`
    (n_rounds, n_answers). Where `feature` is above `threshold` it goes on at `child` + 1, else at `child`;
    leaves lead to themselves. `start` (n_answers,) is what there is to add to; it takes `depth` steps."""

    roots: NDArray[np.signedinteger]
    feature: NDArray[np.signedinteger]
    threshold: Array
    child: NDArray[np.signedinteger]
    value: Array
    start: Array
    depth: int

    def __post_init__(self) -> None:
        # Kept in few bytes, used as what numpy indexes with: half of the time went into the conversion.
        for name in ("roots", "feature", "child"):
            object.__setattr__(self, name, getattr(self, name).astype(np.intp))
        self._check()

    def _check(self) -> None:
        """Raise `ValueError` for arrays that do not fit together: kernels look nothing up twice."""
        n = len(self.child)
        if not n == len(self.feature) == len(self.threshold) == len(self.value):
            raise ValueError("its nodes have arrays of different lengths")
        if self.roots.ndim != 2 or self.roots.shape[1:] != self.start.shape:
            raise ValueError("its trees and answers do not fit together")
        last = self.child + (self.threshold < np.inf)
        for what, index, end in (("root", self.roots, n), ("child", last, n), ("child", self.child, n)):
            if index.size and not (index.min() >= 0 and index.max() < end):
                raise ValueError(f"a {what} is not among its nodes")
        if n and not (self.feature.min() >= 0 and self.feature.max() < len(FEATURES)):
            raise ValueError("it asks for unknown features")
        if not 0 <= self.depth <= MAX_DEPTH:
            raise ValueError(f"a depth of {self.depth}")

    def scores(self, features: Array) -> NDArray[np.float64]:
        """What the trees say to features (n_features,): (n_answers,)."""
        scores = self.start.astype(np.float64)
        nodes = (self.feature, self.threshold, self.child, self.value)
        kernels.add_leaves(features, self.roots, *nodes, self.depth, scores)
        return scores


@dataclass(frozen=True, eq=False)
class ObjectRecogniser:
    """Trained trees with what else it takes; see `recognition_training.fit` for how they come about.

    `names` are the answers, `unknown` last. `means` (n_names - 1, n_colors) and `whitenings` (n_names - 1,
    n_colors, n_colors) tell how far a region's colours are from those learnt for every name, `limits`
    (n_names - 1,) how far is too far. `told` says how it was made.
    """

    names: tuple[str, ...]
    forest: Forest
    means: Array
    whitenings: Array
    limits: Array
    told: Mapping[str, Any]

    def __post_init__(self) -> None:
        known, colors = len(self.names) - 1, len(COLORS)
        found = (self.forest.start.shape, self.means.shape, self.whitenings.shape, self.limits.shape)
        if found != ((known + 1,), (known, colors), (known, colors, colors), (known,)):
            raise ValueError(f"its names and arrays do not fit together: {found}")

    def classify(self, image: Image, mask: Mask) -> list[tuple[str, float]]:
        """What the region `mask` (height, width) bool of `image` (height, width, 3) uint8 RGB shows: all
        names with their probabilities, the likeliest first; they add up to 1.

        Raises `PerceptionError` for arrays that do not fit together and for an empty region.
        """
        probabilities = self.probabilities(appearance(image, mask))
        order = np.argsort(-probabilities, kind="stable")
        return [(self.names[i], float(probabilities[i])) for i in order]

    def probabilities(self, features: Array) -> NDArray[np.float64]:
        """The same for the features of a region (n_features,): (n_names,), in the order of `names`."""
        scores = self.forest.scores(features)
        likely = np.exp(scores - scores.max())
        likely /= likely.sum()
        # A name may not be given far from its examples: what it loses is unknown.
        excess = np.maximum(self.color_distances(features) / self.limits - 1, 0)
        likely[:-1] *= np.exp(-FALL_OFF * excess)
        likely[-1] = max(0.0, 1 - float(likely[:-1].sum()))
        return likely

    def color_distances(self, features: Array) -> Array:
        """How far a region's colours are from every name's examples, (n_names - 1,), in standard
        deviations (Mahalanobis)."""
        away = features[COLOR_COLUMNS] - self.means
        white = (self.whitenings @ away[:, :, None])[:, :, 0]
        distances: Array = np.sqrt((white * white).sum(axis=1))
        return distances

    def save(self, path: Path) -> None:
        """Write it; raises `PerceptionError` if that cannot be done."""
        arrays: dict[str, Any] = {
            "names": np.array(self.names),
            "features": np.array(FEATURES),
            "told": np.array(json.dumps({"format": FORMAT, **self.told}, sort_keys=True)),
            **{name: getattr(self, name) for name in ("means", "whitenings", "limits")},
            **{f"forest_{field.name}": getattr(self.forest, field.name) for field in fields(Forest)},
            "forest_roots": self.forest.roots.astype(np.int32),
            "forest_feature": self.forest.feature.astype(np.int16),
            "forest_child": self.forest.child.astype(np.int32),
        }
        packed = io.BytesIO()
        np.savez_compressed(packed, **arrays)
        try:
            path.write_bytes(packed.getvalue())
        except OSError as error:
            raise PerceptionError(f"cannot write '{one_line(path)}': {one_line(error.strerror)}") from None

    @classmethod
    def load(cls, path: Path) -> ObjectRecogniser:
        """Read what `save` wrote; raises `PerceptionError` for anything else."""
        try:
            if path.stat().st_size > MAX_BYTES:
                raise PerceptionError(f"'{one_line(path)}' is too large for a recogniser")
            with np.load(path, allow_pickle=False) as data:
                arrays = {name: data[name] for name in data.files}
            told = json.loads(str(arrays["told"]))
            if told.pop("format") != FORMAT or tuple(map(str, arrays["features"])) != FEATURES:
                raise PerceptionError(
                    f"'{one_line(path)}' was made by another version; {_advice(_owner(path))}"
                )
            forest = {field.name: arrays[f"forest_{field.name}"] for field in fields(Forest)}
            return cls(
                names=tuple(map(str, arrays["names"])),
                forest=Forest(**(forest | {"depth": int(forest["depth"])})),
                told=told,
                **{name: arrays[name] for name in ("means", "whitenings", "limits")},
            )
        except PerceptionError:
            raise
        except Exception as error:  # a broken archive fails in as many ways as there are bytes
            raise PerceptionError(
                f"'{one_line(path)}' is no recogniser ({one_line(error)}); {_advice(_owner(path))}"
            ) from None


def _owner(path: Path) -> str:
    """The domain whose folder a recogniser is in, or those that there are."""
    names = domain_names()
    return path.parent.name if path.parent.name in names else f"NAME ({', '.join(names)})"


def _advice(domain: str) -> str:
    return f"make one with: cogarch learn objects --domain {domain}"


def recogniser_path(domain_name: str) -> Path:
    """Where a domain keeps what was learnt of its objects."""
    return resources.domains_dir() / domain_name / FILE


@lru_cache(maxsize=8)
def load_recogniser(domain_name: str) -> ObjectRecogniser:
    """What was learnt of a domain's objects.

    Raises `ConfigError` for an unknown domain, `PerceptionError` where nothing was learnt yet or the domain
    has other objects by now; the message names the command that helps.
    """
    domain = load_domain(domain_name)
    path = recogniser_path(domain_name)
    if not path.exists():
        raise PerceptionError(f"nothing was learnt of how domain {domain_name} looks; {_advice(domain_name)}")
    recogniser = ObjectRecogniser.load(path)
    check_fits(recogniser, domain)
    return recogniser


def check_fits(recogniser: ObjectRecogniser, domain: Domain) -> None:
    """Raise `PerceptionError` if the recogniser learnt other things than the domain has."""
    new = sorted(set(domain.objects) - set(recogniser.names))
    if new:
        raise PerceptionError(
            f"domain {domain.name} has objects not learnt yet ({', '.join(new)}); {_advice(domain.name)}"
        )
    if recogniser.told.get("looks") != digest(domain):
        raise PerceptionError(
            f"the objects of domain {domain.name} look different from what was learnt; {_advice(domain.name)}"
        )
