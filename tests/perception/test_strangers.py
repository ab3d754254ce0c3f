"""What is seen and not known, as boxes; which of them are remembered."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.perception.strangers import Strangers, enclosing
from cognitive_arch.shapes import Box, Shape
from cognitive_arch.world.tracking import Place, Pose

TABLE = -0.1


def block(x: float, y: float, size: tuple[float, float, float], yaw: float = 0.0) -> np.ndarray:
    """Places on the upper side of a block and on its edges, (n, 3)."""
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 15) * size[0], np.linspace(-0.5, 0.5, 15) * size[1])
    c, s = math.cos(yaw), math.sin(yaw)
    top = np.column_stack([x + c * u.ravel() - s * v.ravel(), y + s * u.ravel() + c * v.ravel()])
    return np.vstack([np.column_stack([top, np.full(len(top), TABLE + z)]) for z in (0.005, size[2])])


def says(answer: Place):  # type: ignore[no-untyped-def]
    return lambda shape, pose: answer


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-0.6, -0.2),
    st.floats(-0.3, 0.3),
    st.floats(0.02, 0.2),
    st.floats(0.02, 0.2),
    st.floats(0.01, 0.2),
    st.floats(-3, 3),
)
def test_a_box_encloses_what_is_seen_and_hardly_more(
    x: float, y: float, length: float, width: float, height: float, yaw: float
) -> None:
    surface = block(x, y, (length, width, height), yaw)
    stranger = enclosing(surface, TABLE)
    local = (surface - stranger.pose[:3, 3]) @ stranger.pose[:3, :3]
    beyond = np.abs(local) - np.array(stranger.shape.size) / 2
    assert beyond.max() <= 0.05 * max(length, width)
    assert (beyond < 1e-6).all(axis=1).mean() > 0.97
    assert math.prod(stranger.shape.extent) <= 1.4 * length * width
    assert stranger.shape.height == pytest.approx(height)


def test_pieces_of_known_things_are_no_strangers() -> None:
    known: tuple[Shape, Pose] = (Box(type="box", size=(0.06, 0.06, 0.04)), np.eye(4))
    known[1][:3, 3] = (-0.4, 0.1, TABLE + 0.02)
    strangers = Strangers(TABLE)
    strangers.update([block(-0.39, 0.1, (0.02, 0.06, 0.04))], [known], says(Place.TAKEN))
    assert strangers.known == []
    strangers.update([block(-0.39, 0.1, (0.02, 0.06, 0.04))], [], says(Place.TAKEN))
    assert len(strangers.known) == 1


def test_what_stands_on_a_known_thing_begins_there() -> None:
    known: tuple[Shape, Pose] = (Box(type="box", size=(0.06, 0.06, 0.04)), np.eye(4))
    known[1][:3, 3] = (-0.4, 0.1, TABLE + 0.02)
    surface = block(-0.4, 0.1, (0.03, 0.03, 0.03)) + np.array([0, 0, 0.05])
    strangers = Strangers(TABLE)
    strangers.update([surface], [known], says(Place.TAKEN))
    (one,) = strangers.known
    assert one.pose[2, 3] - one.shape.height / 2 == pytest.approx(TABLE + 0.04)


@pytest.mark.parametrize(("verdict", "left"), [(Place.HIDDEN, 1), (Place.EMPTY, 0), (Place.TAKEN, 0)])
def test_one_that_is_not_seen_is_remembered_only_while_it_is_hidden(verdict: Place, left: int) -> None:
    strangers = Strangers(TABLE)
    strangers.update([block(-0.4, 0.1, (0.05, 0.04, 0.06))], [], says(Place.TAKEN))
    strangers.update([], [], says(verdict))
    assert len(strangers.known) == left


def test_one_that_is_half_covered_stays_as_large_as_it_was() -> None:
    strangers = Strangers(TABLE)
    strangers.update([block(-0.4, 0.1, (0.05, 0.04, 0.06))], [], says(Place.TAKEN))
    strangers.update([block(-0.39, 0.1, (0.03, 0.04, 0.06))], [], says(Place.TAKEN))
    (one,) = strangers.known
    assert one.shape.extent == pytest.approx((0.05, 0.04))
    strangers.update([block(-0.39, 0.1, (0.03, 0.04, 0.06))], [], says(Place.EMPTY))
    (one,) = strangers.known
    assert sorted(one.shape.extent) == pytest.approx([0.03, 0.04])


def test_what_was_kept_and_is_damaged() -> None:
    strangers = Strangers(TABLE)
    strangers.update([block(-0.4, 0.1, (0.05, 0.04, 0.06))], [], says(Place.TAKEN))
    (row,) = strangers.to_json()
    other = Strangers(TABLE)
    other.restore([row])
    assert other.to_json() == [row]
    for wrong in ({**row, "size": [0.1, -1, 0.1]}, {**row, "pose": [[0.0] * 4] * 4}):
        with pytest.raises(ValueError, match=r"pose|greater than"):
            other.restore([wrong])
