"""PRADA and A-PRADA: planning by approximate inference over sampled action sequences.

Lang and Toussaint, "Planning with Noisy Probabilistic Relational Rules", JAIR 39 (2010). A sequence is
sampled step by step from the actions whose rules are likely to apply under the current belief, a product
of marginals (factored frontier); its value is the discounted sum of goal probabilities along the way.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import PlanningError
from cognitive_arch.planning import kernels
from cognitive_arch.planning.base import ArrayPlanner, PlanResult, PlanStatus, named_actions
from cognitive_arch.planning.problem import Problem
from cognitive_arch.planning.sampling import sample_sequences

Sequence = NDArray[np.int32]  # (horizon,) numbers of actions
Samples = tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]

CHUNK = 400_000
"""Actions sampled at one go: in between, Ctrl-C is heard."""

PARALLEL_FROM = 2000 * 1000
"""Samples times rules from which on a second thread pays (a call then takes more than 10 ms)."""


@dataclass(frozen=True)
class Prada(ArrayPlanner):
    """Plain PRADA.

    `threshold` cuts small rule weights to 0; `margin` is how far above its initial probability the goal
    must come for a sequence to count as a plan. `workers` threads share the samples (None: as many as
    there are cores, for large problems); the result does not depend on it.
    """

    samples: int = 2000
    discount: float = 0.95
    threshold: float = 0.03
    margin: float = 0.05
    workers: int | None = None
    name: str = "prada"

    def __post_init__(self) -> None:
        if self.samples < 1:
            raise PlanningError(f"{self.samples} samples are too few; valid: 1 or more")
        # A whole number would have the kernels compiled once more.
        object.__setattr__(self, "discount", float(self.discount))
        object.__setattr__(self, "threshold", float(self.threshold))

    def solve(self, problem: Problem, horizon: int, rng: np.random.Generator) -> PlanResult:
        """See `ArrayPlanner.solve`."""
        return self._result(problem, self._search(problem, horizon, rng), horizon)

    def _search(self, problem: Problem, horizon: int, rng: np.random.Generator) -> Sequence | None:
        """Best of one round of samples, or None if none of them raises the goal's probability enough."""
        sequences, values, peaks = self._share_out(self._sample, problem, rng.random((horizon, self.samples)))
        start = np.prod(problem.arrays.start[problem.arrays.goal])
        if peaks.max() <= start + self.margin:
            return None
        best: Sequence = sequences[:, int(values.argmax())]
        return best

    def _sample(self, problem: Problem, draws: NDArray[np.float64]) -> Samples:
        samples: Samples = sample_sequences(problem.arrays, None, draws, self.discount, self.threshold)
        return samples

    def _share_out(
        self,
        sample: Callable[[Problem, NDArray[np.float64]], Samples],
        problem: Problem,
        draws: NDArray[np.float64],
    ) -> Samples:
        """`sample` one sequence per column of `draws` (horizon, n_samples), by as many threads as pay."""
        horizon, n_samples = draws.shape
        workers = self.workers
        if workers is None:
            workers = (os.cpu_count() or 1) if n_samples * len(problem.rules) >= PARALLEL_FROM else 1
        n_parts = min(n_samples, max(workers, horizon * n_samples // CHUNK))
        if n_parts == 1:
            return sample(problem, draws)
        parts = [np.ascontiguousarray(part) for part in np.array_split(draws, n_parts, axis=1)]
        if workers == 1:
            done = [sample(problem, part) for part in parts]
        else:
            pool = ThreadPoolExecutor(workers)
            try:
                done = list(pool.map(partial(sample, problem), parts))
            finally:
                pool.shutdown(cancel_futures=True)
        sequences, values, peaks = zip(*done, strict=True)
        return np.concatenate(sequences, axis=1), np.concatenate(values), np.concatenate(peaks)

    def _result(self, problem: Problem, sequence: Sequence | None, horizon: int) -> PlanResult:
        if sequence is None:
            idle = np.full(horizon, problem.idle, dtype=np.int32)
            return PlanResult(PlanStatus.NO_PLAN, (), *self._evaluate(problem, idle))
        actions = named_actions(problem, sequence.tolist())
        return PlanResult(PlanStatus.PLAN, actions, *self._evaluate(problem, sequence))

    def _evaluate(self, problem: Problem, sequence: Sequence) -> tuple[float, float]:
        """Value and highest goal probability of `sequence`."""
        value, peak, _ = kernels.evaluate_sequence(problem.arrays, sequence, self.discount, self.threshold)
        return value, peak


@dataclass(frozen=True)
class APrada(Prada):
    """A-PRADA: several rounds of samples if need be, then actions that do not help are taken out."""

    rounds: int = 3
    name: str = "a-prada"

    def _search(self, problem: Problem, horizon: int, rng: np.random.Generator) -> Sequence | None:
        for _ in range(self.rounds):
            sequence = super()._search(problem, horizon, rng)
            if sequence is not None:
                return self._shorten(problem, sequence)
        return None

    def _shorten(self, problem: Problem, sequence: Sequence, ties: bool = False) -> Sequence:
        """Delete one action at a time, keeping a deletion that raises the value (or, with `ties`, keeps it).

        The freed step at the end is spent doing nothing, so that all values sum over the same steps.
        """
        idle = np.int32(problem.idle)
        value, _ = self._evaluate(problem, sequence)
        position = 0
        while position < len(sequence):
            shorter = np.append(np.delete(sequence, position), idle).astype(np.int32)
            shorter_value, _ = self._evaluate(problem, shorter)
            if shorter_value > value or (ties and shorter_value == value and sequence[position] != idle):
                sequence, value = shorter, shorter_value
            else:
                position += 1
        return sequence
