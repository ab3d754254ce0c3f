"""What no policy can beat: one that knows the noise levels, and the best of those that have to find out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import lil_array

from cognitive_arch.evaluation.summary import HELP_COST
from cognitive_arch.evaluation.sweep import SANDWICH
from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.execution.symbolic import releases
from cognitive_arch.planning.cheapest import cheapest_way
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.session import Setting
from cognitive_arch.world.anchoring import WorldModel

LEAST = 1e-6
TRIES = 40
"""Attempts at one step beyond which nobody goes."""


def omniscient_cost(
    scene: str, levels: NoiseLevels, quiet_release: bool, help_cost: float = HELP_COST, task: str = SANDWICH
) -> float:
    """Expected cost of the best policy that knows `levels`, in the symbolic world.

    A failure teaches it nothing, so what is best once is best again: the cheapest way, each action at
    1 / chance attempts, or help at once. The limit of 50 actions is left out.
    """
    setting = Setting.load(scene)
    goal = setting.understand(task).goals[-1]
    environment = make_environment(
        "symbolic", setting.domain, setting.scene, setting.rules, noise=levels, quiet_release=quiet_release
    )
    state = WorldModel().update(environment.reset(0))
    rules = setting.rules.ground(state.entities, environment.skills)
    releasing = {rule.action.name for rule in rules if releases(rule)}

    def chance(action: GroundAction) -> float:
        quiet = quiet_release and action.name in releasing
        return 1.0 if quiet else max(1.0 - levels.of(action, setting.domain.capabilities), LEAST)

    way = cheapest_way(state.atoms(), goal, rules, chance, help_cost)
    return help_cost if way is None else way.cost


class Regret(NamedTuple):
    """The least worst ratio to given costs, and what its policy costs at each level."""

    ratio: float
    costs: tuple[float, ...]


def least_regret(levels: Sequence[float], reference: Sequence[float], help_cost: float = HELP_COST) -> Regret:
    """The smallest ratio r such that some policy costs at most r * `reference` at every one of `levels`.

    The task is the simple scene with equal arms: two takes that fail at the same unknown level, each followed
    by a put that never fails. The policy knows all that but the level, and decides after every failure
    whether to try again or ask for help; who knows less can do no better. It is a linear programme over how
    far the policy goes in each history, for the chance that the coin makes that history does not depend on
    the policy.
    """
    first = [(f,) for f in range(TRIES)]
    second = [(f, g) for f in range(TRIES) for g in range(TRIES)]
    number = {history: n for n, history in enumerate([*first, *second])}
    # Who tries again has tried before.
    order = [(number[f,], number[f - 1,]) for f in range(1, TRIES)]
    order += [(number[f, g], number[f, g - 1] if g else number[f,]) for f, g in second]
    n, m = len(number), len(order)
    matrix, right = lil_array((m + len(levels), n + 1)), np.zeros(m + len(levels))
    for row, (later, earlier) in enumerate(order):
        matrix[row, later], matrix[row, earlier] = 1.0, -1.0
    for row, (level, cost) in enumerate(zip(levels, reference, strict=True), m):
        chance = 1.0 - level
        for (f,) in first:  # an attempt, and a put if it works
            matrix[row, number[f,]] = level**f * (1.0 + chance)
        for f, g in second:  # and no help any more
            matrix[row, number[f, g]] = level ** (f + g) * chance * (1.0 + chance * (1.0 - help_cost))
        matrix[row, n], right[row] = -cost, -help_cost
    target = np.zeros(n + 1)
    target[n] = 1.0
    found = linprog(target, matrix.tocsr(), right, bounds=[(0, 1)] * n + [(0, None)], method="highs")
    spent = matrix.tocsr()[m:, :n] @ found.x[:n] + help_cost
    return Regret(float(found.fun), tuple(map(float, spent)))
