"""The demos end as thesis Sec. 6.5.1 tells, and the log says why."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from cognitive_arch.demos import load_demos, read_demos
from cognitive_arch.errors import ConfigError
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.runlog.store import RunStore
from cognitive_arch.runlog.trajectory import TRAJECTORY, Trajectory
from cognitive_arch.runs import run_task
from cognitive_arch.session import RunConfig
from tests.sim.physics import check_physics

SEEDS = range(10)
DEMOS = load_demos()


def play(name: str, store: Path, **settings: Any) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The result of a demo and its step records."""
    demo = DEMOS.find(name)
    return perform(demo.sentence, demo.config(**settings), store)


def perform(sentence: str, config: RunConfig, folder: Path) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    result = run_task(sentence, config, folder)
    with RunStore(folder) as store:
        return result, store.steps(result["run_id"])


def told(steps: list[dict[str, Any]], kind: str) -> list[str]:
    return [event["why"] for step in steps for event in step["events"] if event["kind"] == kind]


def calls(result: dict[str, Any]) -> list[str]:
    return [f"{a['action']}({','.join(a['args'])})" for a in result["actions"]]


def test_the_four_of_the_thesis_are_there() -> None:
    assert {"out-of-reach", "sabotage", "slip", "missing"} <= set(DEMOS.demos)


@pytest.mark.parametrize("name", sorted(DEMOS.demos))
def test_every_demo_ends_as_its_file_says(tmp_path: Path, name: str) -> None:
    result, steps = play(name, tmp_path, backend="symbolic")
    assert result["success"] is DEMOS.find(name).succeeds
    assert len(told(steps, "outside")) == len(DEMOS.find(name).events)


@pytest.mark.parametrize(("name", "taken"), [("by-shape", "Crook"), ("unknown-tool", "Crook")])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_tool_is_chosen_by_its_shape(tmp_path: Path, name: str, taken: str, seed: int) -> None:
    result, steps = play(name, tmp_path, backend="symbolic", seed=seed)
    used = {c.split(",")[1] for c in calls(result) if c.startswith("pull")}
    assert used == {taken}
    rows = [row for step in steps for row in step["probabilities"] if row["action"].startswith("pull(")]
    assert all(row["from"].startswith("affordances: ") for row in rows)
    chosen = [row["p"] for row in rows if f",{taken}," in row["action"]]
    others = [row["p"] for row in rows if f",{taken}," not in row["action"]]
    assert min(chosen) > 0.5 > max(others)


def test_when_the_tool_is_taken_away_another_one_does(tmp_path: Path) -> None:
    result, steps = play("tool-taken", tmp_path, backend="symbolic")
    assert calls(result)[0].startswith("graspWith(Rake,")
    assert any("Rake" in call for call in steps[0]["plan"]["actions"])
    assert not any("Rake" in call for step in steps[1:] if step["plan"] for call in step["plan"]["actions"])
    assert {c.split(",")[1] for c in calls(result) if c.startswith("pull")} == {"Crook"}


@pytest.mark.parametrize("seed", SEEDS)
def test_out_of_reach_the_right_tool_is_used(tmp_path: Path, seed: int) -> None:
    result, _ = play("out-of-reach", tmp_path, backend="symbolic", seed=seed)
    assert result["success"]
    assert calls(result)[0].startswith("graspWith(Rake,")
    assert {c.split("(")[1].split(",")[0] for c in calls(result) if c.startswith("pull")} == {
        "Ham",
        "Bun-top",
    }
    assert not [c for c in calls(result) if "Stick" in c]


@pytest.mark.parametrize("seed", SEEDS)
def test_sabotage_is_repaired(tmp_path: Path, seed: int) -> None:
    result, steps = play("sabotage", tmp_path, backend="symbolic", seed=seed)
    assert result["success"]
    assert {"on(Tomato,Cheese)", "on(Bun-top,Tomato)"} <= set(result["final_state"])
    assert told(steps, "outside") == ["Tomato was moved to (-0.360, 0.150)"]
    assert told(steps, "goal_maintenance") == ["on(Tomato,Cheese) no longer holds: back to sub-goal 4"]
    assert sum(c.startswith("putOnWith(Tomato,Cheese") for c in calls(result)) == 2


