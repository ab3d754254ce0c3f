"""What every model is measured against: the majority per action, and strong learners without structure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.affordances.features import polar
from cognitive_arch.affordances.mixture import ActionCPD
from cognitive_arch.affordances.trials import ACTIONS, N_BINS, Floats, TrialTable, joined
from cognitive_arch.errors import AffordanceError


def independent(marginals: Floats) -> Floats:
    """Joint distributions (n, 5, 5) of independent effects (n, 2, 5)."""
    joint: Floats = np.einsum("ni,nj->nij", marginals[:, 0], marginals[:, 1])
    return joint


@dataclass(eq=False)
class MajorityModel:
    """Each action's own frequencies, whatever is acted with or on."""

    action: ActionCPD
    seen: TrialTable | None = None

    @classmethod
    def fit(cls, table: TrialTable, rng: np.random.Generator) -> MajorityModel:
        """See `EffectModel`."""
        return cls(ActionCPD.fit(table), table)

    def joint(self, table: TrialTable) -> Floats:
        """See `EffectModel`."""
        return independent(self.action.marginals(table))

    def counts(self, start: Floats) -> NDArray[np.bool_]:
        """See `EffectModel`."""
        return np.zeros(len(start), np.bool_)

    def update(self, table: TrialTable, rng: np.random.Generator) -> None:
        """See `EffectModel`."""
        self.seen = table if self.seen is None else joined([self.seen, table])
        self.action = ActionCPD.fit(self.seen)

    def to_json(self) -> dict[str, Any]:
        """See `EffectModel`."""
        return {"action": self.action.probabilities.tolist()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> MajorityModel:
        """See `EffectModel`."""
        return cls(ActionCPD(np.array(data["action"])))


@dataclass(eq=False)
class SklearnModel:
    """A classifier of scikit-learn for each axis, as it comes. For comparison only: it cannot be saved."""

    classifiers: list[Any]
    with_start: bool
    seen: TrialTable
    kind: ClassVar[str]

    @classmethod
    def fit(cls, table: TrialTable, rng: np.random.Generator) -> Self:
        """See `EffectModel`."""
        with_start = table.has_start
        inputs = _inputs(table, with_start)
        fitted = []
        for axis in range(2):
            classifier = cls._classifier(int(rng.integers(2**31)))
            if len(np.unique(table.bins[:, axis])) == 1:
                from sklearn.dummy import DummyClassifier

                classifier = DummyClassifier()  # logistic regression refuses a single class
            fitted.append(classifier.fit(inputs, table.bins[:, axis]))
        return cls(fitted, with_start, table)

    @classmethod
    def _classifier(cls, seed: int) -> Any:
        if cls.kind == "forest":
            from sklearn.ensemble import RandomForestClassifier

            return RandomForestClassifier(200, min_samples_leaf=3, random_state=seed)
        from sklearn.linear_model import LogisticRegression
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler

        return make_pipeline(StandardScaler(), LogisticRegression(max_iter=2000))

    def joint(self, table: TrialTable) -> Floats:
        """See `EffectModel`."""
        marginals = np.full((len(table), 2, N_BINS), 1e-6)
        inputs = _inputs(table, self.with_start)
        for axis, classifier in enumerate(self.classifiers):
            marginals[:, axis, classifier.classes_] += classifier.predict_proba(inputs)
        return independent(marginals / marginals.sum(axis=2, keepdims=True))

    def counts(self, start: Floats) -> NDArray[np.bool_]:
        """See `EffectModel`."""
        return np.full(len(start), self.with_start)

    def update(self, table: TrialTable, rng: np.random.Generator) -> None:
        """See `EffectModel`."""
        again = type(self).fit(joined([self.seen, table]), rng)
        self.classifiers, self.seen = again.classifiers, again.seen

    def to_json(self) -> dict[str, Any]:
        """Refused: these are for comparison."""
        raise AffordanceError(f"a {self.kind} is for comparison and cannot be saved; valid: default, ...")

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Refused, as `to_json`."""
        raise AffordanceError("a model for comparison cannot be loaded")


class ForestModel(SklearnModel):
    """Random forest."""

    kind = "forest"


class LogisticModel(SklearnModel):
    """Logistic regression with products of the action and everything else."""

    kind = "logistic"


def _inputs(table: TrialTable, with_start: bool) -> Floats:
    """Action, descriptors, place, and their products with the action, (n, ...)."""
    action = np.eye(len(ACTIONS))[table.action]
    things = np.hstack([table.shape_m, table.shape_o])
    if with_start:
        things = np.hstack([things, table.start, polar(table.start)])
    mixed = (action[:, :, None] * things[:, None, :]).reshape(len(table), -1)
    return np.hstack([action, things, mixed])
