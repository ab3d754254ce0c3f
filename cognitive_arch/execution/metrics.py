"""Metrics of one episode (thesis Sec. 6.4.6.2), as pure functions."""

from __future__ import annotations

MAX_ACTIONS = 50


def speed(total: int, limit: int = MAX_ACTIONS) -> float:
    """Eq. (25): 1 - total/limit, at least 0; `total` counts attempted motor actions."""
    return max(1.0 - total / limit, 0.0)
