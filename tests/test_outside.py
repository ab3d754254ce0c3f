"""Outside events: how they are written, which ones can happen, and in what order."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cognitive_arch.domain import load_domain
from cognitive_arch.errors import ConfigError
from cognitive_arch.execution.placing import CLEARANCE, footprint, nearest_free
from cognitive_arch.outside import PLACED, TABLE_X, TABLE_Y, Happening, OutsideEvent, Schedule, on_table, told
from cognitive_arch.scenes import load_scene

places = st.tuples(st.floats(*TABLE_X), st.floats(*TABLE_Y))
names = st.sampled_from(sorted(load_domain("sandwich").objects))


@st.composite
def events(draw: st.DrawFn) -> OutsideEvent:
    kind = draw(st.sampled_from(Happening))
    return OutsideEvent(
        draw(st.integers(1, 999)), kind, draw(names), draw(places) if kind in PLACED else None
    )


@given(events())
def test_what_is_written_is_read_back(event: OutsideEvent) -> None:
    assert OutsideEvent.parse(str(event)) == event


@given(st.text())
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    try:
        event = OutsideEvent.parse(text)
    except ConfigError as error:
        said = str(error)
    else:
        said = "valid: " if OutsideEvent.parse(str(event)) == event else ""
    assert "valid: " in said
    assert "\n" not in said


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "cannot be read; valid: STEP:KIND:NAME"),
        ("3", "cannot be read"),
        ("3:remove", "cannot be read"),
        ("3:remove:", "cannot be read"),
        ("3:move:Ham:-0.3,0.1:again", "cannot be read"),
        ("soon:remove:Ham", "'soon' is not a step; valid: 1 to 999"),
        ("0:remove:Ham", "step 0 is out of range; valid: 1 to 999"),
        ("-2:remove:Ham", "step -2 is out of range"),
        ("1000:remove:Ham", "step 1000 is out of range"),
        ("3:removed:Ham", "(did you mean remove?); valid: add, empty, move, remove, topple"),
        ("3:move:Ham", "move needs a place; valid: STEP:KIND:NAME"),
        ("3:add:Ham", "add needs a place"),
        ("3:remove:Ham:-0.3,0.1", "remove takes no place"),
        ("3:empty:LeftHand:-0.3,0.1", "empty takes no place"),
        ("3:move:Ham:-0.3", "'-0.3' is not a place; valid: X,Y in metres"),
        ("3:move:Ham:here,there", "'here,there' is not a place"),
        ("3:move:Ham:-0.3,0.1,0.2", "is not a place"),
        ("3:move:Ham:0.3,0.1", "not on the table; valid: x from -0.82 to -0.18, y from -0.42 to 0.42"),
        ("3:move:Ham:-0.3,nan", "not on the table"),
        ("3:move:Ham:-inf,0", "not on the table"),
    ],
)
def test_malformed_events(text: str, says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        OutsideEvent.parse(text)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        (["3:remove:Unicorn"], "unknown object by then 'Unicorn'; valid: Bun-bottom, Bun-top, Ham"),
        (["3:move:ham:-0.3,0.1"], "(did you mean Ham?)"),
        (["3:topple:Cheese"], "unknown object by then 'Cheese'"),
        (["3:add:Ham:-0.3,0.1"], "Ham is there already by then; valid: Cheese, Rake, Stick, Tomato"),
        (["3:add:Unicorn:-0.3,0.1"], "unknown object 'Unicorn'; valid: Cheese, Rake, Stick, Tomato"),
        (["3:empty:Ham"], "unknown hand 'Ham'; valid: LeftHand, RightHand"),
        (["4:move:Ham:-0.3,0.1", "3:remove:Ham"], "event '4:move:Ham:-0.3,0.1': unknown object by then"),
        (["2:topple:Cheese", "2:add:Cheese:-0.3,0.1"], "event '2:topple:Cheese'"),
    ],
)
def test_events_that_cannot_happen(texts: list[str], says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_scene("simple").with_events(tuple(map(OutsideEvent.parse, texts)), load_domain("sandwich"))
    assert says in str(caught.value)


def test_what_was_taken_away_may_come_back() -> None:
    texts = ("5:add:Ham:-0.3,0.1", "3:remove:Ham", "6:topple:Ham", "6:add:Cheese:-0.3,0.1")
    scene = load_scene("simple").with_events(tuple(map(OutsideEvent.parse, texts)), load_domain("sandwich"))
    assert scene.things == ("Bun-bottom", "Bun-top", "Cheese", "Ham")


SCENE = """
name: mine
objects: {Ham: {position: [-0.3, 0.1]}}
events:
  - 2:add:Cheese:-0.30,-0.10
