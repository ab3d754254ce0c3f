"""The first call of a planner on a machine compiles its inner loops: do that apart, and say so."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from cognitive_arch.planning.base import Planner
from cognitive_arch.relational.rules import GroundOutcome, GroundRule
from cognitive_arch.relational.symbols import Atom, GroundAction, Literal

NOTICE = "compiling the planner, once on this machine; later runs start at once ..."

PATIENCE_S = 1.5
"""Loading what is compiled takes less than this."""


def warm_up(planner: Planner, notify: Callable[[str], None] = lambda text: None) -> None:
    """Let `planner` solve a problem of one rule, so that its code is loaded or compiled afterwards.

    If that takes long, `notify` is told why, from another thread. What is compiled is kept on disk.
    """
    done = Atom("done", ())
    rule = GroundRule(
        GroundAction("do", ()), (Literal(done, False),), (GroundOutcome(0.5, (Literal(done),)),)
    )
    timer = threading.Timer(PATIENCE_S, notify, (NOTICE,))
    timer.daemon = True
    timer.start()
    try:
        planner.plan(frozenset(), (Literal(done),), (rule,), 2, np.random.default_rng(0))
    finally:
        timer.cancel()
