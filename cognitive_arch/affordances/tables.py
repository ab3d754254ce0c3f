"""Conditional probability tables that keep only the configurations they have seen (thesis Sec. 2.1.4).

The fully connected network has 2,125,764 configurations of parents, of which data fill a few hundred.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from cognitive_arch.affordances.trials import Floats, Ints
from cognitive_arch.errors import AffordanceError

MAX_CONFIGURATIONS = 2**62


def strides(sizes: tuple[int, ...]) -> Ints:
    """What each parent's state counts in the number of a configuration; the last parent's counts 1."""
    return np.array([prod(sizes[i + 1 :]) for i in range(len(sizes))], dtype=np.int64)


def places(keys: Ints, numbers: Ints) -> Ints:
    """1 + the place of each number in the sorted `keys`, or 0 for those that are not among them."""
    if not len(keys):
        return np.zeros(np.shape(numbers), dtype=np.int64)
    at = np.minimum(np.searchsorted(keys, numbers), len(keys) - 1)
    return np.where(keys[at] == numbers, at + 1, 0)


@dataclass
class ConditionalTable:
    """p(node | parents): counts and a Dirichlet prior.

    `states` of the node, `sizes` of its parents. `keys` (k,) are the numbers of the configurations seen,
    ascending; `counts` (1 + k, states) belong to them, after a first row that stays empty and stands for
    every configuration never seen. `prior` is the pseudo-count of every entry (the Dirichlet parameter
    minus 1), so that the maximum a posteriori estimate is (count + prior) / (total + states x prior).
    """

    states: int
    sizes: tuple[int, ...]
    prior: float
    keys: Ints = field(repr=False)
    counts: Floats = field(repr=False)

    @classmethod
    def empty(cls, states: int, sizes: tuple[int, ...], prior: float) -> ConditionalTable:
        """A table without data."""
        if not prior > 0:
            raise AffordanceError(f"a prior of {prior:g}; valid: a number of pseudo-counts above 0")
        if prod(sizes) > MAX_CONFIGURATIONS:
            raise AffordanceError(
                f"a node whose parents can be in {prod(sizes):.1e} ways; valid: fewer parents or levels"
            )
        return cls(states, tuple(sizes), prior, np.zeros(0, np.int64), np.zeros((1, states)))

    def configuration(self, parents: Ints) -> Ints:
        """The numbers (n,) of the configurations in `parents` (n, parents)."""
        if not self.sizes:
            return np.zeros(len(parents), dtype=np.int64)
        numbers: Ints = parents @ strides(self.sizes)
        return numbers

    def rows(self, parents: Ints) -> Ints:
        """Which row of `counts` and `probabilities` belongs to `parents` (n, parents): (n,)."""
        return places(self.keys, self.configuration(parents))

    def add(self, values: Ints, parents: Ints, weights: Floats | None = None) -> None:
        """Count trials: the node's states (n,) and its parents' (n, parents), each with its weight (n,)."""
        if weights is None:
            weights = np.ones(len(values))
        numbers = self.configuration(parents)
        keys = np.union1d(self.keys, numbers)
        counts = np.zeros((1 + len(keys), self.states))
        counts[places(keys, self.keys)] = self.counts[1:]
        np.add.at(counts, (places(keys, numbers), values), weights)
        self.keys, self.counts = keys, counts

    @property
    def probabilities(self) -> Floats:
        """(1 + k, states); the first row is that of configurations never seen."""
        raised = self.counts + self.prior
        rows: Floats = raised / raised.sum(axis=1, keepdims=True)
        return rows

    def dense(self) -> Floats:
        """The whole table, (states, configurations)."""
        whole: Floats = self.probabilities[places(self.keys, np.arange(prod(self.sizes)))].T
        return whole

    def to_json(self) -> dict[str, Any]:
        """What is needed to make the table again."""
        return {
            "prior": self.prior,
            "configurations": self.keys.tolist(),
            "counts": self.counts[1:].tolist(),
        }

    @classmethod
    def from_json(cls, states: int, sizes: tuple[int, ...], data: Mapping[str, Any]) -> ConditionalTable:
        """The table `to_json` described."""
        table = cls.empty(states, sizes, float(data["prior"]))
        keys = np.asarray(data["configurations"], dtype=np.int64)
        counts = np.asarray(data["counts"], dtype=np.float64).reshape(len(keys), states)
        if len(keys) and (keys[0] < 0 or keys[-1] >= prod(sizes) or (np.diff(keys) <= 0).any()):
            raise AffordanceError("a table speaks of configurations that its parents do not have")
        if not (np.isfinite(counts).all() and (counts >= 0).all()):
            raise AffordanceError("a table holds counts below zero")
        table.keys, table.counts = keys, np.vstack([table.counts, counts])
        return table
