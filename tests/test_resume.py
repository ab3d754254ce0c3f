"""A run that was killed and taken up again ends exactly like one that nobody disturbed."""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cognitive_arch import runs
from cognitive_arch.errors import CogArchError, ConfigError, StateError, StoreError
from cognitive_arch.execution.episode import Step
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.runlog.store import RunStatus, RunStore
from cognitive_arch.runs import resume_task, run_task
from cognitive_arch.session import Progress, RunConfig, Setting

SANDWICH = "make a ham sandwich"


class Killed(BaseException):
    """Stands for the end of the process: nothing in the loop may catch it."""


def config(seed: int = 0, noise: str = "0", events: Sequence[str] = (), **more: Any) -> RunConfig:
    return RunConfig(
        backend="symbolic",
        seed=seed,
        jitter=0.01,
        noise=NoiseLevels.parse(noise),
        events=tuple(map(OutsideEvent.parse, events)),
        **more,
    )


CASES = {
    "quiet": (SANDWICH, config()),
    "noise": (SANDWICH, config(5, "left=0.9,right=0.3333333333")),
    "tools": (SANDWICH, config(2, "0.4", scene="complex", planner="a-prada")),
    "events": (
        "make a sandwich with cheese and tomato",
        config(
            1, "0.2", ["2:empty:LeftHand", "4:move:Tomato:-0.36,0.15", "6:topple:Cheese"], scene="kitchen"
        ),
    ),
    "other hand": ("pick up the ham", config(3, "left=1", heuristics=Heuristics.parse("all"))),
    "missing": ("make a tomato sandwich", config(0, "0", ["2:remove:Tomato"], scene="kitchen")),
}


def after_step(number: int) -> Progress:
    """Dies as soon as that step is written."""

    def on_step(step: Step) -> None:
        if step.number == number:
            raise Killed

    return Progress(on_step=on_step)


def during_action(number: int) -> Progress:
    """Dies when that action has been decided on."""
    begun: list[object] = []

    def on_act(action: object) -> None:
        begun.append(action)
        if len(begun) == number:
            raise Killed

    return Progress(on_act=on_act)


def kept(folder: Path) -> dict[str, Any]:
    """All that the store knows of its only run, but for times and ids."""
    with RunStore(folder) as store:
        (run,) = store.runs()
        worlds = [store.worlds.get(run.run_id, v).to_json() for v in store.worlds.versions(run.run_id)]
        steps = store.steps(run.run_id)
        assert store.checkpoint(run.run_id) is None
    return {"steps": steps, "worlds": worlds, "result": dict(run.result or {}, wall_s=0)}


def without_names(result: dict[str, Any]) -> dict[str, Any]:
    return result | {"run_id": "", "store": "", "wall_s": 0.0}


@pytest.fixture(scope="module", params=sorted(CASES))
def undisturbed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    sentence, how = CASES[request.param]
    folder = tmp_path_factory.mktemp("undisturbed")
    result = run_task(sentence, how, folder)
    return sentence, how, result, kept(folder)


def check(undisturbed: Any, folder: Path, kill: Progress) -> None:
    sentence, how, result, expected = undisturbed
    with pytest.raises(Killed):
        run_task(sentence, how, folder, kill)
    assert without_names(resume_task("latest", folder)) == without_names(result)
    assert kept(folder) == expected


def test_killed_after_any_step(undisturbed: Any, tmp_path: Path) -> None:
    for number in range(1, len(undisturbed[-1]["steps"]) + 1):
        check(undisturbed, tmp_path / str(number), after_step(number))


def test_killed_in_the_midst_of_an_action(undisturbed: Any, tmp_path: Path) -> None:
    for number in {1, len(undisturbed[-1]["steps"]) - 1}:
        check(undisturbed, tmp_path / str(number), during_action(number))


def test_killed_again_and_again(undisturbed: Any, tmp_path: Path) -> None:
    """After each step another process goes on; wall time adds up."""
    sentence, how, result, expected = undisturbed
    with pytest.raises(Killed):
        run_task(sentence, how, tmp_path, after_step(1))
    for number in range(2, len(expected["steps"]) + 1):
        with pytest.raises(Killed):
            resume_task("latest", tmp_path, after_step(number))
    resumed = resume_task("latest", tmp_path)
    assert without_names(resumed) == without_names(result)
    assert kept(tmp_path) == expected


def test_wall_time_adds_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(Killed):
        run_task(SANDWICH, config(), tmp_path, after_step(2))
    with RunStore(tmp_path) as store:
        store._db.execute("UPDATE checkpoints SET wall_s = 1000")
    assert 1000 < resume_task("latest", tmp_path)["wall_s"] < 1100


def interrupted(folder: Path) -> str:
    with pytest.raises(Killed):
        run_task(SANDWICH, config(), folder, after_step(2))
    with RunStore(folder) as store:
        return store.find("latest").run_id


