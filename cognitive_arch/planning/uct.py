"""UCT: Monte Carlo planning in sampled worlds.

Kocsis and Szepesvári, "Bandit based Monte-Carlo Planning", ECML 2006, on noisy rules as in Lang and
Toussaint, JAIR 39 (2010): an action is a choice where exactly one of its rules applies, and a noise outcome
keeps the state and scales what comes after it.

Every state that an episode comes through is entered in the tree. In a new state an episode tries any
covered action, so beyond what is known it goes on at random down to the horizon.
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
from cognitive_arch.relational.symbols import GroundAction

NO_GAIN = 1e-9
"""What rounding may add to the value of doing nothing."""


@dataclass(frozen=True)
class Uct(ArrayPlanner):
    """UCT; `samples` is the number of episodes.

    `exploration` is the c of Q + c sqrt(ln n / n_a), by default the reward of one step: returns are sums of
    these, and actions differ mostly in how many steps sooner or later they bring it. On the three-layer stack
    of the simple scene, horizon 6, c = 0.1, 0.25, 0.5, 1, 2 gave plans worth 0.84, 0.93, 0.99, 1.03, 1.03.
    The plan follows the best actions and, of each, the likeliest listed outcome, as far as the goal has been
    seen from there. What the result says of it is what the plan itself achieves (`evaluation`), for the
    averages in the tree include every exploratory action.
    """

    samples: int = 2000
    exploration: float = 1.0
    noise_scale: float = 0.75
    discount: float = 0.95
    name: str = "uct"

    def __post_init__(self) -> None:
        if self.samples < 1:
            raise PlanningError(f"{self.samples} episodes are too few; valid: 1 or more")
        if self.exploration < 0:
            raise PlanningError(f"the exploration constant is {self.exploration}; valid: 0 or more")

    def solve(self, problem: Problem, horizon: int, rng: np.random.Generator) -> PlanResult:
        """See `ArrayPlanner.solve`.

        There is no plan if no action promises more than doing nothing: no episode has reached the goal, or
        it holds already.
        """
        tree = self._search(problem, horizon, rng)
        sequence = _greedy(problem.arrays, tree, horizon).tolist()
        result = evaluate_numbers(problem, sequence, rng, horizon=horizon, discount=self.discount)
        status = PlanStatus.PLAN if sequence else PlanStatus.NO_PLAN
        return PlanResult(status, named_actions(problem, sequence), result.value, result.peak)

    def action_values(
        self, problem: Problem, horizon: int, rng: np.random.Generator
    ) -> Mapping[GroundAction, float]:
        """The estimated return Q of every action tried at step 0, the reward of step 0 left out."""
        tree = self._search(problem, horizon, rng)
        entry, values = int(tree.first[0]), {}
        while entry != worlds.NOTHING:
            values[problem.actions[tree.action[entry]]] = float(tree.mean[entry])
            entry = int(tree.next[entry])
        return values

    def _search(self, problem: Problem, horizon: int, rng: np.random.Generator) -> Tree:
        draws = rng.random((self.samples, horizon, 2))
        # As floats, lest an integer setting has the kernel compiled anew.
        settings = map(float, (self.discount, self.noise_scale, self.exploration))
        return Tree(*_run_episodes(problem.arrays, draws, *settings))


class Tree(NamedTuple):
    """What the episodes have seen: states at each step (nodes), and actions tried there (entries).

    `table` numbers the nodes, the tag of a world being its step. Per node: `options`, how many actions there
    are to try, `tried`, how many of them have been, `visits`, and `first`, the latest of its entries. Per
    entry: `next` of the same node, `action`, how often it was `taken`, and `mean` return. No episode adds
    more than one of each per step. `stamp` and `candidates` (n_actions + 1,) are scratch space.
    """

    table: worlds.Table
    options: NDArray[np.int32]
    tried: NDArray[np.int32]
    visits: NDArray[np.int64]
    first: NDArray[np.int32]
    next: NDArray[np.int32]
    action: NDArray[np.int32]
    taken: NDArray[np.int64]
    mean: NDArray[np.float64]
    n_entries: NDArray[np.int64]  # (1,)
    stamp: NDArray[np.int64]
    candidates: NDArray[np.int32]


@numba.njit(cache=True, nogil=True)
def _make_tree(p, capacity, width):  # type: ignore[no-untyped-def]
    n_actions = len(p.action_ptr) - 1
    return Tree(
        worlds.make_table(capacity, width),
        np.empty(capacity, np.int32),
        np.empty(capacity, np.int32),
        np.empty(capacity, np.int64),
        np.empty(capacity, np.int32),
        np.empty(capacity, np.int32),
        np.empty(capacity, np.int32),
        np.empty(capacity, np.int64),
        np.empty(capacity),
        np.zeros(1, np.int64),
        np.full(n_actions + 1, -1, np.int64),
        np.empty(n_actions + 1, np.int32),
    )


@numba.njit(cache=True, nogil=True)
def _run_episodes(p, draws, discount, noise_scale, exploration):  # type: ignore[no-untyped-def]
    """The tree after one episode per row of `draws` (n_episodes, horizon, 2); its root is node 0."""
    n_episodes, horizon, _ = draws.shape
    w = worlds.make_world(p)
    start = w.key.copy()
    tree = _make_tree(p, n_episodes * horizon, len(start))
    entries = np.empty(horizon, np.int32)
    nodes = np.empty(horizon, np.int32)
    scale, reward = np.ones(horizon), np.zeros(horizon + 1)
    reward[0] = 1.0 if worlds.goal_holds(p, w) else 0.0
    for episode in range(n_episodes):
        worlds.load(w, start)
        for t in range(horizon):
            w.key[-1] = np.uint64(t)
            node = _node_of(p, w, tree, t)
            entry = _choose(p, w, tree, node, t, draws[episode, t, 0], exploration)
            if entry == worlds.NOTHING:
                return tree  # nothing applies at the start
            nodes[t], entries[t] = node, entry
            scale[t] = noise_scale if _act(p, w, np.int64(tree.action[entry]), draws[episode, t, 1]) else 1.0
            reward[t + 1] = 1.0 if worlds.goal_holds(p, w) else 0.0
        future = reward[horizon]
        for t in range(horizon - 1, -1, -1):
            future *= discount * scale[t]
            entry = entries[t]
            tree.visits[nodes[t]] += 1
            tree.taken[entry] += 1
            tree.mean[entry] += (future - tree.mean[entry]) / tree.taken[entry]
            future += reward[t]
    return tree


@numba.njit(cache=True, nogil=True)
def _act(p, w, action, u):  # type: ignore[no-untyped-def]
    """Let `action` happen in `w`, by `u`; returns whether the outcome was noise."""
    if action == len(p.action_ptr) - 1:
        return False
    outcome = worlds.draw_outcome(p, worlds.covering(p, w, action), u)
    if outcome == worlds.NOTHING:
        return True
    worlds.apply_outcome(p, w, outcome)
    w.length[0] = 0
    return False


@numba.njit(cache=True, nogil=True)
def _node_of(p, w, tree, t):  # type: ignore[no-untyped-def]
    """The node of world `w`, which is entered if it is new."""
    known = tree.table.size[0]
    node = worlds.number_of(tree.table, w.key)
    if node == known:
        tree.options[node] = worlds.covered_actions(p, w, t > 0, tree.candidates)
        tree.tried[node] = tree.visits[node] = 0
        tree.first[node] = worlds.NOTHING
    return node


@numba.njit(cache=True, nogil=True)
def _choose(p, w, tree, node, t, u, exploration):  # type: ignore[no-untyped-def]
    """The entry of the action to take: one not tried before, by `u`, else that of the highest bound."""
    if tree.tried[node] < tree.options[node]:
        return _try_another(p, w, tree, node, t, u)
    best, highest = worlds.NOTHING, -np.inf
    entry = tree.first[node]
    while entry != worlds.NOTHING:
        bonus = exploration * np.sqrt(np.log(tree.visits[node]) / tree.taken[entry])
        if tree.mean[entry] + bonus > highest:
            best, highest = entry, tree.mean[entry] + bonus
        entry = tree.next[entry]
    return best


@numba.njit(cache=True, nogil=True)
def _try_another(p, w, tree, node, t, u):  # type: ignore[no-untyped-def]
    """A new entry for one of the actions not tried yet, all being equally likely."""
    new = np.int32(tree.n_entries[0])
    entry = tree.first[node]
    while entry != worlds.NOTHING:
        tree.stamp[tree.action[entry]] = new
        entry = tree.next[entry]
    n = worlds.covered_actions(p, w, t > 0, tree.candidates)
    skip = int(u * (tree.options[node] - tree.tried[node]))
    for i in range(n):
        action = tree.candidates[i]
        if tree.stamp[action] == new:
            continue
        if skip == 0:
            tree.action[new], tree.taken[new], tree.mean[new] = action, 0, 0.0
            break
        skip -= 1
    tree.next[new] = tree.first[node]
    tree.first[node] = new
    tree.tried[node] += 1
    tree.n_entries[0] += 1
    return new


@numba.njit(cache=True, nogil=True)
def _greedy(p, tree, horizon):  # type: ignore[no-untyped-def]
    """The best actions from the start on, each having its likeliest listed outcome.

    They end where the goal holds, where the tree ends, and where it has never seen the goal from.
    """
    w = worlds.make_world(p)
    sequence = np.empty(horizon, np.int32)
    for t in range(horizon):
        w.key[-1] = np.uint64(t)
        node = tree.table.slots[worlds.find(tree.table, w.key)]
        if node == worlds.NOTHING or worlds.goal_holds(p, w):
            return sequence[:t]
        best, highest = worlds.NOTHING, NO_GAIN
        entry = tree.first[node]
        while entry != worlds.NOTHING:
            if tree.mean[entry] > highest:
                best, highest = entry, tree.mean[entry]
            entry = tree.next[entry]
        if best == worlds.NOTHING:
            return sequence[:t]
        action = np.int64(tree.action[best])
        sequence[t] = action
        if action < len(p.action_ptr) - 1:
            outcome = worlds.likeliest_outcome(p, worlds.covering(p, w, action))
            if outcome != worlds.NOTHING:
                worlds.apply_outcome(p, w, outcome)
                w.length[0] = 0
    return sequence
