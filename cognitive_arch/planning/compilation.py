"""The first call of a planner on a machine compiles its inner loops: do that apart, and say so."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import numpy as np

from cognitive_arch.planning.base import ArrayPlanner, Planner
from cognitive_arch.relational.rules import GroundOutcome, GroundRule
from cognitive_arch.relational.symbols import Atom, GroundAction, Literal

PATIENCE_S = 1.5
"""Loading what is compiled takes less than this."""


def warm_up(planner: Planner, notify: Callable[[str], None] = lambda text: None) -> None:
    """Let one of our planners solve a problem of one rule, so that its code is loaded or compiled afterwards.

    If that takes long, `notify` is told why, from another thread. What is compiled is kept on disk.
    """
    if not isinstance(planner, ArrayPlanner):
        return
    done = Atom("done", ())
    rule = GroundRule(
        GroundAction("do", ()), (Literal(done, False),), (GroundOutcome(0.5, (Literal(done),)),)
    )
    notice = f"compiling the planner {planner.name}, once on this machine; this takes up to a minute ..."
    timer = threading.Timer(PATIENCE_S, notify, (notice,))
    timer.daemon = True
    timer.start()
    try:
        with _interruptible():
            planner.plan(frozenset(), (Literal(done),), (rule,), 2, np.random.default_rng(0))
    finally:
        timer.cancel()


@contextmanager
def _interruptible() -> Iterator[None]:
    """See to it that Ctrl-C ends as `KeyboardInterrupt`: inside numba it turns into all kinds of errors."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    interrupted = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, note)
    try:
        yield
    except Exception:
        if interrupted:
            raise KeyboardInterrupt from None
        raise
    finally:
        signal.signal(signal.SIGINT, before)
    if interrupted:
        raise KeyboardInterrupt
