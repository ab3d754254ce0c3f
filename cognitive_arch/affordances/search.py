"""Structure learning: K2, greedy and annealed search by the BDe score, Markov chains over structures.

Thesis Sec. 2.1.3. Local scores are computed on bare arrays: a search asks for thousands of them, and each
costs well below a millisecond on 28,000 rows. BDe equals pgmpy's BDeu; pgmpy's K2 (1.1) counts configurations
without data, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from math import log

import numpy as np
from scipy.special import gammaln

from cognitive_arch.affordances.structures import Structure
from cognitive_arch.affordances.trials import Floats, Ints
from cognitive_arch.errors import AffordanceError, unknown

SCORES = ("k2", "bde")
DENSE = 2_000_000
ESS = 10.0
"""Equivalent sample size of the BDe score."""

Parents = dict[str, frozenset[str]]


@dataclass
class LocalScores:
    """log marginal likelihood of one node given its parents, remembered.

    `data` (n, nodes) are states, without missing values; `states` names the columns and says how many states
    each has. `kind` is `k2` (all Dirichlet parameters 1) or `bde` (likelihood equivalent, uniform, with the
    equivalent sample size `ess`).
    """

    data: Ints
    states: Mapping[str, int]
    kind: str = "bde"
    ess: float = ESS
    known: dict[tuple[str, frozenset[str]], float] = field(default_factory=dict)
    _rows: Ints = field(init=False)
    _weights: Floats = field(init=False)

    def __post_init__(self) -> None:
        if self.kind not in SCORES:
            raise AffordanceError(unknown("score", self.kind, SCORES))
        if self.data.shape[1] != len(self.states) or not len(self.data):
            raise AffordanceError("structure learning needs trials with a value for every node")
        rows, counts = np.unique(self.data, axis=0, return_counts=True)
        self._rows, self._weights = np.ascontiguousarray(rows.T), counts.astype(np.float64)

    def __call__(self, node: str, parents: frozenset[str]) -> float:
        """The score of `node` with `parents`."""
        key = (node, parents)
        if key not in self.known:
            self.known[key] = self._score(node, parents)
        return self.known[key]

    def _score(self, node: str, parents: frozenset[str]) -> float:
        place = {name: i for i, name in enumerate(self.states)}
        states = self.states[node]
        number = np.zeros(self._rows.shape[1], dtype=np.int64)
        configurations = 1
        for parent in sorted(parents):
            number = number * self.states[parent] + self._rows[place[parent]]
            configurations *= self.states[parent]
        seen = configurations
        if configurations * states > DENSE:
            _, number = np.unique(number, return_inverse=True)
            seen = int(number.max()) + 1
        cells = np.bincount(number * states + self._rows[place[node]], self._weights, seen * states)
        counts = cells.reshape(seen, states)
        # A configuration without data adds nothing, so only those with data are summed.
        counts = counts[counts.sum(axis=1) > 0]
        if self.kind == "k2":
            cell, row = 1.0, float(states)
        else:
            row = self.ess / configurations
            cell = row / states
        totals = counts.sum(axis=1)
        inner = gammaln(counts + cell).sum(axis=1) - states * gammaln(cell)
        return float((gammaln(row) - gammaln(totals + row) + inner).sum())

    def total(self, parents: Mapping[str, frozenset[str]]) -> float:
        """The score of a whole structure."""
        return sum(self(node, parents.get(node, frozenset())) for node in self.states)


@dataclass(frozen=True)
class Limits:
    """What a structure may have: at most `parents` per node, and no edge (parent, child) of `forbidden`."""

    parents: int = 4
    forbidden: frozenset[tuple[str, str]] = frozenset()

    @classmethod
    def effects_last(cls, nodes: Sequence[str], effects: Sequence[str], parents: int = 4) -> Limits:
        """No edge from an effect to what was there before the robot acted (interventional nodes)."""
        before = [n for n in nodes if n not in effects]
        return cls(parents, frozenset((e, n) for e in effects for n in before))

    def allow(self, parent: str, child: str, parents: Mapping[str, frozenset[str]]) -> bool:
        """Whether `parent` may be added to the parents of `child`."""
        return (parent, child) not in self.forbidden and len(parents[child]) < self.parents


def to_structure(parents: Mapping[str, frozenset[str]], states: Mapping[str, int]) -> Structure:
    """The structure, with parents in the order of the nodes."""
    return Structure(
        states, {node: tuple(n for n in states if n in parents.get(node, ())) for node in states}
    )


def k2(scores: LocalScores, order: Sequence[str], limits: Limits | None = None) -> Structure:
    """K2: each node in turn takes, one by one, those earlier nodes as parents that raise the score most."""
    limits = limits or Limits()
    if sorted(order) != sorted(scores.states):
        raise AffordanceError("an order for K2 names every node once")
    parents: Parents = {node: frozenset() for node in order}
    for place, node in enumerate(order):
        while True:
            mine = parents[node]
            candidates = [p for p in order[:place] if p not in mine and limits.allow(p, node, parents)]
            if not candidates:
                break
            best = max(candidates, key=lambda p: scores(node, mine | {p}))
            if scores(node, mine | {best}) <= scores(node, mine):
                break
            parents[node] = mine | {best}
    return to_structure(parents, scores.states)


def greedy(scores: LocalScores, limits: Limits | None = None, start: Structure | None = None) -> Structure:
    """Hill climbing: the best single edge added, removed or turned, until nothing raises the score."""
    limits = limits or Limits()
    nodes = list(scores.states)
    parents: Parents = {n: frozenset(start.of(n)) if start else frozenset() for n in nodes}
    while True:
        best_gain, best_move = 1e-9, None
        for u, v in permutations(nodes, 2):
            for move in _moves(u, v, parents, limits):
                gain = _gain(scores, parents, move)
                if gain > best_gain and _acyclic(parents, move):
                    best_gain, best_move = gain, move
        if best_move is None:
            return to_structure(parents, scores.states)
        parents |= best_move


def _moves(u: str, v: str, parents: Parents, limits: Limits) -> list[Parents]:
    """What can be done about the edge u -> v: changed parents of the nodes concerned."""
    if u in parents[v]:
        removed = {v: parents[v] - {u}}
        if limits.allow(v, u, parents):
            return [removed, {**removed, u: parents[u] | {v}}]
        return [removed]
    if v not in parents[u] and limits.allow(u, v, parents):
        return [{v: parents[v] | {u}}]
    return []


def _gain(scores: LocalScores, parents: Parents, move: Parents) -> float:
    return sum(scores(node, new) - scores(node, parents[node]) for node, new in move.items())


def _acyclic(parents: Parents, move: Parents) -> bool:
    """Whether no circle goes through the nodes that a move changes."""
    for node, new in move.items():
        stack, seen = list(new), set(new)
        while stack:
            at = stack.pop()
            if at == node:
                return False
            ahead = move.get(at, parents[at]) - seen
            seen |= ahead
            stack += ahead
    return True


def annealed(
    scores: LocalScores,
    rng: np.random.Generator,
    limits: Limits | None = None,
    steps: int = 6000,
    hottest: float = 50.0,
    coldest: float = 0.2,
) -> Structure:
    """Simulated annealing from the greedy structure; ends with a greedy climb from the best one met."""
    limits = limits or Limits()
    first = greedy(scores, limits)
    best: Parents = {n: frozenset(first.of(n)) for n in scores.states}
    best_score = scores.total(best)

    def temperature(step: int) -> float:
        return hottest * (coldest / hottest) ** (step / max(1, steps - 1))

    def watch(_: int, parents: Parents, score: float) -> None:
        nonlocal best, best_score
        if score > best_score + 1e-9:
            best, best_score = dict(parents), score

    _walk(scores, rng, limits, dict(best), steps, temperature, watch)
    return greedy(scores, limits, to_structure(best, scores.states))


@dataclass(frozen=True)
class Chain:
    """Structures a Markov chain met with how often, most frequent first; p(edge | data); how many moves of
    all proposed were accepted."""

    structures: tuple[tuple[Structure, float], ...]
    edges: Mapping[tuple[str, str], float]
    accepted: float


def mcmc(
    scores: LocalScores,
    rng: np.random.Generator,
    limits: Limits | None = None,
    steps: int = 6000,
    burn_in: int = 1500,
    keep: int = 20,
) -> Chain:
    """Metropolis-Hastings over structures with a uniform prior, started from the greedy structure.

    Frequencies of the `keep` most frequent structures are normalised among themselves; the edges'
    probabilities are over all samples.
    """
    limits = limits or Limits()
    first = greedy(scores, limits)
    seen: dict[tuple[tuple[str, frozenset[str]], ...], int] = {}
    edges: dict[tuple[str, str], int] = {}

    def watch(step: int, parents: Parents, _: float) -> None:
        if step >= burn_in:
            key = tuple(parents.items())
            seen[key] = seen.get(key, 0) + 1

    start: Parents = {n: frozenset(first.of(n)) for n in scores.states}
    accepted = _walk(scores, rng, limits, start, steps, lambda _: 1.0, watch)
    total = sum(seen.values())
    for key, count in seen.items():
        for node, parents in key:
            for parent in parents:
                edges[parent, node] = edges.get((parent, node), 0) + count
    most = sorted(seen.items(), key=lambda item: -item[1])[:keep]
    kept = sum(count for _, count in most)
    return Chain(
        tuple((to_structure(dict(key), scores.states), count / kept) for key, count in most),
        {edge: count / total for edge, count in sorted(edges.items())},
        accepted / max(1, steps),
    )


def _walk(
    scores: LocalScores,
    rng: np.random.Generator,
    limits: Limits,
    parents: Parents,
    steps: int,
    temperature: Callable[[int], float],
    watch: Callable[[int, Parents, float], None],
) -> int:
    """A random walk; returns how many moves were accepted.

    A move is an ordered pair and one of two kinds (add or remove it, turn it), each as likely, so that every
    move and its inverse are proposed equally often and need no correction.
    """
    nodes = list(scores.states)
    score, accepted = scores.total(parents), 0
    for step in range(steps):
        u, v = (nodes[i] for i in rng.choice(len(nodes), 2, replace=False))
        kind, threshold = int(rng.integers(2)), log(max(rng.random(), 1e-300))
        move = _proposed(u, v, kind, parents, limits)
        if move is not None:
            gain = _gain(scores, parents, move)
            if threshold < gain / temperature(step) and _acyclic(parents, move):
                # In place, in the fixed order of nodes: equal structures have equal keys.
                parents |= move
                score, accepted = score + gain, accepted + 1
        watch(step, parents, score)
    return accepted


def _proposed(u: str, v: str, kind: int, parents: Parents, limits: Limits) -> Parents | None:
    present = u in parents[v]
    if kind == 0:
        if present:
            return {v: parents[v] - {u}}
        if v not in parents[u] and limits.allow(u, v, parents):
            return {v: parents[v] | {u}}
    elif present and limits.allow(v, u, parents):
        return {v: parents[v] - {u}, u: parents[u] | {v}}
    return None
