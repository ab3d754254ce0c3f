"""Guided PRADA: the same beliefs and values, from samples that prefer what can matter.

Rules that cannot come to apply, or lead nowhere near the goal, are left out; where the goal cannot be
reached at all, that is known without a sample. Of the remaining actions those that begin a relaxed plan
from where a sequence has got to are sampled more often (see `guidance`), and sampling stops when more of it
hardly helps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.planning.base import PlanResult
from cognitive_arch.planning.guidance import Guidance, make_guidance
from cognitive_arch.planning.prada import APrada, Samples, Sequence
from cognitive_arch.planning.problem import Problem
from cognitive_arch.planning.relaxed import (
    NEVER,
    count_missing,
    literal_costs,
    make_costs,
    relax,
    relevant_rules,
)
from cognitive_arch.planning.sampling import sample_sequences


@dataclass(frozen=True)
class GuidedPrada(APrada):
    """A-PRADA with guided sampling.

    `samples` is the most it draws: it begins with `first_round` and doubles until the best value rises by
    less than `gain` of itself. `share` of the choices follow a relaxed plan, the others none.
    """

    first_round: int = 250
    gain: float = 0.01
    share: float = 0.75
    name: str = "guided-prada"

    def solve(self, problem: Problem, horizon: int, rng: np.random.Generator) -> PlanResult:
        """See `ArrayPlanner.solve`."""
        a = problem.arrays
        operators = relax(problem)
        costs = make_costs(operators, len(a.start))
        literal_costs(operators, a.start, count_missing(operators, a.start), costs)
        if (costs.cost[a.goal] >= NEVER).any():
            return self._result(problem, None, horizon)
        problem = problem.keep(relevant_rules(problem, operators, costs.cost))
        guidance = make_guidance(problem, relax(problem), self.share)
        return self._result(problem, self._guided(problem, guidance, horizon, rng), horizon)

    def _guided(
        self, problem: Problem, guidance: Guidance, horizon: int, rng: np.random.Generator
    ) -> Sequence | None:
        a = problem.arrays
        enough = float(np.prod(a.start[a.goal])) + self.margin
        best: Sequence | None = None
        best_value, drawn = -1.0, 0
        while drawn < self.samples:
            count = min(max(self.first_round, drawn), self.samples - drawn)
            drawn += count

            def part(problem: Problem, draws: NDArray[np.float64]) -> Samples:
                choices, values, peaks = sample_sequences(a, guidance, draws, self.discount, self.threshold)
                return guidance.action[choices], values, peaks

            sequences, values, peaks = self._share_out(part, problem, rng.random((horizon, count)))
            values = np.where(peaks > enough, values, -1.0)
            top = int(values.argmax())
            before = best_value
            if values[top] > best_value:
                best, best_value = sequences[:, top], float(values[top])
            if before > 0 and best_value - before < self.gain * before:
                break
        return None if best is None else self._shorten(problem, best)
