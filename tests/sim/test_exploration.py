"""The robot's own exploration: it is honest physics, and its file survives what may happen to it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.affordances.explored import read_explored
from cognitive_arch.affordances.trials import read_trials
from cognitive_arch.evaluation.exploration import COLUMNS, HEADER, ExploreConfig, explore
from cognitive_arch.perception.descriptors import describe
from cognitive_arch.perception.top_view import silhouette
from cognitive_arch.shapes import Box
from sim.exploration import CARDS, HELD_OUT_CARDS, TRIALS, Setup, _stream, draw_setup, half_width, try_out
from sim.exploration_things import HELD_OUT, OBJECTS, TOOLS
from sim.exploration_views import VIEWS, descriptors_of, hand_descriptors
from sim.hands import Posture

TURNING = ("nu20", "nu11", "nu02", "nu30", "nu21", "nu12", "nu03")


def moved(
    manipulator: str, action: str, obj: str, hand: str = "LeftHand", seed: int = 0
) -> tuple[float, float]:
    found = try_out(Setup(hand, manipulator, action, obj), np.random.default_rng(seed))
    return (found.end[0] - found.start[0], found.end[1] - found.start[1])


# -- what is tried ------------------------------------------------------------------------------------


def test_a_pack_deals_everything_to_both_hands() -> None:
    pack = 2 * len(TOOLS) * (len(OBJECTS) - 1 + HELD_OUT_CARDS)
    dealt = [draw_setup("tool", 3, block, 0) for block in range(pack)]
    assert len({(s.hand, s.manipulator, s.object) for s in dealt}) == 2 * len(TOOLS) * len(OBJECTS)
    assert sum(s.object == HELD_OUT for s in dealt) / pack == pytest.approx(690 / 2353, abs=0.01)
    assert [s.object for s in dealt] != [draw_setup("tool", 4, block, 0).object for block in range(pack)]
    assert {draw_setup("hand", 3, 0, place).action for place in range(4)} == {
        "tapFromLeft",
        "tapFromRight",
        "pull",
        "push",
    }


def test_hands_and_tools_draw_random_numbers_of_their_own() -> None:
    drawn = {
        _stream(kind, seed, use, 5).random()
        for kind in ("hand", "tool")
        for seed in (0, 1)
        for use in (CARDS, TRIALS)
    }
    assert len(drawn) == 8


@given(st.integers(1, 500))
def test_blocks_of_both_kinds_take_turns(trials: int) -> None:
    config = ExploreConfig("both", trials)
    numbers = [n for block in config.blocks(0) for n in block]
    assert numbers == list(range(trials))
    for kind in ("hand", "tool"):
        blocks = [config.block_of(n)[1] for n in numbers if config.kind_of(n) == kind]
        assert sorted(set(blocks)) == list(range(len(set(blocks))))  # none is left out


@settings(max_examples=40, deadline=None)
@given(st.floats(-4, 4), st.floats(0.01, 0.2), st.floats(0.01, 0.2))
def test_how_far_a_box_reaches(angle: float, x: float, y: float) -> None:
    corners = [(sx * x / 2, sy * y / 2) for sx in (-1, 1) for sy in (-1, 1)]
    farthest = max(cx * math.cos(angle) + cy * math.sin(angle) for cx, cy in corners)
    assert half_width(Box(type="box", size=(x, y, 0.02)), angle) == pytest.approx(farthest)


# -- what it looks like -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Stick", "Rake", "Hook-left", "Cube", "Plate"])
def test_what_the_camera_sees_is_what_the_shape_says(name: str) -> None:
    shape = (TOOLS | OBJECTS)[name]  # type: ignore[operator]
    seen, known = descriptors_of(shape), describe(silhouette(shape))
    part = known.top if name in TOOLS else known.whole
    for column, value in seen.items():
        prefix, descriptor = column.split("_", 1)
        if prefix in "mo" and descriptor not in TURNING:
            assert value == pytest.approx(part[descriptor], rel=0.15, abs=0.03), column


def test_views_differ_a_little_and_hooks_only_by_their_side() -> None:
    rake = [descriptors_of(TOOLS["Rake"], view) for view in (0, 1, VIEWS - 1)]
    assert rake[0] != rake[1]
    assert all(one["m_area"] == pytest.approx(rake[0]["m_area"], rel=0.05) for one in rake)
    left, right = (descriptors_of(TOOLS[name]) for name in ("Hook-left", "Hook-right"))
    assert left["m_convexity"] == pytest.approx(right["m_convexity"], abs=0.01)
    assert np.sign(left["m_nu11"]) == -np.sign(right["m_nu11"])


def test_objects_are_seen_as_they_lie() -> None:
    along, across = (descriptors_of(OBJECTS["Plank"], 2, yaw) for yaw in (0.0, math.pi / 2))
    assert along["o_nu02"] > 3 * along["o_nu20"]  # far from the robot is up
    assert across["o_nu20"] > 3 * across["o_nu02"]
    assert across["o_area"] == pytest.approx(along["o_area"], rel=0.03)


@pytest.mark.parametrize("name", ["Long-hook", "Rake", "Stick"])
def test_shipped_trials_show_what_is_seen_now(name: str) -> None:
    """Else what was learned from them is of other pictures than those it is asked about."""
    table = read_explored()
    seen = [descriptors_of(TOOLS[name], view) for view in range(VIEWS)]
    kept = table.shape_m[table.manipulator == name]
    for place, descriptor in enumerate(table.names_m):
        if descriptor not in TURNING:
            now = [one[f"m_{descriptor}"] for one in seen]
            assert kept[:, place].min() == pytest.approx(min(now), abs=0.05), descriptor
            assert kept[:, place].max() == pytest.approx(max(now), abs=0.05), descriptor


def test_hands_differ_by_their_posture() -> None:
    areas = {posture: hand_descriptors(posture)["m_area"] for posture in Posture}
    assert areas[Posture.STRAIGHT] > areas[Posture.ARCHED] > areas[Posture.BENT]
    other = hand_descriptors(Posture.BENT, "RightHand")
    assert other["m_area"] == pytest.approx(areas[Posture.BENT], rel=0.05)


# -- what it does -------------------------------------------------------------------------------------


@pytest.mark.parametrize("hand", ["LeftHand", "RightHand"])
def test_directions_are_those_of_the_robot(hand: str) -> None:
    assert moved("Rake", "tapFromLeft", "Cube", hand)[1] > 0.025
    assert moved("Rake", "tapFromRight", "Can", hand)[1] < -0.025
    assert moved("Stick", "push", "Plate", hand)[0] < -0.025
    assert moved("Rake", "pull", "Cube", hand)[0] > 0.025
    assert abs(moved("Stick", "pull", "Cube", hand)[0]) < 0.025


@pytest.mark.parametrize("name", ["Hook-left", "Hook-right"])
def test_a_hook_pulls_whichever_side_its_bar_is_on(name: str) -> None:
    assert moved(name, "pull", "Can", seed=1)[0] > 0.025


def test_bent_fingers_pull_and_straight_ones_pass_over() -> None:
    assert moved("bent", "pull", "Cube")[0] > 0.025
    assert abs(moved("straight", "pull", "Cube")[0]) < 0.01


def test_the_same_trial_twice_is_the_same(tmp_path: Path) -> None:
    setup = Setup("RightHand", "Short-hook", "pull", "Pear")
    first, between, again = (
        try_out(s, np.random.default_rng(8))
        for s in (setup, Setup("RightHand", "bent", "push", "Ball"), setup)
    )
    assert (first.start, first.end, first.view) == (again.start, again.end, again.view)
    assert between.setup.kind == "hand"
    assert set(first.descriptors) >= {"m_area", "h_area", "o_area"}


# -- what is kept -------------------------------------------------------------------------------------


def test_a_killed_exploration_goes_on_as_if_nothing_had_happened(tmp_path: Path) -> None:
    whole, killed = tmp_path / "whole.csv", tmp_path / "killed.csv"
    config = ExploreConfig("both", 10, seed=2)
    assert explore(config, whole, jobs=2) == 10
    assert explore(ExploreConfig("both", 2, seed=2), killed) == 2
    with killed.open("a", encoding="utf-8") as file:
        file.write("2,Stick,Cu")  # what a kill leaves of a line
    told: list[int] = []
    assert explore(config, killed, on_rows=lambda done, total: told.append(done)) == 8
    assert told == list(range(2, 11))
    assert killed.read_text() == whole.read_text()
    table = read_trials(whole)
    assert len(table) == 10
    assert set(table.kind) == {"hand", "tool"}
    assert {"area", "convexity"} <= set(table.names_m) & set(table.names_h) & set(table.names_o)
    assert explore(config, whole) == 0


def test_files_of_something_else_are_left_alone(cogarch: Any, tmp_path: Path) -> None:
    out = tmp_path / "trials.csv"
    explore(ExploreConfig("tool", 1, seed=1), out)
    before = out.read_text()
    for options, said in (
        (["--seed", "2", "--kind", "tool"], "holds another exploration (seed 1, now 2)"),
        (["--seed", "1"], "holds another exploration (kind tool, now both)"),
    ):
        assert_refused(cogarch("explore", "--out", str(out), "--trials", "3", *options), said)
    assert out.read_text() == before
    out.write_text(before.replace(",tool,", ",hand,"))
    assert_refused(
        cogarch("explore", "--out", str(out), "--trials", "3", "--seed", "1", "--kind", "tool"),
        "has been changed by something else",
    )
    mine = tmp_path / "mine.csv"
    mine.write_text("precious\n")
    assert_refused(cogarch("explore", "--out", str(mine)), "not a file of this exploration")
    assert mine.read_text() == "precious\n"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--out", "t.csv", "--kind", "foot"], "unknown kind 'foot'"),
        (["--out", "t.csv", "--trials", "0"], "0 trials; valid: 1 to"),
        (["--out", "t.csv", "--seed", "-1"], "seed -1; valid: 0 or more"),
        (["--out", "t.csv", "--jobs", "0"], "0 jobs; valid: 1 to"),
        (["--out", "t.parquet"], "valid: a .csv file"),
        (["--out", "/dev/null/t.csv"], "cannot use the folder"),
    ],
)
def test_bad_input_is_told_in_one_line(cogarch: Any, options: list[str], said: str) -> None:
    assert_refused(cogarch("explore", *options), said)


def test_the_answer_counts_and_pictures_are_kept(cogarch: Any, tmp_path: Path) -> None:
    out, pictures = tmp_path / "t.csv", tmp_path / "pictures"
    answer = cogarch(
        "explore", "--out", str(out), "--kind", "hand", "--trials", "1", "--picture", str(pictures), "--json"
    )
    assert answer.code == 0
    assert (answer.json["trials"], answer.json["new"], answer.json["kinds"]) == (1, 1, {"hand": 1})
    assert [path.name for path in pictures.iterdir()] == ["trial_00000.png"]
    told = json.loads((tmp_path / "t.csv.json").read_text())
    assert told["config"] == {"kind": "hand", "trials": 1, "seed": 0}
    assert out.read_text().startswith(HEADER)
    assert len(out.read_text().splitlines()[1].split(",")) == len(COLUMNS)


def assert_refused(answer: Any, said: str) -> None:
    assert answer.code == 2
    (line,) = [row for row in answer.err.splitlines() if row.strip()]
    assert said in line
