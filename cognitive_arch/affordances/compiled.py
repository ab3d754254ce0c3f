"""Questions to a network as look-ups: the effects' CPDs, laid out as arrays, one row per configuration.

All nodes but the effects are given, and set by the robot before it acts (interventional, thesis Sec. 5.3.2);
so p(EffectX, EffectY | the rest) is the product of the effects' own CPDs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from cognitive_arch.affordances.network import DiscreteNetwork
from cognitive_arch.affordances.structures import EFFECT_X, EFFECTS
from cognitive_arch.affordances.tables import places, strides
from cognitive_arch.affordances.trials import N_BINS, Floats, Ints
from cognitive_arch.errors import AffordanceError

MAX_INDEX = 4_000_000


@dataclass(frozen=True, eq=False)
class Factor:
    """One effect's CPD over both effects, `rows` (1 + k, 5, 5); the first is for configurations never seen.

    `steps` (evidence,) makes a configuration's number of evidence; `index` (configurations,) leads from there
    to a row. Where there are too many configurations for that, the sorted `keys` (k,) are searched.
    """

    steps: Ints
    keys: Ints
    index: Ints | None
    rows: Floats

    def at(self, number: Any) -> Any:
        """Rows of configurations, one or many."""
        return places(self.keys, number) if self.index is None else self.index[number]


@dataclass(frozen=True, eq=False)
class CompiledEffects:
    """p(EffectX, EffectY | evidence): two look-ups and one product. `evidence` names the given nodes."""

    evidence: tuple[str, ...]
    x: Factor
    y: Factor

    @classmethod
    def of(cls, network: DiscreteNetwork, evidence: Sequence[str]) -> CompiledEffects:
        """Lay out the CPDs of both effects for evidence in this order."""
        return cls(tuple(evidence), *(_factor(network, node, evidence) for node in EFFECTS))

    def __call__(self, states: Ints) -> Floats:
        """(5, 5) for the evidence's states (evidence,)."""
        x, y = self.x, self.y
        product: Floats = x.rows[x.at(x.steps.dot(states))] * y.rows[y.at(y.steps.dot(states))]
        return product

    def many(self, states: Ints) -> Floats:
        """(n, 5, 5) for states (n, evidence)."""
        answer = np.ones((len(states), N_BINS, N_BINS))
        for factor in (self.x, self.y):
            answer *= factor.rows[factor.at(states @ factor.steps)]
        return answer

    def unseen(self, states: Ints) -> Floats:
        """Whether x's and y's CPDs have never seen the configuration, (n, 2): a random prediction."""
        return np.stack([f.at(states @ f.steps) == 0 for f in (self.x, self.y)], axis=1)


def _factor(network: DiscreteNetwork, node: str, evidence: Sequence[str]) -> Factor:
    structure, table = network.structure, network.tables[node]
    parents = structure.of(node)
    given = [p for p in parents if p not in EFFECTS]
    for parent in given:
        if parent not in evidence:
            raise AffordanceError(f"{node} depends on {parent}, which is not given")
    sizes = tuple(structure.states[p] for p in given)
    steps = np.zeros(len(evidence), dtype=np.int64)
    for parent, step in zip(given, strides(sizes), strict=True):
        steps[list(evidence).index(parent)] = step
    other = next((p for p in parents if p in EFFECTS), None)
    states = (table.keys[:, None] // strides(table.sizes)) % np.array(table.sizes, dtype=np.int64)
    number = states[:, [parents.index(p) for p in given]] @ strides(sizes)
    keys = np.unique(number)
    index = places(keys, np.arange(prod(sizes))) if prod(sizes) <= MAX_INDEX else None
    row = places(keys, number)
    # Indexed [configuration, other effect, this effect].
    probabilities = table.probabilities
    rows = np.tile(probabilities[0], (1 + len(keys), N_BINS, 1))
    if other is None:
        rows[row] = probabilities[1:, None, :]
    else:
        rows[row, states[:, parents.index(other)]] = probabilities[1:]
    return Factor(steps, keys, index, rows.transpose(0, 2, 1) if node == EFFECT_X else rows)
