"""The first call of a planner on a machine compiles its inner loops: do that apart, and say so."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import numpy as np

from cognitive_arch.planning.base import ArrayPlanner, Planner
from cognitive_arch.planning.cheapest import cheapest_way
from cognitive_arch.relational.rules import GroundOutcome, GroundRule
from cognitive_arch.relational.symbols import Atom, Goal, GroundAction, Literal, State

PATIENCE_S = 1.5
"""Loading what is compiled takes less than this."""


def warm_up(planner: Planner, notify: Callable[[str], None] = lambda text: None) -> None:
    """Let one of our planners solve a problem of one rule, so that its code is loaded or compiled afterwards.

    If that takes long, `notify` is told why, from another thread. What is compiled is kept on disk.
    """
    if isinstance(planner, ArrayPlanner):
        _prepare(
            lambda state, goal, rules: planner.plan(state, goal, rules, 2, np.random.default_rng(0)),
            f"the planner {planner.name}",
            notify,
        )


def warm_up_search(notify: Callable[[str], None] = lambda text: None) -> None:
    """The same for the search of the cheapest way."""
    _prepare(lambda state, goal, rules: cheapest_way(state, goal, rules, lambda a: 0.5), "the search", notify)


def _prepare(
    solve: Callable[[State, Goal, tuple[GroundRule, ...]], object],
    what: str,
    notify: Callable[[str], None],
) -> None:
    done = Atom("done", ())
    rule = GroundRule(
        GroundAction("do", ()), (Literal(done, False),), (GroundOutcome(0.5, (Literal(done),)),)
    )
    notice = f"compiling {what}, once on this machine; this takes up to a minute ..."
    timer = threading.Timer(PATIENCE_S, notify, (notice,))
    timer.daemon = True
    timer.start()
    try:
        with _deaf_to_ctrl_c(notify):
            solve(frozenset(), (Literal(done),), (rule,))
    finally:
        timer.cancel()


@contextmanager
def _deaf_to_ctrl_c(notify: Callable[[str], None]) -> Iterator[None]:
    """Put off the first Ctrl-C until the compiler is done, which may crash if it is torn out of its work.

    The second one ends the process on the spot.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    interrupted = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        notify("stopping when the compiler is done; once more Ctrl-C stops at once ...")

    before = signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if interrupted:
        raise KeyboardInterrupt
