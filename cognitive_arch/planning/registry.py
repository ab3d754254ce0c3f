"""The planners by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from cognitive_arch.errors import PlanningError, unknown
from cognitive_arch.planning.base import Planner
from cognitive_arch.planning.guided import GuidedPrada
from cognitive_arch.planning.prada import APrada, Prada

PLANNERS: Mapping[str, Callable[[], Planner]] = {
    "a-prada": APrada,
    "guided-prada": GuidedPrada,
    "prada": Prada,
}
"""Name -> constructor with default settings."""


def make_planner(name: str) -> Planner:
    """The planner called `name`; raises `PlanningError` listing the known ones."""
    if name not in PLANNERS:
        raise PlanningError(unknown("planner", name, PLANNERS))
    return PLANNERS[name]()
