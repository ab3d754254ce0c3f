"""Things as seen from above: the same wherever the camera was and however the thing lies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.camera import Camera
from cognitive_arch.perception.descriptors import describe
from cognitive_arch.perception.pose import outline_distance
from cognitive_arch.perception.top_view import PIXEL, silhouette, top_view
from cognitive_arch.shapes import Box, Cylinder, Shape, ToolShape

RAKE = ToolShape(type="tool", length=0.34, width=0.018, bar=0.14)
STICK = ToolShape(type="tool", length=0.34, width=0.018, bar=0.0)
BOX = Box(type="box", size=(0.06, 0.04, 0.02))
TURNED_ALIKE = ("area", "eccentricity", "compactness", "circularity", "squareness")


def eyes() -> Camera:
    """Half a metre above and before the middle of the table, looking down at it as the robot does."""
    forward = np.array([-math.sin(0.58), 0.0, -math.cos(0.58)])
    right = np.array([0.0, 1.0, 0.0])
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    X_WC[:3, 3] = (-0.17, 0.0, 0.34)
    return Camera.with_view((640, 480), 1.25, X_WC)


def seen(shape: Shape, x: float, y: float, yaw: float) -> tuple[np.ndarray, np.ndarray]:
    """The pixels that show the upper side of a thing, and their places."""
    camera, top = eyes(), -0.096 + shape.height
    around = [(x + dx, y + dy, top) for dx in (-0.19, 0.19) for dy in (-0.19, 0.19)]
    corners = np.clip(camera.project(np.array(around)), 0, np.array(camera.size) - 1).astype(int)
    (left, upper), (right, lower) = corners.min(axis=0), corners.max(axis=0)
    pixels = np.stack(np.meshgrid(np.arange(left, right), np.arange(upper, lower)), axis=-1)
    places = camera.to_plane(pixels.reshape(-1, 2).astype(float), top)
    dx, dy = places[:, 0] - x, places[:, 1] - y
    own = np.column_stack([math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx])
    inside = np.zeros(len(own), bool)
    near = np.hypot(dx, dy) < math.hypot(*shape.extent) / 2 + 0.01
    inside[near] = outline_distance(shape)(own[near]) < 0
    mask = inside.reshape(pixels.shape[:2])
    return mask, np.column_stack([places[inside], np.full(int(inside.sum()), top)])


@settings(max_examples=12, deadline=None)
@given(
    st.sampled_from([RAKE, STICK, BOX, Cylinder(type="cylinder", radius=0.03, height=0.02)]),
    st.floats(-0.60, -0.40),
    st.floats(-0.2, 0.2),
    st.floats(-1.0, 1.0),
)
def test_what_is_seen_looks_like_what_is_there(shape: Shape, x: float, y: float, yaw: float) -> None:
    found = describe(top_view(*seen(shape, x, y, yaw)))
    known = describe(silhouette(shape, yaw))
    for name in TURNED_ALIKE:
        if name == "eccentricity" and shape is RAKE:
            continue  # of the ellipse around a T, which hardly fits it
        assert found.whole[name] == pytest.approx(known.whole[name], abs=0.06, rel=0.12), name
    if shape in (RAKE, STICK):
        for name in TURNED_ALIKE:
            assert found.top[name] == pytest.approx(known.top[name], abs=0.06, rel=0.12), name


def test_the_scale_is_metric() -> None:
    assert silhouette(BOX).sum() == pytest.approx(0.06 * 0.04 / PIXEL**2, rel=0.05)
    assert top_view(*seen(BOX, -0.45, 0.1, 0.3)).sum() == pytest.approx(0.06 * 0.04 / PIXEL**2, rel=0.08)


def test_up_is_away_from_the_robot_and_right_is_its_right() -> None:
    view = silhouette(RAKE)
    upper, lower = np.split(view, [len(view) // 2])
    assert upper.any(axis=0).sum() > 5 * lower.any(axis=0).sum()  # the bar is far, the handle near
    turned = silhouette(RAKE, -math.pi / 2)  # the head points to the robot's right, y > 0
    left, right = np.split(turned, [turned.shape[1] // 2], axis=1)
    assert right.any(axis=1).sum() > 5 * left.any(axis=1).sum()
    for yaw in (0.0, 0.5):
        found = top_view(*seen(RAKE, -0.5, 0.0, yaw))
        assert found.shape == pytest.approx(silhouette(RAKE, yaw).shape, abs=8)
        upper, lower = np.split(found, [len(found) // 2])
        assert upper.sum() > 1.3 * lower.sum()


def test_places_that_do_not_belong_to_the_blob_are_refused() -> None:
    mask, surface = seen(BOX, -0.45, 0.1, 0.3)
    with pytest.raises(PerceptionError, match="places of shape"):
        top_view(mask, surface[:-1])
    with pytest.raises(PerceptionError, match="places of shape"):
        top_view(np.zeros_like(mask), surface[:0])
    with pytest.raises(PerceptionError, match="larger than a table"):
        top_view(mask, surface * 100)
    surface[3] = np.nan
    with pytest.raises(PerceptionError, match="larger than a table"):
        top_view(mask, surface)