@pytest.mark.parametrize("seed", SEEDS)
def test_slip_changes_hands(tmp_path: Path, seed: int) -> None:
    result, steps = play("slip", tmp_path, backend="symbolic", seed=seed)
    check_slip(result, steps)


def check_slip(result: dict[str, Any], steps: list[dict[str, Any]]) -> None:
    assert result["success"]
    assert calls(result)[:3] == ["graspWith(Ham,LeftHand)"] * 3
    assert [a["reason"] for a in result["actions"][:3]] == ["slipped"] * 3
    assert told(steps, "outside") == ["Ham slipped from LeftHand"] * 3
    assert len(told(steps, "adaptability")) == 3
    assert told(steps, "creativity") == ["no plan for sub-goal 1: trying sub-goal 2 directly"]
    assert "putOnWith(Ham,Bun-bottom,RightHand)" in calls(result)


@pytest.mark.parametrize("seed", SEEDS)
def test_missing_is_reported(tmp_path: Path, seed: int) -> None:
    result, steps = play("missing", tmp_path, backend="symbolic", seed=seed)
    check_missing(result, steps)


def check_missing(result: dict[str, Any], steps: list[dict[str, Any]]) -> None:
    assert not result["success"]
    assert result["reason"] == "missing_object"
    assert result["failure"]["absent"] == ["Tomato"]
    assert "it takes Tomato, which I do not see any more" in result["explanation"]
    assert told(steps, "outside") == ["Tomato was taken away"]
    assert result["total"] <= 2


@pytest.mark.parametrize("seed", SEEDS)
def test_what_the_goal_can_do_without_is_not_missed(tmp_path: Path, seed: int) -> None:
    result, steps = play("missing-spare", tmp_path, backend="symbolic", seed=seed)
    assert result["success"]
    assert "on(Ham,Bun-bottom)" in result["final_state"]
    assert told(steps, "outside") == ["Cheese was taken away"]
    assert told(steps, "creativity") == ["no plan for sub-goal 2: trying sub-goal 3 directly"]


@pytest.mark.physics
def test_out_of_reach_in_physics(tmp_path: Path) -> None:
    """The complex scene from end to end; nothing sinks into anything, joints stay in their limits."""
    result, _ = play("out-of-reach", tmp_path, backend="drake")
    assert result["success"]
    assert calls(result)[0].startswith("graspWith(Rake,")
    assert {"on(Ham,Bun-bottom)", "on(Bun-top,Ham)"} <= set(result["final_state"])
    check_physics(Trajectory.load(tmp_path / result["run_id"] / TRAJECTORY))


@pytest.mark.physics
def test_slip_in_physics(tmp_path: Path) -> None:
    check_slip(*play("slip", tmp_path, backend="drake", record=False))


@pytest.mark.physics
def test_missing_in_physics(tmp_path: Path) -> None:
    check_missing(*play("missing", tmp_path, backend="drake", record=False))


@pytest.mark.physics
def test_sabotage_in_physics(tmp_path: Path) -> None:
    config = RunConfig(record=False, events=(OutsideEvent.parse("4:move:Ham:-0.35,0.15"),))
    result, steps = perform("make a ham sandwich", config, tmp_path)
    assert result["success"]
    assert {"on(Ham,Bun-bottom)", "on(Bun-top,Ham)"} <= set(result["final_state"])
    assert told(steps, "outside") == ["Ham was moved to (-0.350, 0.150)"]
    assert told(steps, "goal_maintenance") == ["on(Ham,Bun-bottom) no longer holds: back to sub-goal 2"]


# -- the verb ---------------------------------------------------------------------------------------


