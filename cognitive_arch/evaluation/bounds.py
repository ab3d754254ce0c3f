"""What no policy can beat: one that knows the noise levels, and the best of those that have to find out."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import coo_array, csr_array, hstack

from cognitive_arch.errors import SweepError, one_line
from cognitive_arch.evaluation.summary import HELP_COST
from cognitive_arch.evaluation.sweep import NOISE, SANDWICH
from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.noise import NoiseLevels, capability
from cognitive_arch.execution.symbolic import releases
from cognitive_arch.planning.cheapest import Way, cheapest_way
from cognitive_arch.relational.symbols import Goal, GroundAction, State, satisfied
from cognitive_arch.relational.transition import apply_literals, covering_rule
from cognitive_arch.session import Setting
from cognitive_arch.world.anchoring import WorldModel

LEAST = 1e-6
FAILURES = 13
"""After so many failed attempts in one episode the bounds let a policy know the levels."""

CAPABILITIES = tuple(f.name for f in fields(NoiseLevels))
Floats = NDArray[np.float64]


class Task:
    """A task in a scene, in the symbolic world: what can be done, and at which level each action fails."""

    def __init__(self, scene: str, quiet_release: bool, task: str = SANDWICH) -> None:
        setting = Setting.load(scene)
        environment = make_environment(
            "symbolic",
            setting.domain,
            setting.scene,
            setting.rules,
            noise=NoiseLevels(),
            quiet_release=quiet_release,
        )
        state = WorldModel().update(environment.reset(0))
        self.start: State = state.atoms()
        self.goal: Goal = setting.understand(task).goals[-1]
        self.rules = setting.rules.ground(state.entities, environment.skills)
        self._quiet = {rule.action.name for rule in self.rules if quiet_release and releases(rule)}
        self._kinds = setting.domain.capabilities

    def capability(self, action: GroundAction) -> int | None:
        """Whose level applies to `action`, as its place in `CAPABILITIES`; None if it never fails."""
        if action.name in self._quiet:
            return None
        return CAPABILITIES.index(capability(action, self._kinds))

    def cheapest(self, state: State, levels: NoiseLevels, limit: float = float("inf")) -> Way | None:
        """The cheapest way to the goal for who knows `levels`."""

        def chance(action: GroundAction) -> float:
            which = self.capability(action)
            return 1.0 if which is None else max(1.0 - astuple(levels)[which], LEAST)

        return cheapest_way(state, self.goal, self.rules, chance, limit)

    def after(self, state: State, action: GroundAction) -> State:
        """The state once `action` has worked."""
        rule = covering_rule(self.rules, action, state)
        assert rule is not None
        return apply_literals(state, rule.outcomes[0].literals)


def omniscient_cost(
    scene: str, levels: NoiseLevels, quiet_release: bool, help_cost: float = HELP_COST, task: str = SANDWICH
) -> float:
    """Expected cost of the best policy that knows `levels`, in the symbolic world.

    A failure teaches it nothing, so what is best once is best again: the cheapest way, each action at
    1 / chance attempts, or help at once. The limit of 50 actions is left out.
    """
    world = Task(scene, quiet_release, task)
    way = world.cheapest(world.start, levels, help_cost)
    return help_cost if way is None else way.cost


class Step(NamedTuple):
    """Something to do: the capability it takes (None: it never fails), and the state it leads to."""

    capability: int | None
    after: int


Steps = tuple[tuple[Step, ...] | None, ...]
"""What to choose from in every state, by number; 0 is the start, None stands at a goal."""


def steps_of(task: Task, noise: Sequence[float] = NOISE) -> Steps:
    """All states on ways that are cheapest at some levels out of `noise`, and the steps they begin with.

    Steps that lead back to where one has been (to drop what was taken) are left out.
    """
    grid = [NoiseLevels(a, b, c, c) for a, b, c in itertools.product(noise, repeat=3)]
    number = {task.start: 0}
    found: list[tuple[Step, ...] | None] = []
    for state in (reached := [task.start]):  # grows on the way
        if satisfied(task.goal, state):
            found.append(None)
            continue
        ways = (task.cheapest(state, levels) for levels in grid)
        actions = {way.actions[0]: None for way in ways if way is not None}
        steps = []
        for action in actions:
            after = task.after(state, action)
            if after not in number:
                number[after] = len(reached)
                reached.append(after)
            steps.append(Step(task.capability(action), number[after]))
        found.append(tuple(dict.fromkeys(steps)))
    return _onwards(found)


def _onwards(found: Sequence[tuple[Step, ...] | None]) -> Steps:
    """Without the steps that close a circle, seen from state 0."""
    kept: dict[int, tuple[Step, ...] | None] = {}

    def visit(state: int, path: frozenset[int]) -> None:
        steps = found[state]
        if steps is not None:
            steps = tuple(step for step in steps if step.after not in path)
        kept[state] = steps
        for step in steps or ():
            if step.after not in kept:
                visit(step.after, path | {step.after})

    visit(0, frozenset({0}))
    return tuple(kept.get(state) for state in range(len(found)))


@dataclass(frozen=True)
class Bound:
    """The least that was asked for, and by its policy the cost and the success at each level."""

    least: float
    costs: tuple[float, ...]
    success: tuple[float, ...]


@dataclass(frozen=True)
class Learner:
    """Policies that know the task, and that the levels are among `levels`, but not which of them.

    What such a policy has seen is where it is, and for each capability how often it worked and failed: a
    history. How likely the coins are to make a history does not depend on the policy, so its cost at each
    level is linear in how far it goes in each history (the sequence form of Koller, Megiddo and von Stengel
    1996), and bounds are linear programmes. After `failures` failed attempts it is told the levels, and can
    be sure to succeed: that makes the least cost no higher.
    """

    steps: Steps
    levels: Sequence[NoiseLevels]
    help_cost: float = HELP_COST
    failures: int = FAILURES

    def least_mean(
        self, at_most: Mapping[int, float] | None = None, succeeds: Mapping[int, float] | None = None
    ) -> Bound:
        """The least mean cost over all levels with costs of `at_most`, successes of at least `succeeds`."""
        _, cost, success = self._form
        rows = [cost[n] for n in at_most or ()] + [-success[n] for n in succeeds or ()]
        right = [*(at_most or {}).values(), *(-least for least in (succeeds or {}).values())]
        return self._solve(cost.mean(axis=0), rows, right)

    def least_ratio(self, reference: Sequence[float], succeeds: Mapping[int, float] | None = None) -> Bound:
        """The least r such that the cost is at most r * `reference` at every level."""
        _, cost, success = self._form
        rows = [*cost, *(-success[n] for n in succeeds or ())]
        right = [0.0] * len(cost) + [-least for least in (succeeds or {}).values()]
        ratio = np.array([-value for value in reference] + [0.0] * (len(rows) - len(cost)))
        return self._solve(np.zeros(cost.shape[1]), rows, right, ratio)

    def _solve(
        self, target: Floats, rows: Sequence[Floats], right: Sequence[float], ratio: Floats | None = None
    ) -> Bound:
        """Minimise `target`, or with `ratio` (its column in `rows`) the ratio."""
        balance, cost, success = self._form
        limits = csr_array(np.array(rows)) if rows else None
        if ratio is not None:
            target = np.append(target, 1.0)
            balance = hstack([balance, csr_array((balance.shape[0], 1))])
            limits = hstack([limits, csr_array(ratio[:, None])])
        begin = np.zeros(balance.shape[0])
        begin[0] = 1.0
        found = linprog(target, limits, list(right) or None, balance, begin, bounds=(0, None), method="highs")
        if found.x is None:
            raise SweepError(f"the bound cannot be computed: {one_line(found.message)}")
        plays = found.x[: cost.shape[1]]
        return Bound(float(found.fun), tuple(map(float, cost @ plays)), tuple(map(float, success @ plays)))

    @cached_property
    def _form(self) -> tuple[csr_array, Floats, Floats]:
        """Who chooses something got there before; what each choice costs and brings, per level and choice."""
        chance = 1.0 - np.array([astuple(levels) for levels in self.levels])
        number: dict[tuple[int, tuple[int, ...]], int] = {(0, (0,) * 2 * chance.shape[1]): 0}
        rows, columns, signs = [], [], []
        cost: list[Floats] = []
        success: list[Floats] = []
        for here, (state, seen) in enumerate(histories := list(number)):  # grows on the way
            likely = _likely(chance, seen)
            for pays, brings, later in self._choices(state, seen, chance):
                for history in later:
                    if history not in number:
                        number[history] = len(histories)
                        histories.append(history)
                ends = [here, *(number[history] for history in later)]
                rows += ends
                columns += [len(cost)] * len(ends)
                signs += [1.0] + [-1.0] * len(later)
                cost.append(likely * pays)
                success.append(likely * brings)
        balance = coo_array((signs, (rows, columns)), shape=(len(histories), len(cost))).tocsr()
        return balance, np.array(cost).T, np.array(success).T

    def _choices(
        self, state: int, seen: tuple[int, ...], chance: Floats
    ) -> list[tuple[Floats | float, float, list[tuple[int, tuple[int, ...]]]]]:
        """Cost, success, and the histories that may follow, of all that can be chosen."""
        steps = self.steps[state]
        if steps is None:
            return [(0.0, 1.0, [])]
        if sum(seen[1::2]) >= self.failures:
            return [(self._known[state], 1.0, [])]
        choices: list[tuple[Floats | float, float, list[tuple[int, tuple[int, ...]]]]] = []
        choices.append((self.help_cost, 0.0, []))
        for which, after in steps:
            if which is None:
                choices.append((1.0, 0.0, [(after, seen)]))
                continue
            worked, failed = list(seen), list(seen)
            worked[2 * which] += 1
            failed[2 * which + 1] += 1
            choices.append((1.0, 0.0, [(after, tuple(worked)), (state, tuple(failed))]))
        return choices

    @cached_property
    def _known(self) -> Floats:
        """What remains to be paid in each state by who knows the levels: (n_states, n_levels)."""
        price = 1.0 / np.maximum(1.0 - np.array([astuple(levels) for levels in self.levels]), LEAST)
        known = np.full((len(self.steps), len(price)), self.help_cost)
        for state, steps in enumerate(self.steps):
            if steps is None:
                known[state] = 0.0
        while True:  # Bellman and Ford: as often as the longest way has steps
            before = known.copy()
            for state, steps in enumerate(self.steps):
                for which, after in steps or ():
                    step = 1.0 if which is None else price[:, which]
                    known[state] = np.minimum(known[state], step + known[after])
            if np.array_equal(known, before):
                return known


def _likely(chance: Floats, seen: tuple[int, ...]) -> Floats:
    """How likely the coins are to make a history, per level."""
    counts = np.array(seen).reshape(-1, 2)
    likely: Floats = np.prod(chance ** counts[:, 0] * (1.0 - chance) ** counts[:, 1], axis=1)
    return likely
