"""Sparse sampling trees (SST): look ahead over a few sampled outcomes of every action.

Kearns, Mansour and Ng, "A Sparse Sampling Algorithm for Near-Optimal Planning in Large Markov Decision
Processes", Machine Learning 49 (2002), on noisy rules as in `uct`.

Where the published tree comes to the same state at the same step more than once, it draws new samples for
it; here such nodes are one (their estimate is one of the same distribution), so that the tree is a layered
graph, built forwards and valued backwards. That only saves work, as does not to expand a state where the
goal holds: there nothing is better than to do nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PlanningError
from cognitive_arch.planning import worlds
from cognitive_arch.planning.base import ArrayPlanner, PlanResult, PlanStatus, named_actions
from cognitive_arch.planning.evaluation import evaluate_numbers
from cognitive_arch.planning.problem import Problem
from cognitive_arch.planning.uct import NO_GAIN
from cognitive_arch.relational.symbols import GroundAction


@dataclass(frozen=True)
class SparseSampling(ArrayPlanner):
    """SST with `branch` samples per action.

    No more than `max_nodes` samples are drawn: the look-ahead goes down to the last step for which all of
    them fit, and from there on nothing is done. The plan follows the best actions and, of each, the likeliest
    listed outcome; what the result says of it is what the plan itself achieves (`evaluation`), for the
    best of a few samples promises too much.
    """

    branch: int = 2
    max_nodes: int = 300_000
    noise_scale: float = 0.75
    discount: float = 0.95
    name: str = "sst"

    def __post_init__(self) -> None:
        if self.branch < 1:
            raise PlanningError(f"{self.branch} samples per action are too few; valid: 1 or more")

    def solve(self, problem: Problem, horizon: int, rng: np.random.Generator) -> PlanResult:
        """See `ArrayPlanner.solve`.

        There is no plan if no action promises more than doing nothing: the goal is not within the steps
        looked ahead, or it holds already.
        """
        graph = self._look_ahead(problem, horizon, rng)
        sequence = _greedy(problem.arrays, graph, horizon).tolist()
        result = evaluate_numbers(problem, sequence, rng, horizon=horizon, discount=self.discount)
        status = PlanStatus.PLAN if sequence else PlanStatus.NO_PLAN
        return PlanResult(status, named_actions(problem, sequence), result.value, result.peak)

    def action_values(
        self, problem: Problem, horizon: int, rng: np.random.Generator
    ) -> Mapping[GroundAction, float]:
        """The estimated return Q of every action covered at step 0, the reward of step 0 left out."""
        graph = self._look_ahead(problem, horizon, rng)
        options = range(int(graph.node_ptr[0]), int(graph.node_ptr[1]))
        return {problem.actions[graph.action[i]]: float(graph.q[i]) for i in options}

    def _look_ahead(self, problem: Problem, horizon: int, rng: np.random.Generator) -> Graph:
        draws = rng.random(self.max_nodes)
        graph = Graph(*_look_ahead(problem.arrays, draws, horizon, self.branch))
        if graph.layers[0] == 0:
            raise PlanningError(f"max_nodes is {self.max_nodes}, which is too low for a single step")
        _value(problem.arrays, graph, horizon, float(self.discount), float(self.noise_scale))
        return graph


class Graph(NamedTuple):
    """What was looked at: nodes (a state at a step), their options (actions) and the samples of these.

    `table` numbers the nodes, the tag of a world being its step; nodes of a step have consecutive numbers,
    and those of the first `layers[0]` steps are expanded. Rows are sparse as in `Arrays`: options of node i
    are `node_ptr[i]:node_ptr[i + 1]`, samples of option j `option_ptr[j]:option_ptr[j + 1]`. A sample leads
    to `successor`, by noise or not; an option has an `action` and its estimated return `q`.
    """

    table: worlds.Table
    layers: NDArray[np.int64]  # (1,)
    node_ptr: NDArray[np.int32]
    option_ptr: NDArray[np.int32]
    action: NDArray[np.int32]
    q: NDArray[np.float64]
    successor: NDArray[np.int32]
    noise: NDArray[np.bool_]


@numba.njit(cache=True, nogil=True)
def _look_ahead(p, draws, horizon, branch):  # type: ignore[no-untyped-def]
    """The graph down to `horizon`, or to where the numbers in `draws` (max_nodes,) come to an end."""
    limit = len(draws)
    w = worlds.make_world(p)
    g = Graph(
        worlds.make_table(limit + 1, len(w.key)),
        np.zeros(1, np.int64),
        np.zeros(limit + 2, np.int32),
        np.zeros(limit + 1, np.int32),
        np.empty(limit, np.int32),
        np.empty(limit),
        np.empty(limit, np.int32),
        np.empty(limit, np.bool_),
    )
    worlds.number_of(g.table, w.key)
    candidates = np.empty(len(p.action_ptr), np.int32)
    node, n_options = 0, np.int64(0)
    for t in range(horizon):
        end = g.table.size[0]
        while node < end:
            worlds.load(w, g.table.keys[node])
            if not worlds.goal_holds(p, w):
                n = worlds.covered_actions(p, w, t > 0, candidates)
                for i in range(n):
                    if not _draw(p, w, g, np.int64(candidates[i]), n_options, t, draws, branch):
                        return g
                    n_options += 1
            node += 1
            g.node_ptr[node] = n_options
        g.layers[0] = t + 1
    return g


@numba.njit(cache=True, nogil=True)
def _draw(p, w, g, action, option, t, draws, branch):  # type: ignore[no-untyped-def]
    """Sample what `action` makes of `w`; False if there is no room for that many samples."""
    idle = action == len(p.action_ptr) - 1
    sample = g.option_ptr[option]
    end = sample + (1 if idle else branch)
    if end > len(draws):
        return False
    g.action[option] = action
    g.option_ptr[option + 1] = end
    rule = worlds.NOTHING if idle else worlds.covering(p, w, action)
    for k in range(sample, end):
        outcome = worlds.NOTHING if idle else worlds.draw_outcome(p, rule, draws[k])
        if outcome != worlds.NOTHING:
            worlds.apply_outcome(p, w, outcome)
        w.key[-1] = np.uint64(t + 1)
        g.successor[k] = worlds.number_of(g.table, w.key)
        g.noise[k] = outcome == worlds.NOTHING and not idle
        worlds.undo(w)
    return True


@numba.njit(cache=True, nogil=True)
def _value(p, g, horizon, discount, noise_scale):  # type: ignore[no-untyped-def]
    """Fill in `g.q`, from the last step looked at to the first."""
    value = np.zeros(g.table.size[0])
    w = worlds.make_world(p)
    for node in range(g.table.size[0] - 1, -1, -1):
        worlds.load(w, g.table.keys[node])
        t = np.int64(w.key[-1])
        goal = worlds.goal_holds(p, w)
        if goal or t >= g.layers[0]:
            if goal:
                for step in range(horizon - t + 1):
                    value[node] += discount**step
            continue
        for option in range(g.node_ptr[node], g.node_ptr[node + 1]):
            first, end = g.option_ptr[option], g.option_ptr[option + 1]
            total = 0.0
            for k in range(first, end):
                total += value[g.successor[k]] * (noise_scale if g.noise[k] else 1.0)
            g.q[option] = discount * total / (end - first)
            value[node] = max(value[node], g.q[option])


@numba.njit(cache=True, nogil=True)
def _greedy(p, g, horizon):  # type: ignore[no-untyped-def]
    """The best actions from the start on, each having its likeliest listed outcome.

    They end where the goal holds, where no sample led to, and where the goal is not seen from.
    """
    w = worlds.make_world(p)
    sequence = np.empty(horizon, np.int32)
    for t in range(horizon):
        w.key[-1] = np.uint64(t)
        node = g.table.slots[worlds.find(g.table, w.key)]
        if node == worlds.NOTHING or t >= g.layers[0]:
            return sequence[:t]
        best, highest = worlds.NOTHING, NO_GAIN
        for option in range(g.node_ptr[node], g.node_ptr[node + 1]):
            if g.q[option] > highest:
                best, highest = option, g.q[option]
        if best == worlds.NOTHING:  # a state where the goal holds has no options either
            return sequence[:t]
        action = np.int64(g.action[best])
        sequence[t] = action
        if action < len(p.action_ptr) - 1:
            outcome = worlds.likeliest_outcome(p, worlds.covering(p, w, action))
            if outcome != worlds.NOTHING:
                worlds.apply_outcome(p, w, outcome)
                w.length[0] = 0
    return sequence
