"""The thesis' networks as models of effects: features, structure, parameters (Sec. 5.3.2, 5.3.3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.affordances import search
from cognitive_arch.affordances.compiled import CompiledEffects
from cognitive_arch.affordances.discretisation import Discretisation
from cognitive_arch.affordances.network import DiscreteNetwork, fit_missing
from cognitive_arch.affordances.pca import Components
from cognitive_arch.affordances.structures import (
    ACTION,
    EFFECT_X,
    EFFECT_Y,
    EFFECTS,
    Structure,
    components,
    fully_connected,
)
from cognitive_arch.affordances.trials import Floats, Ints, TrialTable
from cognitive_arch.errors import AffordanceError

METHODS = ("full", "pca", "pca-two-blocks", "k2", "bde", "bde-annealed", "mcmc")
LEVELS = 3
COMPONENTS = 2


@dataclass(frozen=True, eq=False)
class Features:
    """What the nodes besides action and effects stand for: levels of descriptors, or of components.

    `blocks` are pairs (name, components) in use; without any, each descriptor is a node of its own.
    """

    names: tuple[str, ...]
    levels: Discretisation
    blocks: tuple[Components, ...] = ()

    @classmethod
    def fit(cls, table: TrialTable, method: str) -> Features:
        """Fitted on the trials of `table` alone."""
        if not method.startswith("pca"):
            names = (*(f"m_{n}" for n in table.names_m), *(f"o_{n}" for n in table.names_o))
            return cls(names, Discretisation.fit(_shapes(table), LEVELS))
        if np.isnan(_shapes(table)).any():
            raise AffordanceError("principal components need every descriptor; valid: full, k2, bde")
        parts = [_shapes(table)] if method == "pca" else [table.shape_m, table.shape_o]
        blocks = tuple(Components.fit(part, COMPONENTS) for part in parts)
        prefix = ("PC",) if method == "pca" else ("ManipulatorPC", "ObjectPC")
        names = tuple(f"{p}{i + 1}" for p in prefix for i in range(COMPONENTS))
        values = np.hstack([block(part) for block, part in zip(blocks, parts, strict=True)])
        return cls(names, Discretisation.fit(values, 2), blocks)

    def __call__(self, table: TrialTable) -> Ints:
        """States of the nodes, (n, nodes); -1 for missing descriptors."""
        if not self.blocks:
            return self.levels(_shapes(table))
        parts = [_shapes(table)] if len(self.blocks) == 1 else [table.shape_m, table.shape_o]
        return self.levels(np.hstack([b(part) for b, part in zip(self.blocks, parts, strict=True)]))

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        blocks = [{"mean": b.mean.tolist(), "axes": b.axes.tolist()} for b in self.blocks]
        return {"names": list(self.names), "edges": self.levels.edges.tolist(), "blocks": blocks}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Features:
        """From `to_json`."""
        blocks = tuple(
            Components(np.array(b["mean"]), np.array(b["axes"]), np.zeros(len(b["axes"])))
            for b in data["blocks"]
        )
        return cls(tuple(data["names"]), Discretisation(np.array(data["edges"])), blocks)


def _shapes(table: TrialTable) -> Floats:
    return np.hstack([table.shape_m, table.shape_o])


@dataclass(eq=False)
class NetworkModel:
    """Features and one network, or (after a Markov chain) several with their weights."""

    method: ClassVar[str]
    features: Features
    networks: list[DiscreteNetwork]
    weights: Floats
    compiled: list[CompiledEffects] = field(init=False)

    def __post_init__(self) -> None:
        self._compile()

    def _compile(self) -> None:
        evidence = (ACTION, *self.features.names)
        self.compiled = [CompiledEffects.of(network, evidence) for network in self.networks]

    @classmethod
    def fit(cls, table: TrialTable, rng: np.random.Generator) -> NetworkModel:
        """See `EffectModel`. Missing descriptors are dealt with by EM; structures are then learned from
        what is complete."""
        features = Features.fit(table, cls.method)
        data = np.column_stack([table.action, features(table), table.bins])
        complete = (data >= 0).all(axis=1)
        if not complete.any():
            raise AffordanceError("no trial has all descriptors, so nothing can be learned")
        found = _structures(cls.method, features, data[complete], rng)
        if complete.all():
            networks = [DiscreteNetwork.fit(structure, data) for structure, _ in found]
        else:
            networks = [fit_missing(structure, data)[0] for structure, _ in found]
        return cls(features, networks, np.array([weight for _, weight in found]))

    def evidence(self, table: TrialTable) -> Ints:
        """States of action and features, (n, 1 + features); raises `AffordanceError` for missing ones."""
        states = np.column_stack([table.action, self.features(table)])
        if (states < 0).any():
            raise AffordanceError("a prediction needs every descriptor; use infer() of the network instead")
        return states

    def joint(self, table: TrialTable) -> Floats:
        """See `EffectModel`."""
        states = self.evidence(table)
        return np.einsum("k,knij->nij", self.weights, [c.many(states) for c in self.compiled])

    def counts(self, start: Floats) -> NDArray[np.bool_]:
        """See `EffectModel`: there is no node for the place."""
        return np.zeros(len(start), np.bool_)

    def query(self, states: Ints) -> Floats:
        """(5, 5) for the states of action and features, (1 + features,), by look-up."""
        if len(self.compiled) == 1:
            return self.compiled[0](states)
        return np.einsum("k,kij->ij", self.weights, [c(states) for c in self.compiled])

    def unseen(self, table: TrialTable) -> Floats:
        """Share of axes for which a row's configuration was never seen, (n,): random predictions."""
        states = self.evidence(table)
        return np.einsum("k,kn->n", self.weights, [c.unseen(states).mean(axis=1) for c in self.compiled])

    def update(self, table: TrialTable, rng: np.random.Generator) -> None:
        """See `EffectModel`: counts are added; levels, components and structure stay."""
        data = np.column_stack([self.evidence(table), table.bins])
        for network in self.networks:
            network.update(data)
        self._compile()

    def to_json(self) -> dict[str, Any]:
        """See `EffectModel`."""
        return {
            "features": self.features.to_json(),
            "networks": [network.to_json() for network in self.networks],
            "weights": self.weights.tolist(),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> NetworkModel:
        """See `EffectModel`."""
        networks = [DiscreteNetwork.from_json(n) for n in data["networks"]]
        return cls(Features.from_json(data["features"]), networks, np.array(data["weights"]))


def network_class(name: str) -> type[NetworkModel]:
    """The class of networks learned by the method `name`."""
    return type(f"NetworkModel[{name}]", (NetworkModel,), {"method": name})


def _structures(
    method: str, features: Features, data: Ints, rng: np.random.Generator
) -> list[tuple[Structure, float]]:
    """Structures and their weights."""
    if method == "full":
        return [(fully_connected(features.names, LEVELS), 1.0)]
    if method == "pca":
        return [(components(["PC"], COMPONENTS), 1.0)]
    if method == "pca-two-blocks":
        return [(components(["ManipulatorPC", "ObjectPC"], COMPONENTS), 1.0)]
    states = dict(fully_connected(features.names, features.levels.levels).states)
    limits = search.Limits.effects_last(list(states), EFFECTS)
    if method == "k2":
        order = [ACTION, *features.names, EFFECT_X, EFFECT_Y]
        return [(search.k2(search.LocalScores(data, states, "k2"), order, limits), 1.0)]
    scores = search.LocalScores(data, states, "bde")
    if method == "bde":
        return [(search.greedy(scores, limits), 1.0)]
    if method == "bde-annealed":
        return [(search.annealed(scores, rng, limits), 1.0)]
    return list(search.mcmc(scores, rng, limits).structures)
