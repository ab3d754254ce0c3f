"""The run store survives: kills at any moment, two writers at once, odd names."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cognitive_arch.errors import StoreError
from cognitive_arch.runlog.store import RunStatus, RunStore

LONG_RUN = """
import sys
from pathlib import Path
from cognitive_arch.runs import run_task
from cognitive_arch.session import RunConfig, Progress
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.execution.heuristics import Heuristics
def told(step):
    print(step.number, flush=True)
config = RunConfig(backend="symbolic", noise=NoiseLevels(1.0, 1.0), heuristics=Heuristics.parse("none"))
run_task("make a ham sandwich", config, Path(sys.argv[1]), Progress(on_step=told))
"""


def start(folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", LONG_RUN, str(folder)], stdout=subprocess.PIPE, text=True, env=os.environ
    )


def test_killed_at_random_moments(tmp_path: Path) -> None:
    """Twenty kills: the store opens, what was reported as finished is there, the run is interrupted."""
    rng = random.Random(4)
    for _ in range(20):
        process = start(tmp_path)
        assert process.stdout is not None
        process.stdout.readline()  # it is at work
        time.sleep(rng.choice([0.0, rng.uniform(0.0, 0.15)]))
        with RunStore(tmp_path) as store:
            assert store.runs()[-1].status in (RunStatus.RUNNING, RunStatus.FAILURE)
        process.send_signal(signal.SIGKILL)
        told = [int(line) for line in process.stdout.read().split()]
        process.wait()
        with RunStore(tmp_path) as store:
            runs = store.runs()
            last = runs[-1]
            assert RunStatus.RUNNING not in {run.status for run in runs}
            steps = store.steps(last.run_id)
            assert [s["step"] for s in steps] == list(range(1, len(steps) + 1))
            # A step is told only after its transaction: whatever was told must be there.
            assert len(steps) >= max([1, *told])
            for step in steps:
                world = store.worlds.get(last.run_id, step["world_before"])
                assert sorted(map(str, world.atoms())) == step["atoms"]
    with RunStore(tmp_path) as store:
        interrupted = [run for run in store.runs() if run.status is RunStatus.INTERRUPTED]
    assert len(interrupted) >= 15


def test_killed_before_it_got_to_work(tmp_path: Path) -> None:
    """While it starts, opens the store or begins the run: the store is absent or opens clean."""
    rng = random.Random(5)
    for _ in range(8):
        process = start(tmp_path)
        time.sleep(rng.uniform(0.3, 1.3))
        process.kill()
        process.wait()
        if (tmp_path / "runs.sqlite3").exists():
            with RunStore(tmp_path) as store:
                for run in store.runs():
                    steps = store.steps(run.run_id)
                    assert [s["step"] for s in steps] == list(range(1, len(steps) + 1))
    process = start(tmp_path)
    process.communicate()
    with RunStore(tmp_path) as store:
        assert store.runs()[-1].status is RunStatus.FAILURE


@pytest.mark.physics
def test_a_killed_drake_run_keeps_its_finished_steps(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cognitive_arch.cli", "run", "make a ham sandwich", "--no-record"]
    process = subprocess.Popen([*command, "--store", str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    while not process.stdout.readline().startswith("step 2"):
        assert process.poll() is None
    process.kill()
    process.wait()
    with RunStore(tmp_path) as store:
        (run,) = store.runs()
        assert run.status is RunStatus.INTERRUPTED
        assert [s["action"] for s in store.steps(run.run_id)] == ["graspWith", "putOnWith"]


def test_inspect_shows_the_interruption(tmp_path: Path) -> None:
    process = start(tmp_path)
    assert process.stdout is not None
    process.stdout.readline()
    process.kill()
    process.wait()
    command = [sys.executable, "-m", "cognitive_arch.cli", "inspect", "--store", str(tmp_path), "--json"]
    runs = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)["runs"]
    assert runs[-1]["status"] in ("interrupted", "failure")
    assert "interrupted" in {run["status"] for run in runs}


def test_two_writers_at_once(tmp_path: Path) -> None:
    processes = [start(tmp_path) for _ in range(2)]
    for process in processes:
        assert process.stdout is not None
        assert len(process.stdout.readlines()) == 51
        assert process.wait() == 0
    with RunStore(tmp_path) as store:
        runs = store.runs()
        assert len({run.run_id for run in runs}) == 2
        assert [len(store.steps(run.run_id)) for run in runs] == [51, 51]


def test_ctrl_c_says_what_is_kept(tmp_path: Path) -> None:
    code = (
        "import sys, os, signal\n"
        "from cognitive_arch import cli, report\n"
        "old = report.LiveProgress._step\n"
        "def step(self, s):\n"
        "    old(self, s)\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "report.LiveProgress._step = step\n"
        "sys.argv = ['cogarch', 'run', 'make a ham sandwich', '--backend', 'symbolic', '--store', '.']\n"
        "cli.main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    with RunStore(tmp_path) as store:
        (run,) = store.runs()
        command = f"cogarch run --resume {run.run_id} --store ."
        assert done.stderr.splitlines()[-1] == f"interrupted; finished steps are kept, go on with: {command}"
        assert run.status is RunStatus.INTERRUPTED
        assert len(store.steps(run.run_id)) == 1


def test_finding_runs(tmp_path: Path) -> None:
    manifest = {"instruction": "x"}
    with RunStore(tmp_path, create=True) as store:
        with store.begin("a", manifest) as first, store.begin("a", manifest) as second:
            assert first.run_id != second.run_id
            assert store.find(first.run_id).status is RunStatus.RUNNING
        assert store.find("latest").run_id == second.run_id
        assert store.find(second.run_id).status is RunStatus.INTERRUPTED
        with pytest.raises(StoreError, match="fits 2 runs"):
            store.find(first.run_id[:8])
        with pytest.raises(StoreError, match="latest"):
            store.find("nothing")
        with pytest.raises(StoreError, match="valid: none"):
            store.worlds.get(first.run_id, 0)


def test_no_store(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="there is no run store"):
        RunStore(tmp_path)
    assert list(tmp_path.iterdir()) == []
