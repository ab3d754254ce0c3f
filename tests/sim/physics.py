"""What must hold of every trajectory."""

from __future__ import annotations

import numpy as np

from cognitive_arch.runlog.trajectory import Trajectory

DEEPEST = 0.003  # m
SLACK = 0.004  # rad (pads: m), for joints that are pressed against their stops, fingers above all


def check_physics(trajectory: Trajectory) -> None:
    """Joints within their limits; nothing sinks into anything."""
    assert np.isfinite(trajectory.joints).all()
    assert np.isfinite(trajectory.poses).all()
    low, high = trajectory.limits.T
    assert (trajectory.joints >= low - SLACK).all()
    assert (trajectory.joints <= high + SLACK).all()
    assert trajectory.beyond.max() <= SLACK
    things, table = set(trajectory.object_names), {"table"}
    robot = {name for pair in trajectory.pairs for name in pair} - things - table
    assert trajectory.deepest(things, table) > 0  # they lie on it
    pairs = ((robot, table), (robot, things), (robot, robot), (things, table), (things, things))
    for one, other in pairs:
        assert trajectory.deepest(one, other) < DEEPEST, (one, other)
