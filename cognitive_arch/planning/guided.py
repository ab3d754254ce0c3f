"""Guided PRADA: the same beliefs and values, from samples that prefer what can matter.

Rules that cannot come to apply, or lead nowhere near the goal, are left out; where the goal cannot be
reached at all, that is known without a sample. Of the remaining actions those that begin a relaxed plan
from where a sequence has got to are sampled more often (see `guidance`), and sampling stops when more of it
hardly helps. Because a product of marginals may promise what the rules do not keep, the best sequences are
tried in sampled worlds before one is believed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PlanningError
from cognitive_arch.planning.base import PlanResult
from cognitive_arch.planning.evaluation import evaluate_by_sampling
from cognitive_arch.planning.guidance import Guidance, make_guidance
from cognitive_arch.planning.kernels import evaluate_sequences
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

TRIALS = 400
"""How often a plan is tried, by the rules themselves, before it is believed."""

CANDIDATES = 30
"""How many of the best sequences are tried before there is said to be no plan."""


NEARLY = 3
"""How many sequences are improved when none is good enough as it was sampled."""


def _value(entry: tuple[float, Sequence]) -> float:
    """Sort key: the highest value first."""
    return -entry[0]


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

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.first_round < 1:
            raise PlanningError(f"a first round of {self.first_round} samples is too small; valid: 1 or more")
        if not 0 <= self.share < 1:
            raise PlanningError(f"the share {self.share:g} is out of range; valid: 0 to less than 1")

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
        start = float(np.prod(a.start[a.goal]))
        for sequence in self._candidates(problem, guidance, horizon, start + self.margin, rng):
            if self._helps(problem, sequence, start, rng):
                better = self._improve(problem, sequence)
                believed = self._helps(problem, better, start, rng)
                return self._result(problem, better if believed else sequence, horizon)
        return self._result(problem, None, horizon)

    def _candidates(
        self, problem: Problem, guidance: Guidance, horizon: int, enough: float, rng: np.random.Generator
    ) -> list[Sequence]:
        """The best distinct sequences that were sampled and raise the goal's probability above `enough`."""

        def sample(problem: Problem, draws: NDArray[np.float64]) -> Samples:
            choices, values, peaks = sample_sequences(
                problem.arrays, guidance, draws, self.discount, self.threshold
            )
            return guidance.action[choices], values, peaks

        found: dict[bytes, tuple[float, Sequence]] = {}
        nearly: list[tuple[float, Sequence]] = []
        best, drawn = 0.0, 0
        while drawn < self.samples:
            count = min(max(self.first_round, drawn), self.samples - drawn)
            drawn += count
            sequences, values, peaks = self._share_out(sample, problem, rng.random((horizon, count)))
            for n in np.flatnonzero(peaks > enough):
                sequence = np.ascontiguousarray(sequences[:, n])
                found.setdefault(sequence.tobytes(), (float(values[n]), sequence))
            for n in np.argsort(-values)[:NEARLY]:
                nearly.append((float(values[n]), np.ascontiguousarray(sequences[:, n])))
            before, best = best, max((value for value, _ in found.values()), default=0.0)
            if 0 < best < (1 + self.gain) * before:
                break
        if not found:
            # Mostly one action that has failed before and has to be tried many times.
            improved = [
                self._improve(problem, sequence) for _, sequence in sorted(nearly, key=_value)[:NEARLY]
            ]
            return [sequence for sequence in improved if self._evaluate(problem, sequence)[1] > enough]
        return [sequence for _, sequence in sorted(found.values(), key=_value)[:CANDIDATES]]

    def _helps(self, problem: Problem, sequence: Sequence, start: float, rng: np.random.Generator) -> bool:
        """Whether `sequence` raises the goal's probability above `start` by the rules themselves.

        What a product of marginals promises wrongly mostly has no chance at all, so a fifth of the margin is
        enough: `margin` itself is a measure for PRADA's estimate.
        """
        tried = evaluate_by_sampling(problem, sequence.tolist(), rng, TRIALS)
        return tried.peak > start + self.margin / 5

    def _improve(self, problem: Problem, sequence: Sequence) -> Sequence:
        """Take out what does not help, then put in actions of the plan once more where that helps."""
        sequence = self._shorten(problem, sequence, ties=True)
        value, _ = self._evaluate(problem, sequence)
        while sequence[-1] == problem.idle:
            steps = np.flatnonzero(sequence != problem.idle)
            longer = [
                np.insert(sequence[:-1], place, action)
                for place in range(steps[-1] + 2 if len(steps) else 1)
                for action in dict.fromkeys(sequence[steps].tolist())
            ]
            if not longer:
                break
            tried = np.ascontiguousarray(np.stack(longer, axis=1), dtype=np.int32)
            values, _, _ = evaluate_sequences(problem.arrays, tried, self.discount, self.threshold)
            top = int(values.argmax())
            if values[top] <= value * (1 + 1e-9):
                break
            sequence, value = tried[:, top], float(values[top])
        return sequence
