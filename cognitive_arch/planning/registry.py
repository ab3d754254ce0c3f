"""The planners by name: our own, and those that other packages add.

A package adds a planner through the entry point group `cognitive_arch.planners`: the entry's name is what
`--planner` calls it, its value a callable without required arguments that returns a `Planner`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.metadata import entry_points
from inspect import signature

import numpy as np

from cognitive_arch.errors import CogArchError, PlanningError, one_line, unknown
from cognitive_arch.planning.base import Planner, PlanResult
from cognitive_arch.planning.guided import GuidedPrada
from cognitive_arch.planning.prada import APrada, Prada
from cognitive_arch.planning.sparse_sampling import SparseSampling
from cognitive_arch.planning.uct import Uct
from cognitive_arch.relational.rules import GroundRule
from cognitive_arch.relational.symbols import Goal, GroundAction, State

PLANNERS: Mapping[str, Callable[[], Planner]] = {
    "a-prada": APrada,
    "guided-prada": GuidedPrada,
    "prada": Prada,
    "sst": SparseSampling,
    "uct": Uct,
}
"""Our own planners: name -> constructor with default settings. Other packages cannot take these names."""

DEFAULT_PLANNER = "guided-prada"

GROUP = "cognitive_arch.planners"


def planner_names() -> tuple[str, ...]:
    """All that `make_planner` knows."""
    return tuple(sorted({*PLANNERS, *(entry.name for entry in entry_points(group=GROUP))}))


def make_planner(name: str, samples: int | None = None) -> Planner:
    """The planner called `name`, drawing `samples` samples if it is one that has such a setting.

    Raises `PlanningError` listing the known ones, or saying why one of another package cannot be used.
    """
    if name in PLANNERS:
        return _make(PLANNERS[name], samples)
    for entry in entry_points(group=GROUP, name=name):
        with _blamed(name, "cannot be made"):
            return _Added(name, _make(entry.load(), samples))
    raise PlanningError(unknown("planner", name, planner_names()))


def _make(make: Callable[[], Planner], samples: int | None) -> Planner:
    if samples is None or "samples" not in signature(make).parameters:
        return make()
    planner: Planner = partial(make, **{"samples": samples})()
    return planner


@contextmanager
def _blamed(name: str, what: str) -> Iterator[None]:
    """Tell whatever a planner of another package raises as one line that names it."""
    try:
        yield
    except CogArchError:
        raise
    except Exception as problem:
        kind = type(problem).__name__
        raise PlanningError(f"the planner '{name}' {what}: {kind}: {one_line(problem, 200)}") from problem


@dataclass(frozen=True)
class _Added:
    """A planner of another package, whose mistakes are told as such."""

    name: str
    planner: Planner

    def plan(
        self,
        state: State,
        goal: Goal,
        rules: Sequence[GroundRule],
        horizon: int,
        rng: np.random.Generator,
    ) -> PlanResult:
        """See `Planner.plan`."""
        with _blamed(self.name, "failed"):
            result = self.planner.plan(state, goal, rules, horizon, rng)
            if not isinstance(result, PlanResult):
                raise TypeError(f"plan() must return a PlanResult, not {type(result).__name__}")
            if not all(isinstance(action, GroundAction) for action in result.actions):
                raise TypeError("the actions of a PlanResult must be GroundActions")
            return result
