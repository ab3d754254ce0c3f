from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.camera import Camera


def looking_down(tilt: float = 0.6, height: float = 0.4, size: tuple[int, int] = (64, 48)) -> Camera:
    """A camera `height` above the origin that looks along -x, `tilt` radians below the horizon."""
    forward = np.array([-math.cos(tilt), 0.0, -math.sin(tilt)])
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    X_WC[:3, 3] = [0.1, -0.05, height]
    return Camera.with_view(size, 1.2, X_WC)


places = st.tuples(st.floats(-0.9, -0.2), st.floats(-0.4, 0.4), st.floats(-0.1, 0.2))


@given(places)
def test_what_is_projected_is_found_again_on_its_plane(place: tuple[float, float, float]) -> None:
    camera = looking_down()
    pixels = camera.project(np.array([place]))
    assert np.allclose(camera.to_plane(pixels, place[2]), [place[:2]], atol=1e-9)


@given(places)
def test_a_point_lies_on_the_ray_of_its_pixel(place: tuple[float, float, float]) -> None:
    camera = looking_down()
    (direction,) = camera.ray(camera.project(np.array([place])))
    away = np.array(place) - camera.position
    assert np.allclose(np.cross(direction, away), 0, atol=1e-9)
    # Rays have length 1 along the view: their multiple is the depth.
    depth = away @ camera.X_WC[:3, 2]
    assert np.allclose(depth * direction, away)


def test_the_middle_of_the_image_is_where_the_camera_looks() -> None:
    camera = looking_down(tilt=math.pi / 2 - 1e-9)
    assert np.allclose(camera.to_plane(np.array([[31.5, 23.5]]), 0.0), [[0.1, -0.05]], atol=1e-6)
    # Image left is y < 0, the robot's left; image up is farther away.
    assert camera.to_plane(np.array([[10.0, 23.5]]), 0.0)[0, 1] < -0.05
    assert camera.to_plane(np.array([[31.5, 10.0]]), 0.0)[0, 0] < 0.1


def test_the_field_of_view_spans_the_image() -> None:
    camera = looking_down()
    upper, lower = camera.ray(np.array([[31.5, -0.5], [31.5, 47.5]]))
    cosine = upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower)
    assert math.acos(cosine) == pytest.approx(1.2)
    assert camera.view == pytest.approx(1.2)


def test_points_of_a_depth_image() -> None:
    camera = looking_down()
    columns, rows = np.meshgrid(np.arange(64), np.arange(48))
    pixels = np.column_stack([columns.ravel(), rows.ravel()]).astype(float)
    on_plane = np.column_stack([camera.to_plane(pixels, 0.02), np.full(len(pixels), 0.02)])
    depth = ((on_plane - camera.position) @ camera.X_WC[:3, 2]).reshape(48, 64)
    depth[5, 7], depth[6, 7], depth[7, 7] = np.inf, 0.0, np.nan
    seen = camera.points(depth.astype(np.float32))
    expected = on_plane.reshape(48, 64, 3)
    expected[5:8, 7] = np.nan
    assert np.allclose(seen, expected, atol=1e-5, equal_nan=True)


@pytest.mark.parametrize("pixel", [(5.0, 3.0), (31.5, 23.5), (60.0, 45.0)])
def test_uncertainty_on_the_plane_is_what_sampling_gives(pixel: tuple[float, float]) -> None:
    camera, rng = looking_down(), np.random.default_rng(0)
    (told,) = camera.plane_covariance(np.array([pixel]), 0.0, pixel_sigma=0.4, height_sigma=0.003)
    pixels = np.array(pixel) + rng.normal(0, 0.4, (1500, 2))
    found = np.array(
        [
            camera.to_plane(p[None], h)[0]
            for p, h in zip(pixels, rng.normal(0, 0.003, len(pixels)), strict=True)
        ]
    )
    assert np.allclose(np.cov(found.T), told, rtol=0.15, atol=0.05 * np.trace(told))


def test_rays_that_never_meet_the_plane_are_not_numbers() -> None:
    camera = looking_down(tilt=0.1)
    sky = camera.to_plane(np.array([[31.5, 0.0]]), 0.0)
    assert np.isnan(sky).all()
    assert np.isnan(camera.to_plane(np.array([[31.5, 40.0]]), 1.0)).all()  # a plane above a lowered gaze
    assert np.isnan(camera.project(np.array([[1.0, 0.0, 0.0]]))).all()  # behind it


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"size": (0, 3)}, "at least 1x1"),
        ({"focal": -1.0}, "more than 0"),
        ({"focal": math.nan}, "more than 0"),
        ({"centre": (math.inf, 0.0)}, "principal point"),
        ({"X_WC": np.eye(3)}, "4 by 4"),
        ({"X_WC": np.diag([2.0, 1, 1, 1])}, "rotation"),
        ({"X_WC": np.diag([-1.0, 1, 1, 1])}, "rotation"),
        ({"X_WC": np.eye(4) + np.eye(4)[[3, 1, 2, 0]] * [1, 0, 0, 0]}, "row 0 0 0 1"),
    ],
)
def test_what_is_no_camera(change: dict[str, object], message: str) -> None:
    good: dict[str, object] = {"size": (4, 3), "focal": 5.0, "centre": (1.5, 1.0), "X_WC": np.eye(4)}
    with pytest.raises(PerceptionError, match=message):
        Camera(**(good | change))  # type: ignore[arg-type]


def test_arrays_of_the_wrong_shape() -> None:
    camera = looking_down()
    with pytest.raises(PerceptionError, match=r"\(n, 3\)"):
        camera.project(np.zeros((2, 2)))
    with pytest.raises(PerceptionError, match=r"\(n, 2\)"):
        camera.to_plane(np.zeros(2), 0.0)
    with pytest.raises(PerceptionError, match=r"\(48, 64\)"):
        camera.points(np.zeros((4, 4), np.float32))
    with pytest.raises(PerceptionError, match="field of view"):
        Camera.with_view((4, 3), 3.2, np.eye(4))


def test_a_camera_keeps_its_pose() -> None:
    pose = np.eye(4)
    camera = Camera((4, 3), 5.0, (1.5, 1.0), pose)
    pose[0, 3] = 1.0
    assert camera.position[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        camera.X_WC[0, 3] = 1.0