def test_demos_are_listed(cogarch: Any) -> None:
    answer = cogarch("demo")
    assert answer.code == 0
    assert [line.split()[0] for line in answer.out.splitlines()] == list(DEMOS.demos)
    assert [demo["name"] for demo in cogarch("demo", "--json").json["demos"]] == list(DEMOS.demos)


def test_a_demo_says_what_to_look_at_and_how_to_vary_it(cogarch: Any) -> None:
    answer = cogarch("demo", "slip", "--backend", "symbolic", "--seed", "3")
    assert answer.code == 0
    assert "look at" in answer.out
    assert "cogarch run 'make a ham sandwich' --scene simple --backend symbolic --seed 3 --event 2:empty" in (
        answer.out
    )
    assert "outside: Ham slipped from LeftHand" in answer.out
    shown = cogarch("inspect", "latest").out
    assert "outside      2:empty:LeftHand, 3:empty:LeftHand, 4:empty:LeftHand" in shown
    assert "outside: Ham slipped from LeftHand" in shown


def test_a_demo_that_ends_with_a_report_exits_1(cogarch: Any) -> None:
    answer = cogarch("demo", "missing", "--backend", "symbolic", "--json")
    assert answer.code == 1
    assert answer.json["demo"] == "missing"
    assert answer.json["events"] == ["2:remove:Tomato"]
    assert answer.json["reason"] == "missing_object"


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (
            "demo sabotge",
            "unknown demo 'sabotge' (did you mean sabotage?); valid: by-shape, missing, missing-spare",
        ),
        ("demo slip --backend gazebo", "unknown backend 'gazebo'; valid: drake, symbolic"),
        ("run go --backend symbolic --event 3:eat:Ham", "unknown kind of event 'eat'; valid: add, empty"),
        (
            "run go --backend symbolic --event 1:remove:Unicorn",
            "unknown object by then 'Unicorn'; valid: Bun",
        ),
    ],
)
def test_bad_input_gets_one_line(cogarch: Any, args: str, says: str) -> None:
    answer = cogarch(*args.split())
    assert answer.code == 2
    assert answer.out == ""
    assert says in answer.err
    assert answer.err.count("\n") == 1


def test_events_of_the_scene_and_of_the_command_line_add_up(
    cogarch: Any,
    tmp_path: Path,
) -> None:
    scene = tmp_path / "mine.yaml"
    scene.write_text(
        "name: mine\nevents: ['1:add:Cheese:-0.3,0.1', '9:remove:Cheese']\n"
        "objects: {Ham: {position: [-0.4, 0.1]}, Bun-bottom: {position: [-0.3, -0.1]}}\n"
    )
    command = ["run", "put the ham on the bottom bun", "--scene", str(scene), "--backend", "symbolic"]
    answer = cogarch(*command, "--event", "2:move:Cheese:-0.35,0.15", "--json")
    assert answer.code == 0
    assert answer.json["events"] == ["1:add:Cheese:-0.3,0.1", "9:remove:Cheese", "2:move:Cheese:-0.35,0.15"]
    run = cogarch("inspect", "latest", "--json").json
    assert run["manifest"]["events"] == answer.json["events"]
    assert told(run["steps"], "outside") == [
        "Cheese was put on the table at (-0.300, 0.100)",
        "Cheese was moved to (-0.350, 0.150)",
        "9:remove:Cheese: the run was over before",
    ]
    assert "reachableWith(Cheese,LeftHand)" in json.dumps(answer.json["final_state"])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("- slip", "a demos file is a mapping of fields"),
        ("slip: {title: t, sentence: s, look: l}", "slip.scene: Field required"),
        (
            "slip: {title: t, sentence: s, look: l, scene: simple, event: []}",
            "Extra inputs are not permitted",
        ),
        (
            "slip: {title: t, sentence: s, look: l, scene: simple, events: ['3:eat:Ham']}",
            "unknown kind of event",
        ),
        ("Slip: {title: t, sentence: s, look: l, scene: simple}", "String should match pattern"),
    ],
)
def test_broken_demos_files(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "demos.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_demos(path)
    assert str(path) in str(caught.value)
    assert says in str(caught.value)