def test_what_cannot_be_gone_on_with(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(StoreError, match="there is no run store"):
        resume_task("latest", tmp_path / "nothing")
    run_id = interrupted(tmp_path)
    with pytest.raises(StoreError, match="unknown run 'no'"):
        resume_task("no", tmp_path)
    with RunStore(tmp_path) as store, store.resume(store.find(run_id)):
        assert store.find(run_id).status is RunStatus.RUNNING
        with pytest.raises(StoreError, match="still running"):
            resume_task(run_id, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(runs, "versions", lambda: {"git": "0123456"})
        with pytest.raises(StoreError, match=r"was begun with .*, this is .*git 0123456.*: .*run it anew"):
            resume_task(run_id, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(Setting, "fingerprint", lambda self: "another")
        with pytest.raises(StoreError, match="have changed since"):
            resume_task(run_id, tmp_path)
    # None of the refusals did it any harm.
    assert resume_task(run_id, tmp_path)["success"]
    with pytest.raises(StoreError, match=r"is finished \(success\)"):
        resume_task(run_id, tmp_path)


@pytest.mark.parametrize(
    ("column", "value", "error"),
    [
        ("state", "{}", StateError),
        ("state", "not JSON", StoreError),
        ("state", "[1, 2]", StateError),
        ("wall_s", "much", StoreError),
    ],
)
def test_a_damaged_checkpoint(tmp_path: Path, column: str, value: str, error: type[CogArchError]) -> None:
    interrupted(tmp_path)
    with sqlite3.connect(tmp_path / "runs.sqlite3") as database:
        database.execute(f"UPDATE checkpoints SET {column} = ?", (value,))
    with pytest.raises(error) as told:
        resume_task("latest", tmp_path)
    assert len(str(told.value).splitlines()) == 1


def test_a_configuration_is_read_as_it_was_written() -> None:
    how = CASES["events"][1]
    assert RunConfig.from_json(json.loads(json.dumps(how.to_json()))) == replace(
        how, reach="published", perception="oracle", affordances="default"
    )
    noisy = config(0, "left=0.12345678901234,push=1e-9")
    assert RunConfig.from_json(noisy.to_json()).noise == noisy.noise
    for bad in ({}, how.to_json() | {"future": 1}, how.to_json() | {"noise": None}):
        with pytest.raises(ConfigError, match="cannot be read"):
            RunConfig.from_json(bad)


def test_on_the_command_line(cogarch: Any, tmp_path: Path) -> None:
    run_id = interrupted(tmp_path / "runs")
    shown = cogarch("inspect", run_id).out
    assert f"interrupted after 2 finished steps; go on with: cogarch run --resume {run_id}" in shown
    for args, says in (
        (["--resume", "latest", SANDWICH], "takes no sentence"),
        (["--resume", "latest", "--seed", "3"], "takes no --seed"),
        (["--resume", "latest", "--no-record"], "takes no --record"),
        (["--resume", "nobody"], "unknown run 'nobody'"),
        ([], "or --resume RUN"),
    ):
        answer = cogarch("run", *args)
        assert (answer.code, answer.out) == (2, "")
        assert len(answer.err.splitlines()) == 1
        assert says in answer.err
    answer = cogarch("inspect", run_id, "--video", "x.mp4")
    assert (answer.code, answer.err.count("\n")) == (2, 1)
    assert "there is no trajectory" in answer.err
    answer = cogarch("run", "--resume", run_id[:-2], "--json")
    assert answer.code == 0
    assert answer.json["run_id"] == run_id
    assert [a["action"] for a in answer.json["actions"]] == ["graspWith", "putOnWith"] * 2
    assert cogarch("run", "--resume", "latest").code == 2
    assert "--resume" not in cogarch("inspect", run_id).out


@pytest.mark.physics
def test_a_killed_process_in_drake(tmp_path: Path) -> None:
    """SIGKILL after the first step; another process goes on to the last digit, noise included."""
    sentence = "put the ham on the bottom bun with your left hand"
    how = RunConfig(seed=8, jitter=0.02, noise=NoiseLevels(left=0.2), record=False)
    expected = run_task(sentence, how, tmp_path / "whole")
    base = [sys.executable, "-m", "cognitive_arch.cli", "run", "--store", str(tmp_path / "cut")]
    options = ["--seed", "8", "--jitter", "0.02", "--noise", "left=0.2", "--no-record"]
    process = subprocess.Popen([*base, sentence, *options], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while not process.stdout.readline().startswith("step 1"):
        assert process.poll() is None
    process.kill()
    process.wait()
    done = subprocess.run([*base, "--resume", "latest", "--json"], capture_output=True, check=False)
    assert without_names(json.loads(done.stdout)) == without_names(expected)
    assert len(expected["actions"]) >= 2
    assert kept(tmp_path / "cut") == kept(tmp_path / "whole")
