"""The planners by name: our own, and those that other packages add.

A package adds a planner through the entry point group `cognitive_arch.planners`: the entry's name is what
`--planner` calls it, its value a callable without required arguments that returns a `Planner`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import entry_points
from inspect import signature

from cognitive_arch.errors import PlanningError, one_line, unknown
from cognitive_arch.planning.base import Planner
from cognitive_arch.planning.guided import GuidedPrada
from cognitive_arch.planning.prada import APrada, Prada
from cognitive_arch.planning.sparse_sampling import SparseSampling
from cognitive_arch.planning.uct import Uct

PLANNERS: Mapping[str, Callable[[], Planner]] = {
    "a-prada": APrada,
    "guided-prada": GuidedPrada,
    "prada": Prada,
    "sst": SparseSampling,
    "uct": Uct,
}
"""Our own planners: name -> constructor with default settings."""

DEFAULT_PLANNER = "guided-prada"

GROUP = "cognitive_arch.planners"


def planner_names() -> tuple[str, ...]:
    """All that `make_planner` knows."""
    return tuple(sorted({*PLANNERS, *(entry.name for entry in entry_points(group=GROUP))}))


def make_planner(name: str, samples: int | None = None) -> Planner:
    """The planner called `name`, drawing `samples` samples if it is one that has such a setting.

    Raises `PlanningError` listing the known ones, or saying why one of another package cannot be used.
    """
    make = PLANNERS.get(name) or _added(name)
    if samples is not None and "samples" in signature(make).parameters:
        planner: Planner = partial(make, **{"samples": samples})()
        return planner
    return make()


def _added(name: str) -> Callable[[], Planner]:
    """The constructor of a planner that another package brings."""
    for entry in entry_points(group=GROUP, name=name):
        try:
            made: Callable[[], Planner] = entry.load()
        except Exception as problem:  # whatever a package of others raises while it is imported
            raise PlanningError(
                f"the planner '{name}' ({entry.value}) cannot be loaded: {one_line(problem, 200)}"
            ) from None
        return made
    raise PlanningError(unknown("planner", name, planner_names()))
