"""The command line as a program sees it: JSON, exit codes, one line for bad input."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from cognitive_arch.domain import load_domain

SANDWICH = "make a ham sandwich"
SCENE = """
name: mine
domain: sandwich
objects:
  Ham: {position: [-0.3, 0.1]}
  Bun-bottom: {position: [-0.3, -0.1]}
"""


def test_parse(cogarch: Any) -> None:
    answer = cogarch("parse", SANDWICH, "--json")
    assert answer.code == 0
    assert set(answer.json) == {"instruction", "semantic", "subgoals", "goal"}
    assert answer.json["semantic"] == [
        ["hand", "grasp", "Ham"],
        ["Ham", "reach", "Bun-bottom"],
        ["hand", "put", "Ham"],
        ["hand", "grasp", "Bun-top"],
        ["Bun-top", "reach", "Ham"],
        ["hand", "put", "Bun-top"],
    ]
    assert answer.json["subgoals"] == [
        ["inHand(Ham,LeftHand)", "not isClear(LeftHand)"],
        ["on(Ham,Bun-bottom)", "not inHand(Ham,LeftHand)", "isClear(LeftHand)"],
        [
            "on(Ham,Bun-bottom)", "not inHand(Ham,LeftHand)", "inHand(Bun-top,LeftHand)",
            "not isClear(LeftHand)",
        ],
        [
            "on(Ham,Bun-bottom)", "not inHand(Ham,LeftHand)", "on(Bun-top,Ham)",
            "not inHand(Bun-top,LeftHand)", "isClear(LeftHand)",
        ],
    ]  # fmt: skip
    assert answer.json["goal"] == answer.json["subgoals"][-1]


def test_run_json_and_inspect(cogarch: Any, tmp_path: Path) -> None:
    answer = cogarch("run", SANDWICH, "--backend", "symbolic", "--seed", "5", "--json")
    assert answer.code == 0
    result = answer.json
    for key in (
        "run_id", "instruction", "scene", "backend", "seed", "success", "speed", "good", "total", "subgoals",
        "actions", "final_state", "wall_s",
    ):  # fmt: skip
        assert key in result
    assert (result["success"], result["good"], result["total"], result["speed"]) == (True, 4, 4, 0.92)
    assert result["actions"][0] == {
        "action": "graspWith", "args": ["Ham", "LeftHand"], "outcome": "success", "reason": "none",
    }  # fmt: skip
    assert "on(Bun-top,Ham)" in result["final_state"]

    listed = cogarch("inspect", "--json").json["runs"]
    assert [(r["run_id"], r["status"]) for r in listed] == [(result["run_id"], "success")]
    shown = cogarch("inspect", result["run_id"], "--json").json
    assert shown["manifest"]["seed"] == 5
    assert shown["manifest"]["versions"]["cognitive_arch"]
    assert [s["action"] for s in shown["steps"]] == ["graspWith", "putOnWith", "graspWith", "putOnWith", None]
    step = cogarch("inspect", "latest", "--step", "3", "--json").json
    assert "on(Ham,Bun-bottom)" in step["atoms"]
    lines = cogarch("inspect", "latest", "--format", "jsonl").out.splitlines()
    assert [json.loads(line)["step"] for line in lines] == [1, 2, 3, 4, 5]
    text = cogarch("inspect", "latest").out
    assert "putOnWith(Bun-top,Ham,LeftHand)  success" in text
    assert "on Bun-bottom" in cogarch("inspect", "latest", "--step", "3").out
    assert (tmp_path / "runs" / result["run_id"]).is_dir()


def test_an_honest_failure_exits_1_and_says_why(cogarch: Any) -> None:
    answer = cogarch("run", SANDWICH, "--backend", "symbolic", "--noise", "1", "--heuristics", "adaptability")
    assert answer.code == 1
    assert (
        "failed: sub-goal 1 was not reached (no_plan)\n        tried: graspWith(Ham,LeftHand) (0 of 3 worked)"
        in answer.out
    )
    assert "creativity" not in answer.out
    answer = cogarch(
        "run", SANDWICH, "--backend", "symbolic", "--noise", "1", "--heuristics", "none", "--json"
    )
    assert answer.code == 1
    assert (answer.json["reason"], answer.json["total"], answer.json["speed"]) == ("action_limit", 50, 0.0)
    assert "adaptability" not in answer.out.replace('"heuristics"', "")


def test_same_seed_same_run_in_two_processes(tmp_path: Path) -> None:
    def steps(store: str, hash_seed: str) -> str:
        env = os.environ | {"COGARCH_STORE": str(tmp_path / store), "PYTHONHASHSEED": hash_seed}
        base = [sys.executable, "-m", "cognitive_arch.cli"]
        options = ["--backend", "symbolic", "--scene", "complex", "--noise", "0.4", "--seed", "11"]
        subprocess.run([*base, "run", SANDWICH, *options], env=env, capture_output=True, check=False)
        done = subprocess.run(
            [*base, "inspect", "latest", "--format", "jsonl"], env=env, capture_output=True, check=True
        )
        return done.stdout.decode()

    first = steps("a", "1")
    assert first == steps("b", "2")
    assert len(first.splitlines()) > 5


BAD = [
    (["parse", ""], "empty"),
    (["parse", "   "], "empty"),
    (["parse", "x" * 100_000], "500"),
    (["parse", "\x00\x07\x1b[2J"], ""),
    (["parse", "make a pizza"], "sandwich"),
    (["parse", "grasp the unicorn"], "Ham"),
    (["parse", "juggle the ham"], "grasp"),
    (["parse", "make a sandwich with tomato"], "Tomato"),
    (["parse", SANDWICH, "--scene", "simpel"], "did you mean simple?"),
    (["parse", SANDWICH, "--scene", "none.yaml"], "no scene file"),
    (["run", SANDWICH, "--backend", "gazebo"], "valid: drake, symbolic"),
    (["run", SANDWICH, "--noise", "1.5"], "0 to 1"),
    (["run", SANDWICH, "--noise", "-1"], "0 to 1"),
    (["run", SANDWICH, "--noise", "left=a"], "not a noise level"),
    (["run", SANDWICH, "--noise", "head=0.1"], "valid: left, pull, push, right"),
    (["run", SANDWICH, "--heuristics", "luck"], "goal_maintenance"),
    (["run", SANDWICH, "--planner", "strips"], "a-prada, guided-prada, prada, sst, uct"),
    (["run", SANDWICH, "--seed", "-1"], "seed"),
    (["run", SANDWICH, "--seed", "x"], "seed"),
    (["run", SANDWICH, "--jitter", "3"], "jitter"),
    (["run", SANDWICH, "--rules", "none.nid"], "none.nid"),
    (["run", SANDWICH, "--store", "/dev/null/x", "--backend", "symbolic"], "run store"),
    (["run", SANDWICH, "--seed", "9" * 30], "seed"),
    (["run", SANDWICH, "--rules", ""], "rules file"),
    (["run", SANDWICH, "--rules", "/dev/zero"], "is not a file"),
    (["run", SANDWICH, "--scene", "/dev/zero"], "is not a file"),
    (["run", SANDWICH, "--scene", "/"], "is not a file"),
    (["parse", "hand grasp Ham, LeftHand grasp Bun-top"], "Ham in LeftHand"),
    (["run", SANDWICH, "--frobnicate"], "--frobnicate"),
    (["run"], "sentence"),
    (["run", SANDWICH, "--video", "--backend", "symbolic"], "a video needs physics"),
    (["run", SANDWICH, "--video", "--no-record"], "a video needs physics"),
    (["inspect", "--video", "x.mp4"], "--video needs a run"),
    (["inspect", "latest", "--video", "x.gif"], ".mp4"),
    (["inspect", "latest", "--video", "x.mp4"], "there is no run store"),
    (["fly"], "reproduce, run, see"),
    (["inspect"], "there is no run store"),
    (["inspect", "latest", "--format", "xml"], "valid: jsonl, text"),
    (["inspect", "--step", "1"], "name a run"),
]


@pytest.mark.parametrize(("args", "says"), BAD, ids=[" ".join(a)[:40] for a, _ in BAD])
def test_bad_input_gets_one_line(cogarch: Any, args: list[str], says: str) -> None:
    answer = cogarch(*args)
    assert answer.code == 2
    assert answer.out == ""
    lines = answer.err.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("cogarch: ")
    assert says in lines[0]
    assert lines[0].isprintable()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("objects:", "things:", "objects"),
        ("Ham:", "Unicorn:", "unknown object 'Unicorn'"),
        ("[-0.3, 0.1]", "[-0.3]", "objects.Ham.position"),
        ("[-0.3, 0.1]", "[nan, 0.1]", "objects.Ham.position"),
        ("[-0.3, 0.1]", "[-0.3, 0.1", "line"),
        ("{position: [-0.3, 0.1]}", "{}", "objects.Ham.position"),
        ("domain: sandwich", "domain: pizza", "unknown domain 'pizza'"),
        ("name: mine", "title: mine", "name"),
        ("name: mine", 'name: "a\\0b"', "name"),
        ("name: mine", "name: a/b", "name"),
        ("domain: sandwich", "table: {height: .nan}", "table.height"),
        ("domain: sandwich", "reach: {min_x: .inf}", "reach.min_x"),
        ("[-0.3, 0.1]}", "[-0.3, 0.1], yaw: .nan}", "objects.Ham"),
    ],
)
def test_broken_scene_files(cogarch: Any, tmp_path: Path, old: str, new: str, says: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(SCENE.replace(old, new, 1))
    answer = cogarch("parse", "grasp the ham", "--scene", str(path))
    assert answer.code == 2
    assert len(answer.err.strip().splitlines()) == 1
    assert says in answer.err


def test_own_scene_and_rules_files(cogarch: Any, tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(SCENE)
    answer = cogarch(
        "parse", "put the ham on the bottom bun", "--scene", str(tmp_path / "mine.yaml"), "--json"
    )
    assert answer.json["goal"][0] == "on(Ham,Bun-bottom)"
    broken = load_domain("sandwich").rules_path.read_text().replace("0.70 on", "0.90 on")
    (tmp_path / "broken.nid").write_text(broken)
    answer = cogarch("run", SANDWICH, "--rules", str(tmp_path / "broken.nid"))
    assert answer.code == 2
    assert "broken.nid, line 48: the probabilities of putOnWith sum to 1.2" in answer.err


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("predicate on(object, object)", "predicate on(object)", "takes 1 arguments"),
        ("0.70 on(obj1, obj2)", "0.70 on(obj1, Plate)", "unknown entity 'Plate'"),
    ],
)
def test_rules_that_do_not_fit_the_world(cogarch: Any, tmp_path: Path, old: str, new: str, says: str) -> None:
    text = load_domain("sandwich").rules_path.read_text()
    (tmp_path / "my.nid").write_text(text.replace(old, new, 1))
    answer = cogarch("run", SANDWICH, "--backend", "symbolic", "--rules", str(tmp_path / "my.nid"))
    assert answer.code == 2
    assert says in answer.err


def test_a_reader_that_goes_away_does_not_end_the_run(tmp_path: Path) -> None:
    command = f"{sys.executable} -m cognitive_arch.cli"
    line = f"set -o pipefail; {command} run '{SANDWICH}' --backend symbolic --store {tmp_path} | head -1"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    listed = subprocess.run(
        [*command.split(), "inspect", "--store", str(tmp_path), "--json"], capture_output=True, check=True
    )
    assert [run["status"] for run in json.loads(listed.stdout)["runs"]] == ["success"]


def test_output_that_cannot_be_shown_or_written(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cognitive_arch.cli", "parse", "please make a “ham” sandwich"]
    env = os.environ | {"PYTHONIOENCODING": "ascii"}
    shown = subprocess.run(command, capture_output=True, text=True, check=False, env=env)
    assert shown.returncode == 0
    assert "\\u201cham\\u201d" in shown.stdout
    with open("/dev/full", "w") as full:
        failed = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert failed.returncode == 2
    assert len(failed.stderr.strip().splitlines()) == 1


def test_a_store_that_is_no_database(cogarch: Any, tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "runs.sqlite3").write_text("this is not a database, " * 100)
    answer = cogarch("run", SANDWICH, "--backend", "symbolic")
    assert answer.code == 2
    assert "run store" in answer.err


def test_bad_input_leaves_no_run_behind(cogarch: Any, tmp_path: Path) -> None:
    cogarch("run", "make a pizza", "--backend", "symbolic")
    assert not (tmp_path / "runs").exists()