"""


def test_events_of_a_scene_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(SCENE)
    assert load_scene(str(path)).events == (OutsideEvent(2, Happening.ADD, "Cheese", (-0.3, -0.1)),)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "2:add",
            "two:add",
            "mine.yaml: events.0: Value error, event 'two:add:Cheese:-0.30,-0.10': 'two' is",
        ),
        ("2:add:Cheese:-0.30,-0.10", "{step: 2}", "an event is text such as 3:remove:Tomato, this is dict"),
        ("2:add:Cheese:-0.30,-0.10", "7", "this is int"),
        ("Cheese", "Unicorn", "mine.yaml: event '2:add:Unicorn:-0.3,-0.1': unknown object 'Unicorn'"),
    ],
)
def test_broken_events_of_a_scene_file(tmp_path: Path, old: str, new: str, says: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(SCENE.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        load_scene(str(path))
    assert says in str(caught.value)


def test_a_schedule_hands_out_each_event_once_and_in_order() -> None:
    texts = ("4:remove:Ham", "2:empty:LeftHand", "2:topple:Ham", "2:move:Ham:-0.3,0.1")
    schedule = Schedule(map(OutsideEvent.parse, texts))
    assert schedule.due(1, Happening) == ()
    assert [e.kind for e in schedule.due(2, (Happening.TOPPLE, Happening.MOVE))] == ["topple", "move"]
    assert [e.kind for e in schedule.due(3, Happening)] == ["empty"]
    assert [e.kind for e in schedule.pending] == ["remove"]


@given(places, st.lists(places, max_size=8))
def test_a_free_place_is_on_the_table_and_free(wanted: tuple[float, float], others: list[object]) -> None:
    place = nearest_free(wanted, others)  # type: ignore[arg-type]
    assert on_table(place)
    assert all(math.dist(place, other) >= CLEARANCE for other in others)  # type: ignore[arg-type]


def test_a_tool_needs_more_room_than_its_middle() -> None:
    rake = load_domain("sandwich").objects["Rake"].shape
    points = footprint(rake, math.pi / 2)
    x, y = nearest_free((-0.4, 0.12), [(-0.4, 0.0)], points)
    assert all(math.dist((x + dx, y + dy), (-0.4, 0.0)) >= CLEARANCE for dx, dy in points)


@pytest.mark.parametrize(
    ("event", "changed", "says"),
    [
        ("1:remove:Ham", ("Ham",), "Ham was taken away"),
        ("1:remove:Ham", (), "Ham was not there"),
        ("1:move:Ham:-0.35,0.1", ("Ham",), "Ham was moved to (-0.350, 0.100)"),
        ("1:add:Ham:-0.35,0.1", ("Ham",), "Ham was put on the table at (-0.350, 0.100)"),
        ("1:add:Ham:-0.35,0.1", (), "Ham was there already"),
        ("1:topple:Ham", ("Ham", "Bun-top"), "Ham and Bun-top fell to the table"),
        ("1:topple:Ham", (), "Ham lay on nothing to fall from"),
        ("1:empty:LeftHand", ("Ham",), "Ham slipped from LeftHand"),
        ("1:empty:LeftHand", (), "LeftHand held nothing to lose"),
    ],
)
def test_what_the_log_says(event: str, changed: tuple[str, ...], says: str) -> None:
    assert told(OutsideEvent.parse(event), changed) == says


@pytest.mark.physics
def test_the_table_is_the_one_in_the_simulator() -> None:
    from sim.scenario import TABLE_CENTRE_X, TABLE_SIZE

    rim = 0.03
    half_x, half_y = TABLE_SIZE[0] / 2 - rim, TABLE_SIZE[1] / 2 - rim
    assert pytest.approx((TABLE_CENTRE_X - half_x, TABLE_CENTRE_X + half_x)) == TABLE_X
    assert pytest.approx((-half_y, half_y)) == TABLE_Y
