"""Saved states: plain data that JSON keeps to the last bit, so that reading another one's does no harm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeAlias

import numpy as np

from cognitive_arch.errors import StateError, one_line

SavedState: TypeAlias = dict[str, Any]
"""Numbers, texts, lists and dictionaries; `kind` and `format` say whose it is."""


@contextmanager
def restoring(saved: Mapping[str, Any], kind: str, format_: int) -> Iterator[None]:
    """Check whose state it is, and raise `StateError` for whatever turns out not to fit."""
    try:
        found = (saved["kind"], saved["format"])
        if found != (kind, format_):
            raise ValueError(f"it is of {found[0]}, format {found[1]}, not of {kind}, format {format_}")
        yield
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RuntimeError) as error:
        missing = "it lacks " if isinstance(error, KeyError) else ""
        raise StateError(f"this saved state does not fit: {missing}{one_line(error, 200)}") from None


def save_rng(rng: np.random.Generator) -> SavedState:
    """Where a generator is."""
    return dict(rng.bit_generator.state)


def restore_rng(saved: Mapping[str, Any]) -> np.random.Generator:
    """A generator that goes on from there."""
    rng = np.random.default_rng()
    rng.bit_generator.state = saved
    return rng
