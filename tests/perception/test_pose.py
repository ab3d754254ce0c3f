"""Where things of known shape lie, from points on them as a camera would give them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.domain import load_domain
from cognitive_arch.perception.pose import estimate_pose, outline_distance
from cognitive_arch.shapes import Box, Cylinder, Shape, Sphere, ToolShape

TABLE = -0.096
DOMAIN = load_domain("toys").objects
FLAT = {name: spec.shape for name, spec in DOMAIN.items() if not spec.shape.rolls}


def points_of(shape: Shape, x: float, y: float, yaw: float) -> tuple[np.ndarray, np.ndarray]:
    """Points of the upper side of a thing that stands on the table, and those near its outline."""
    sides = [np.arange(-side / 2 - 0.002, side / 2 + 0.002, 0.0015) for side in shape.extent]
    grid = np.array(np.meshgrid(*sides)).reshape(2, -1).T
    away = outline_distance(shape)(grid)
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s], [s, c]])

    def raised(rows: np.ndarray) -> np.ndarray:
        flat = grid[rows] @ turn.T + (x, y)
        return np.column_stack([flat, np.full(len(flat), TABLE + shape.height)])

    return raised(away <= 0), raised((away <= 0) & (away > -0.0015))


places = {"x": st.floats(-0.7, -0.25), "y": st.floats(-0.25, 0.25), "yaw": st.floats(-3.1, 3.1)}


@pytest.mark.parametrize("name", sorted(FLAT))
@settings(max_examples=15, deadline=None)
@given(**places)
def test_a_thing_in_full_view_is_found(name: str, x: float, y: float, yaw: float) -> None:
    shape = FLAT[name]
    surface, outline = points_of(shape, x, y, yaw)
    found = estimate_pose(shape, surface, outline)
    assert found is not None
    assert found.position == pytest.approx((x, y, TABLE + shape.height / 2), abs=0.003)
    assert found.seen > 0.9
    assert found.residual < 0.002
    again, _ = points_of(shape, *found.position[:2], found.yaw)
    # Symmetric shapes may be found turned: they cover the same of the table.
    middle = np.mean(surface, axis=0)
    assert np.mean(again, axis=0) == pytest.approx(middle, abs=0.003)
    if isinstance(shape, ToolShape) and shape.bar > 0:
        assert math.cos(found.yaw - yaw) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("kept", [0.4, 0.6])
def test_half_covered_things_are_found_by_the_edges_that_are_their_own(kept: float) -> None:
    for shape in (
        Cylinder(type="cylinder", radius=0.03, height=0.02),
        Box(type="box", size=(0.05, 0.05, 0.01)),
    ):
        surface, outline = points_of(shape, -0.4, 0.1, 0.0)
        limit = 0.1 + (kept - 0.5) * shape.extent[1]
        surface, outline = (rows[rows[:, 1] < limit] for rows in (surface, outline))
        found = estimate_pose(shape, surface, outline)
        assert found is not None
        assert found.position[:2] == pytest.approx((-0.4, 0.1), abs=0.004)
        whole = estimate_pose(shape, *points_of(shape, -0.4, 0.1, 0.0))
        assert whole is not None
        assert found.seen <= 0.8 < whole.seen
        assert found.sigma > whole.sigma


@pytest.mark.parametrize("yaw", [-0.2, -0.13, 0.0])
def test_a_rake_of_which_a_corner_is_in_view_is_not_taken_to_lie_across_the_view(yaw: float) -> None:
    rake = ToolShape(type="tool", length=0.34, width=0.018, bar=0.14)
    surface, outline = points_of(rake, -0.46, -0.2, yaw)
    # The picture ends across the bar's corner with the shaft.
    surface, outline = (
        rows[(rows[:, 0] < -0.53) & (rows[:, 1] - 0.7 * (rows[:, 0] + 0.6) > -0.21)]
        for rows in (surface, outline)
    )

    def bare(places: np.ndarray) -> np.ndarray:
        in_view = (places[:, 0] < -0.53) & (places[:, 1] - 0.7 * (places[:, 0] + 0.6) > -0.21)
        near = np.linalg.norm(places[:, None, :2] - surface[None, ::5, :2], axis=2).min(axis=1) < 0.006
        return np.asarray(in_view & ~near)

    found = estimate_pose(rake, surface, outline, bare)
    assert found is not None
    assert found.position[:2] == pytest.approx((-0.46, -0.2), abs=0.01)
    assert found.seen < 0.5


def test_another_shape_does_not_fit() -> None:
    surface, outline = points_of(Box(type="box", size=(0.075, 0.055, 0.02)), -0.4, 0.1, 0.3)
    small = estimate_pose(Cylinder(type="cylinder", radius=0.02, height=0.02), surface, outline)
    right = estimate_pose(Box(type="box", size=(0.075, 0.055, 0.02)), surface, outline)
    assert small is not None
    assert right is not None
    assert small.residual > 4 * right.residual


@pytest.mark.parametrize("name", ["Red-ball", "Blue-ball", "Pear"])
def test_balls_are_found_by_their_surface(name: str) -> None:
    shape = DOMAIN[name].shape
    parts = [(0.0, shape.radius)] if isinstance(shape, Sphere) else [(-0.0065, 0.024), (0.0185, 0.014)]
    rng = np.random.default_rng(0)
    away = rng.normal(size=(4000, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    middle = np.array([-0.5, 0.1, TABLE + shape.height / 2])
    eye = np.array([0.65, 0.0, 0.75])  # towards the camera
    towards = [away[away @ eye > 0.2] * radius + (0, 0, z) for z, radius in parts]
    surface = np.vstack(towards)
    if isinstance(shape, Sphere) is False:
        inner = np.linalg.norm(surface - (0, 0, -0.0065), axis=1) < 0.0239
        inner |= np.linalg.norm(surface - (0, 0, 0.0185), axis=1) < 0.0139
        surface = surface[~inner]
    found = estimate_pose(shape, surface + middle, np.empty((0, 3)))
    assert found is not None
    assert found.position == pytest.approx(middle, abs=0.003)


def test_too_few_points_tell_nothing() -> None:
    cylinder = Cylinder(type="cylinder", radius=0.03, height=0.02)
    assert estimate_pose(cylinder, np.zeros((3, 3)), np.zeros((3, 3))) is None
