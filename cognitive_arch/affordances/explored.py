"""The robot's own exploration, which comes along: trials that `cogarch explore` made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.affordances.trials import TrialTable, read_trials
from cognitive_arch.errors import AffordanceError, unknown
from cognitive_arch.resources import trials_path

DEFAULT = "explored"
HELD_OUT = "Loaf"
"""The eighth object (thesis Fig. 45), on which what was learnt from seven other forms is tested (Table 9)."""

Rows = NDArray[np.bool_]
EXPLORED: Mapping[str, Callable[[TrialTable], Rows]] = {
    "explored": lambda table: np.ones(len(table), np.bool_),
    "explored-hand": lambda table: np.asarray(table.kind == "hand"),
    "explored-tool": lambda table: np.asarray(table.kind == "tool"),
    "explored-seven": lambda table: np.asarray(table.object != HELD_OUT),
    "explored-eighth": lambda table: np.asarray(table.object == HELD_OUT),
}
"""What can be asked for by name: all trials, those with bare hands, those with tools, those with
objects of seven forms, and those with the one that is held out."""


def read_explored(name: str = DEFAULT) -> TrialTable:
    """The shipped trials by one of the names of `EXPLORED`; raises `AffordanceError` for another."""
    if name not in EXPLORED:
        raise AffordanceError(unknown("exploration", name, EXPLORED))
    table = read_trials(trials_path())
    return replace(table.take(EXPLORED[name](table)), source=name)
