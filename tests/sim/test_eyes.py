"""What the robot's eyes show, against where things are."""

from __future__ import annotations

import numpy as np
import pytest

from cognitive_arch.domain import load_domain
from cognitive_arch.errors import PerceptionError
from cognitive_arch.scenes import load_scene
from sim.eyes import EyeImage, EyeNoise, Eyes
from sim.world import World


@pytest.fixture(scope="module")
def world() -> World:
    scene = load_scene("complex")
    world = World(load_domain(scene.domain), scene)
    world.reset(scene.objects)
    # Both hands over the table, in view.
    for side in ("l", "r"):
        world.home[world.joint_names.index(f"{side}_shoulder_yaw")] = 0.3
    world.reset(scene.objects)
    return world


@pytest.fixture(scope="module")
def eyes(world: World) -> Eyes:
    return Eyes(world.domain, world.scene)


@pytest.fixture(scope="module")
def seen(world: World, eyes: Eyes) -> EyeImage:
    return eyes.look(world.positions())


def test_the_whole_table_where_things_lie_is_in_view(seen: EyeImage, world: World) -> None:
    corners = [(x, y, world.scene.table.height) for x in (-0.20, -0.80) for y in (-0.35, 0.35)]
    pixels = seen.camera.project(np.array(corners))
    assert (pixels >= 0).all()
    assert (pixels <= np.array(seen.camera.size) - 1).all()


def test_depth_tells_where_things_are(seen: EyeImage, world: World) -> None:
    points = seen.camera.points(seen.depth)
    for name in ("Bun-bottom", "Bun-top", "Ham", "Tomato"):
        top = world.pose(name).translation() + np.array([0, 0, world.height(name) / 2])
        column, row = np.rint(seen.camera.project(top[None])[0]).astype(int)
        assert np.allclose(points[row, column], top, atol=0.003), name


def test_pixels_and_places_agree_to_a_fraction_of_a_pixel(seen: EyeImage, world: World) -> None:
    """Half a pixel off, and the table would seem tilted and a third of a millimetre too high."""
    heights = seen.camera.points(seen.depth)[:, :, 2]
    table = (np.abs(heights - world.scene.table.height) < 0.002) & ~seen.own
    assert table.mean() > 0.3
    # Sides of things that stand on it count, too: they are few.
    assert np.quantile(np.abs(heights[table] - world.scene.table.height), 0.95) < 1e-5


def test_colour_and_depth_have_one_pose(seen: EyeImage, world: World) -> None:
    """The tomato is where it is red, and where the depth is above the table."""
    x, y, _ = world.pose("Tomato").translation()
    points = seen.camera.points(seen.depth)
    near = np.hypot(points[:, :, 0] - x, points[:, :, 1] - y) < 0.08
    high = near & (points[:, :, 2] > world.scene.table.height + 0.004)
    color = seen.color.astype(int)
    red = near & (color[:, :, 0] > 2.0 * color[:, :, 1])
    assert (red & high).sum() / (red | high).sum() > 0.9


def test_its_own_body_is_told_from_what_lies_there(seen: EyeImage, world: World) -> None:
    own = seen.own
    assert 0.1 < own.mean() < 0.5
    for name in ("Bun-bottom", "Bun-top", "Ham", "Tomato"):
        column, row = np.rint(seen.camera.project(world.pose(name).translation()[None])[0]).astype(int)
        assert not own[row, column]
    # What is high above the table beside the things is nothing but the robot.
    points = seen.camera.points(seen.depth)
    high = points[:, :, 2] > world.scene.table.height + 0.05
    assert (own & high).sum() / high.sum() > 0.99


def test_what_hides_the_hand_is_not_the_hand(seen: EyeImage, world: World, eyes: Eyes) -> None:
    """A thing between eye and body: those pixels are its own, not the robot's."""
    rows, columns = np.nonzero(seen.own & (seen.depth < 0.35))
    middle = len(rows) // 2
    row, column = rows[middle], columns[middle]
    positions = world.positions()
    start = world.scenario.objects["Ham"].floating_positions_start()
    (ray,) = seen.camera.ray(np.array([[column, row]]))
    positions[start + 4 : start + 7] = seen.camera.position + 0.7 * seen.depth[row, column] * ray
    assert not eyes.look(positions).own[row, column]


def test_looking_again_shows_the_same(seen: EyeImage, world: World, eyes: Eyes) -> None:
    again = eyes.look(world.positions())
    assert np.array_equal(again.color, seen.color)
    assert np.array_equal(again.depth, seen.depth)
    assert np.array_equal(again.own, seen.own)


def test_noise_is_drawn_from_what_is_passed_in(seen: EyeImage, world: World) -> None:
    noisy = Eyes(world.domain, world.scene, noise=EyeNoise(color=4.0, depth=0.002))
    positions = world.positions()
    one, same, other = (noisy.look(positions, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(one.color, same.color)
    assert not np.array_equal(one.color, other.color)
    finite = np.isfinite(seen.depth)
    error = (one.depth[finite] - seen.depth[finite]) / np.square(seen.depth[finite])
    assert error.std() == pytest.approx(0.002, rel=0.05)
    changed = one.color.astype(int) - seen.color
    assert changed[(seen.color > 40) & (seen.color < 215)].std() == pytest.approx(4.0, rel=0.05)
    assert (one.own ^ seen.own).mean() < 0.01
    assert np.array_equal(noisy.look(positions).color, seen.color)  # nobody drew


def test_impossible_noise() -> None:
    with pytest.raises(PerceptionError, match="valid: 0 to 255"):
        EyeNoise(color=-1)
