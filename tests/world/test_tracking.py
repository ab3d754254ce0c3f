"""Things stay the same things: from looks at a table to tracks."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cognitive_arch.shapes import Box, Cylinder, Shape
from cognitive_arch.world.tracking import Candidate, Detection, HandSense, Place, Pose, Track, Tracker

TABLE = -0.096
BUN = Cylinder(type="cylinder", radius=0.03, height=0.02)
SHAPES: dict[str, Shape] = {
    "Bun": BUN,
    "Lid": BUN,
    "Ham": Cylinder(type="cylinder", radius=0.028, height=0.01),
    "Tile": Box(type="box", size=(0.075, 0.055, 0.02)),
}


def at(x: float, y: float, z: float) -> Pose:
    pose = np.eye(4)
    pose[:3, 3] = (x, y, z)
    return pose


def lying(name: str, x: float, y: float, on: float = TABLE) -> Pose:
    """A thing whose underside is at height `on`."""
    return at(x, y, on + SHAPES[name].height / 2)


def seen(pose: Pose, sigma: float = 0.002, **chances: float) -> Detection:
    rest = max(1e-6, 1 - sum(chances.values()))
    return Detection({name: Candidate(p, pose, sigma) for name, p in chances.items()}, rest)


def hands(left: Pose | None = None) -> dict[str, HandSense]:
    away = HandSense(at(0, 0, 1), False)
    return {"LeftHand": away if left is None else HandSense(left, True), "RightHand": away}


@pytest.fixture
def tracker() -> Tracker:
    return Tracker(SHAPES, TABLE)


def look(tracker: Tracker, *detections: Detection, left: Pose | None = None, **places: Place) -> None:
    tracker.update(detections, hands(left), lambda name, pose: places.get(name, Place.EMPTY))


def test_what_is_seen_is_there(tracker: Tracker) -> None:
    look(tracker, seen(lying("Ham", -0.3, 0.1), Ham=0.97), seen(lying("Bun", -0.4, 0), Bun=0.9, Lid=0.1))
    assert set(tracker.tracks) == {"Ham", "Bun"}
    assert tracker.on_table("Ham")
    assert tracker.supports("Ham") == ()


def test_what_is_most_likely_nothing_known_is_no_thing(tracker: Tracker) -> None:
    look(tracker, seen(lying("Ham", -0.3, 0.1), Ham=0.1))
    assert not tracker.tracks


def test_what_falls_over_is_still_itself_though_it_looks_like_a_stranger(tracker: Tracker) -> None:
    look(tracker, seen(lying("Ham", -0.3, 0.1), Ham=0.9))
    look(tracker, seen(lying("Ham", -0.28, 0.12), Ham=0.01))
    assert tracker.tracks["Ham"].pose[0, 3] == pytest.approx(-0.28)
    look(tracker, seen(lying("Ham", -0.45, 0.1), Ham=0.01))
    assert "Ham" not in tracker.tracks


def test_a_stranger_on_what_was_hidden_before_stays_one(tracker: Tracker) -> None:
    look(tracker, seen(lying("Ham", -0.3, 0.1), Ham=0.9))
    look(tracker, Ham=Place.HIDDEN)
    look(tracker, seen(lying("Ham", -0.3, 0.1, on=TABLE + 0.02), Ham=0.01), Ham=Place.HIDDEN)
    assert not tracker.tracks["Ham"].visible


def test_one_name_goes_to_one_thing_and_the_other_gets_the_next_best(tracker: Tracker) -> None:
    first, second = lying("Bun", -0.3, 0.1), lying("Bun", -0.4, 0.0)
    look(tracker, seen(first, Bun=0.6, Lid=0.4), seen(second, Bun=0.9, Lid=0.1))
    assert tracker.tracks["Lid"].pose[:3, 3] == pytest.approx(first[:3, 3])
    assert tracker.tracks["Bun"].pose[:3, 3] == pytest.approx(second[:3, 3])


@given(swap=st.booleans(), drift=st.floats(-0.01, 0.01))
def test_two_that_look_alike_keep_their_names_by_where_they_are(swap: bool, drift: float) -> None:
    tracker = Tracker(SHAPES, TABLE)
    one, other = (-0.3, 0.1), (-0.4, -0.1)
    look(tracker, seen(lying("Bun", *one), Bun=0.9, Lid=0.1), seen(lying("Lid", *other), Bun=0.1, Lid=0.9))
    places = [(one[0] + drift, one[1]), (other[0], other[1] + drift)]
    alike = [seen(lying("Bun", *place), Bun=0.5, Lid=0.5) for place in places]
    look(tracker, *(alike[::-1] if swap else alike))
    assert tracker.tracks["Bun"].pose[0, 3] == pytest.approx(one[0], abs=0.011)
    assert tracker.tracks["Lid"].pose[0, 3] == pytest.approx(other[0], abs=0.011)


def test_a_hidden_thing_is_remembered_and_an_empty_place_means_it_is_gone(tracker: Tracker) -> None:
    look(tracker, seen(lying("Ham", -0.3, 0.1), Ham=0.97))
    look(tracker, Ham=Place.HIDDEN)
    assert not tracker.tracks["Ham"].visible
    look(tracker, Ham=Place.TAKEN)  # something is there that was not recognised
    assert tracker.tracks["Ham"].visible
    look(tracker, Ham=Place.EMPTY)
    assert tracker.tracks == {}
    assert tracker.gone == {"Ham"}
    look(tracker, seen(lying("Ham", -0.5, 0.1), Ham=0.97))
    assert tracker.gone == set()


def test_what_lies_under_something_stays_and_carries_it(tracker: Tracker) -> None:
    look(tracker, seen(lying("Bun", -0.3, 0.0), Bun=0.97), seen(lying("Ham", -0.4, 0.1), Ham=0.97))
    look(tracker, seen(lying("Ham", -0.301, 0.002, TABLE + 0.02), Ham=0.97), Bun=Place.HIDDEN)
    assert tracker.supports("Ham") == ("Bun",)
    assert not tracker.on_table("Ham")
    look(
        tracker,
        seen(lying("Lid", -0.3, 0.0, TABLE + 0.03), Lid=0.97),
        Bun=Place.HIDDEN,
        Ham=Place.HIDDEN,
    )
    assert tracker.supports("Lid") == ("Ham",)


def test_a_layer_that_somebody_took_is_gone_when_what_was_above_lies_in_its_place(tracker: Tracker) -> None:
    look(tracker, seen(lying("Bun", -0.3, 0.0), Bun=0.97))
    look(tracker, seen(lying("Ham", -0.3, 0.0, TABLE + 0.02), Ham=0.97), Bun=Place.HIDDEN)
    hidden: Mapping[str, Place] = {"Bun": Place.HIDDEN, "Ham": Place.HIDDEN}
    look(tracker, seen(lying("Lid", -0.3, 0.0, TABLE + 0.02), Lid=0.97), **hidden)
    assert tracker.gone == {"Ham"}
    assert tracker.supports("Lid") == ("Bun",)


def test_what_is_in_a_hand_moves_with_it_and_is_let_go_with_the_grip(tracker: Tracker) -> None:
    ham = lying("Ham", -0.3, 0.1)
    look(tracker, seen(ham, Ham=0.97))
    tracker.take_hold("LeftHand", "Ham", at(-0.3, 0.1, 0.0), ham)
    tracker.feel(hands(at(-0.2, -0.1, 0.1)))
    assert tracker.held("LeftHand") == "Ham"
    assert tracker.tracks["Ham"].pose[:2, 3] == pytest.approx((-0.2, -0.1))
    look(tracker, left=at(-0.2, -0.1, 0.1))
    assert "Ham" in tracker.tracks, "a full hand is felt, be it seen or not"
    tracker.feel(hands())
    assert tracker.held("LeftHand") is None
    assert tracker.tracks["Ham"].pose[:2, 3] == pytest.approx((-0.2, -0.1)), "the hand tells no more"
    look(tracker, Ham=Place.HIDDEN)
    assert tracker.gone == {"Ham"}, "nothing floats"


def test_eyes_overrule_a_hand_that_holds_something_else(tracker: Tracker) -> None:
    ham = lying("Ham", -0.3, 0.1)
    look(tracker, seen(ham, Ham=0.97))
    tracker.take_hold("LeftHand", "Ham", at(-0.3, 0.1, 0.0), ham)
    look(tracker, seen(lying("Ham", -0.45, 0.1), Ham=0.97), left=at(-0.2, -0.1, 0.1))
    assert tracker.held("LeftHand") is None
    assert tracker.tracks["Ham"].pose[0, 3] == pytest.approx(-0.45)


def test_more_looks_at_a_thing_at_rest_make_its_place_more_exact(tracker: Tracker) -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        noise = rng.normal(0, 0.002, 2)
        look(tracker, seen(lying("Ham", -0.3 + noise[0], noise[1]), 0.002, Ham=0.97))
    assert tracker.tracks["Ham"].pose[:2, 3] == pytest.approx((-0.3, 0.0), abs=0.0025)
    look(tracker, seen(lying("Ham", -0.32, 0.0), 0.002, Ham=0.97))
    assert tracker.tracks["Ham"].pose[0, 3] == pytest.approx(-0.32), "what was moved is where it is now"


def test_the_order_of_tracks_does_not_matter() -> None:
    for names in (("Ham", "Tile"), ("Tile", "Ham")):
        tracker = Tracker(SHAPES, TABLE)
        tracker.tracks = {name: Track(lying(name, -0.3, 0.0), 0.001) for name in names}
        look(tracker, Ham=Place.HIDDEN, Tile=Place.HIDDEN)
        assert set(tracker.tracks) == {"Ham", "Tile"}


def test_a_glimpse_of_what_was_moved_keeps_it_in_mind(tracker: Tracker) -> None:
    look(tracker, seen(lying("Ham", -0.3, 0.1), Ham=0.97))
    there = {"Ham": Candidate(0.9, lying("Ham", -0.5, 0.0), 0.01)}
    look(tracker, Detection(there, 0.1, glimpse=True), Ham=Place.EMPTY)
    assert not tracker.tracks["Ham"].visible
    assert tracker.tracks["Ham"].pose[0, 3] == pytest.approx(-0.5)


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [("hand", "Nose", "other hands"), ("pose", [[0.0] * 4] * 4, "rotation"), ("in_hand", None, "without")],
)
def test_damaged_memory_is_refused(tracker: Tracker, field: str, value: object, says: str) -> None:
    look(tracker, seen(lying("Ham", -0.3, 0.1), Ham=0.97))
    tracker.take_hold("LeftHand", "Ham", at(-0.3, 0.1, 0.0), lying("Ham", -0.3, 0.1))
    saved = tracker.to_json()
    saved["tracks"]["Ham"][field] = value
    with pytest.raises(ValueError, match=says):
        Tracker(SHAPES, TABLE).restore(saved)


def test_saved_and_restored(tracker: Tracker) -> None:
    look(tracker, seen(lying("Ham", -0.3, 0.1), Ham=0.97), seen(lying("Bun", -0.4, 0), Bun=0.97))
    tracker.take_hold("LeftHand", "Ham", at(-0.3, 0.1, 0.0), lying("Ham", -0.3, 0.1))
    look(tracker, left=at(-0.2, -0.1, 0.1), Bun=Place.EMPTY)
    other = Tracker(SHAPES, TABLE)
    other.restore(json.loads(json.dumps(tracker.to_json())))
    assert other.to_json() == tracker.to_json()
    with pytest.raises(ValueError, match="other things"):
        Tracker({"Tile": SHAPES["Tile"]}, TABLE).restore(tracker.to_json())
