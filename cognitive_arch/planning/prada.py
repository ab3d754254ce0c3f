"""PRADA and A-PRADA: planning by approximate inference over sampled action sequences.

Lang and Toussaint, "Planning with Noisy Probabilistic Relational Rules", JAIR 39 (2010). A sequence is
sampled step by step from the actions whose rules are likely to apply under the current belief, a product
of marginals (factored frontier); its value is the discounted sum of goal probabilities along the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.planning import kernels
from cognitive_arch.planning.base import PlanResult, PlanStatus, check_problem
from cognitive_arch.planning.problem import Problem, compile_problem
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import DO_NOTHING, Goal, State


@dataclass(frozen=True)
class Prada:
    """Plain PRADA.

    `threshold` cuts small rule weights to 0; `margin` is how far above its initial probability the goal
    must come for a sequence to count as a plan.
    """

    samples: int = 2000
    discount: float = 0.95
    threshold: float = 0.03
    margin: float = 0.05
    name: str = "prada"

    def plan(
        self,
        state: State,
        goal: Goal,
        rules: Sequence[GroundRule],
        horizon: int,
        rng: np.random.Generator,
    ) -> PlanResult:
        """See `Planner.plan`."""
        check_problem(goal, horizon)
        problem = compile_problem(state, goal, rules)
        sequence = self._search(problem, horizon, rng)
        return self._result(problem, sequence, horizon)

    def _search(self, problem: Problem, horizon: int, rng: np.random.Generator) -> NDArray[np.int32] | None:
        """Best of one round of samples, or None if none of them raises the goal's probability enough."""
        draws = rng.random((self.samples, horizon))
        sequences, values, peaks = kernels.sample_sequences(
            *problem.arrays(), draws, self.discount, self.threshold
        )
        if peaks.max() <= self._start_probability(problem) + self.margin:
            return None
        best: NDArray[np.int32] = sequences[int(values.argmax())]
        return best

    def _start_probability(self, problem: Problem) -> float:
        return self._evaluate(problem, np.empty(0, dtype=np.int32))[1]

    def _evaluate(self, problem: Problem, sequence: NDArray[np.int32]) -> tuple[float, float]:
        value, peak, _ = kernels.evaluate_sequence(*problem.arrays(), sequence, self.discount, self.threshold)
        return float(value), float(peak)

    def _result(self, problem: Problem, sequence: NDArray[np.int32] | None, horizon: int) -> PlanResult:
        if sequence is None:
            idle = np.full(horizon, len(problem.actions), dtype=np.int32)
            return PlanResult(PlanStatus.NO_PLAN, (), *self._evaluate(problem, idle))
        value, peak = self._evaluate(problem, sequence)
        names = [*problem.actions, DO_NOTHING]
        actions = [names[i] for i in sequence]
        while actions and actions[-1] == DO_NOTHING:
            actions.pop()
        return PlanResult(PlanStatus.PLAN, tuple(actions), value, peak)


@dataclass(frozen=True)
class APrada(Prada):
    """A-PRADA: several rounds of samples if need be, then actions that do not help are taken out."""

    rounds: int = 3
    name: str = "a-prada"

    def _search(self, problem: Problem, horizon: int, rng: np.random.Generator) -> NDArray[np.int32] | None:
        for _ in range(self.rounds):
            sequence = super()._search(problem, horizon, rng)
            if sequence is not None:
                return self._shorten(problem, sequence)
        return None

    def _shorten(self, problem: Problem, sequence: NDArray[np.int32]) -> NDArray[np.int32]:
        """Delete one action at a time, keeping a deletion that raises the value.

        The freed step at the end is spent doing nothing, so that all values sum over the same steps.
        """
        idle = np.int32(len(problem.actions))
        value, _ = self._evaluate(problem, sequence)
        position = 0
        while position < len(sequence):
            shorter = np.append(np.delete(sequence, position), idle).astype(np.int32)
            shorter_value, _ = self._evaluate(problem, shorter)
            if shorter_value > value:
                sequence, value = shorter, shorter_value
            else:
                position += 1
        return sequence
