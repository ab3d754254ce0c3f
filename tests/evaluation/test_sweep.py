"""Sweeps: the same rows whoever does the work and however often it is stopped; bad input gets one line."""

from __future__ import annotations

import csv
import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cognitive_arch.errors import SweepError
from cognitive_arch.evaluation.rows import HEADER, Row
from cognitive_arch.evaluation.running import run_sweep
from cognitive_arch.evaluation.sweep import SweepConfig, parse_heuristics
from cognitive_arch.execution.noise import NoiseLevels
from tests.conftest import patience

TINY = SweepConfig(
    planners=("a-prada",),
    heuristics=("none", "adaptability+creativity"),
    noise=(0.0, 0.5),
    episodes=12,
    coin="published",
)
OPTIONS = [
    "--planner", "a-prada", "--heuristics", "none,adaptability+creativity", "--noise", "0,0.5",
    "--episodes", "12", "--coin", "published",
]  # fmt: skip


def rows_of(folder: Path) -> list[list[str]]:
    """All rows but for the time they took."""
    with open(folder / "rows.csv", encoding="utf-8") as file:
        return [row[:-1] for row in csv.reader(file)]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep") / "serial"
    assert run_sweep(TINY, folder) == TINY.total == 48
    return folder


def start(folder: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "cognitive_arch.cli", "sweep", "--out", str(folder), *OPTIONS, *options]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def wait_for_rows(folder: Path, n: int) -> None:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        path = folder / "rows.csv"
        if path.exists() and path.read_bytes().count(b"\n") > n:
            return
        time.sleep(0.02)
    raise AssertionError("no rows came")


# -- what is swept ----------------------------------------------------------------------------------


def test_cells_are_the_cross_product() -> None:
    config = SweepConfig(scenes=("simple", "complex"), vary=("left", "both"), noise=(0.0, 0.9), episodes=3)
    cells = list(config.cells())
    assert len(cells) == len(set(cells)) == 2 * 2 * 4 * 2
    assert config.total == 3 * len(cells)
    left = next(cell for cell in cells if cell.vary == "left" and cell.noise == 0.9)
    assert left.levels == NoiseLevels(0.9, 0.25, 0.25, 0.25)
    both = next(cell for cell in cells if cell.vary == "both" and cell.noise == 0.9)
    assert both.levels == NoiseLevels(0.9, 0.9, 0.9, 0.9)


@pytest.mark.parametrize("done", [0, 1, 11, 12, 13, 30, 47, 48])
def test_jobs_cover_what_is_left_in_order(done: int) -> None:
    order = [(cell, n) for cell in TINY.cells() for n in range(TINY.episodes)]
    jobs = [(job.cell, n) for job in TINY.jobs(done) for n in range(job.first, job.end)]
    assert jobs == order[done:]


def test_episodes_have_their_own_seeds_the_same_in_every_cell(undisturbed: Path) -> None:
    rows = rows_of(undisturbed)
    seeds = {}
    for row in rows[1:]:
        seeds.setdefault(row[Row._fields.index("episode")], set()).add(row[Row._fields.index("seed")])
    assert all(len(found) == 1 for found in seeds.values())
    assert len({next(iter(found)) for found in seeds.values()}) == TINY.episodes


def test_another_seed_gives_other_episodes() -> None:
    one, other = (SweepConfig(seed=seed) for seed in (0, 1))
    assert {one.episode_seed(n) for n in range(100)}.isdisjoint(other.episode_seed(n) for n in range(100))


def test_heuristics_are_spelt_in_one_way() -> None:
    assert parse_heuristics("creativity+adaptability, none") == ("adaptability+creativity", "none")


# -- the same rows ----------------------------------------------------------------------------------


def test_rows_say_what_the_episodes_were(undisturbed: Path) -> None:
    header, *rows = rows_of(undisturbed)
    assert ",".join([*header, "wall_s"]) + "\n" == HEADER
    first = dict(zip(header, rows[0], strict=True))
    assert (first["scene"], first["planner"], first["heuristics"]) == ("simple", "a-prada", "none")
    assert (first["success"], first["good"], first["total"], first["speed"]) == ("true", "4", "4", "0.92")
    assert first["reason"] == "goal_reached"


def test_remembered_plans_change_nothing(undisturbed: Path, tmp_path: Path) -> None:
    run_sweep(TINY, tmp_path / "anew", remember=False)
    assert rows_of(tmp_path / "anew") == rows_of(undisturbed)


def test_two_processes_write_the_same_rows(undisturbed: Path, tmp_path: Path) -> None:
    run_sweep(TINY, tmp_path / "two", jobs=2)
    assert rows_of(tmp_path / "two") == rows_of(undisturbed)


def test_a_cluster_that_loses_a_worker_writes_the_same_rows(undisturbed: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    seen: list[int] = []
    with distributed.LocalCluster(
        n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:

        def on_rows(done: int, total: int) -> None:
            if done and not seen:
                os.kill(cluster.workers[0].pid, signal.SIGKILL)
            seen.append(done)

        run_sweep(TINY, tmp_path / "cluster", dask=cluster.scheduler_address, on_rows=on_rows)
    assert seen[-1] == TINY.total
    assert rows_of(tmp_path / "cluster") == rows_of(undisturbed)


# -- stopped and gone on with -----------------------------------------------------------------------


def test_killed_three_times_and_resumed(undisturbed: Path, tmp_path: Path) -> None:
    folder, dice = tmp_path / "killed", random.Random(5)
    rows = 0
    for _ in range(3):
        process = start(folder, "--no-memory")
        rows += dice.randint(1, 9)
        wait_for_rows(folder, rows)
        process.kill()
        process.wait()
        rows = (folder / "rows.csv").read_bytes().count(b"\n") - 1
        with open(folder / "rows.csv", "ab") as file:  # a kill may leave half a line, too
            file.write(b"simple,symbo")
    assert 0 < rows < TINY.total
    _, err = start(folder, "--json").communicate(timeout=100)
    assert f"{rows} of 48 episodes are there already" in err
    assert rows_of(folder) == rows_of(undisturbed)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_ends_soon_and_says_how_to_go_on(tmp_path: Path, jobs: str) -> None:
    process = start(tmp_path / "out", "--jobs", jobs, "--no-memory", "--episodes", "500")
    wait_for_rows(tmp_path / "out", 1)
    stopped = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=20)
    assert time.monotonic() - stopped < patience(2)
    assert process.returncode == 130
    assert "go on with: cogarch sweep --out" in err.splitlines()[-1]
    assert "Traceback" not in err


def test_a_finished_sweep_is_not_run_again(undisturbed: Path) -> None:
    before = (undisturbed / "rows.csv").read_bytes()
    assert run_sweep(TINY, undisturbed) == 0
    assert (undisturbed / "rows.csv").read_bytes() == before


# -- bad input --------------------------------------------------------------------------------------

BAD = [
    (["--noise", "1.5"], "noise level 1.5 is out of range; valid: 0 to 1"),
    (["--noise", "nan"], "noise level nan"),
    (["--noise", "low"], "'low' is not a noise level"),
    (["--noise", ","], "at least one noise"),
    (["--noise", "0,0.5,0.5"], "noise 0.5 is given twice"),
    (["--fixed", "-1"], "noise level -1 is out of range"),
    (["--heuristics", "luck"], "unknown heuristic 'luck'"),
    (["--heuristics", "reliability+creativity"], "takes the place of"),
    (["--episodes", "0"], "0 episodes; valid: 1 to"),
    (["--vary", "nose"], "unknown capability to vary 'nose'"),
    (["--vary", "left+left"], "names one twice"),
    (["--scene", "moon"], "unknown scene 'moon'"),
    (["--scene", "toys"], "I do not know the word 'ham'; this scene has Big-box"),
    (["--backend", "real"], "unknown backend 'real'"),
    (["--planner", "luck"], "unknown planner 'luck'"),
    (["--coin", "fair"], "unknown coin 'fair'; valid: published, text"),
    (["--jobs", "0"], "0 jobs; valid: 1 to 1024"),
    (["--seed", "-1"], "seed -1 is out of range"),
    (["--beside", "/nowhere"], "holds no rows"),
    (["--jobs", "2", "--dask", "tcp://127.0.0.1:1"], "give one"),
]


@pytest.mark.parametrize(("args", "says"), BAD, ids=[" ".join(args) for args, _ in BAD])
def test_nonsense_gets_one_line_and_writes_nothing(
    cogarch: Any, tmp_path: Path, args: list[str], says: str
) -> None:
    answer = cogarch("sweep", "--out", str(tmp_path / "out"), *args)
    assert (answer.code, answer.out) == (2, "")
    assert len(answer.err.splitlines()) == 1
    assert says in answer.err
    assert not (tmp_path / "out").exists()


def test_a_scheduler_that_does_not_answer(cogarch: Any, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    started = time.monotonic()
    answer = cogarch("sweep", "--out", str(tmp_path / "out"), "--dask", "tcp://127.0.0.1:1")
    assert time.monotonic() - started < 15
    assert answer.code == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:1 within 5 s" in answer.err
    assert len(answer.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("address", ["foo", "foo://127.0.0.1:1", "127.0.0.1:port"])
def test_an_address_that_is_none_is_not_tried(
    cogarch: Any, tmp_path: Path, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A client that was half made would end in a traceback of its own."""
    distributed = pytest.importorskip("distributed")
    monkeypatch.delattr(distributed.Client, "__init__")
    answer = cogarch("sweep", "--out", str(tmp_path / "out"), "--dask", address)
    assert answer.code == 2
    assert f"'{address}' is no address of a Dask scheduler" in answer.err
    assert len(answer.err.splitlines()) == 1


def test_the_rows_of_another_sweep_are_left_alone(undisturbed: Path, cogarch: Any) -> None:
    before = {path: path.read_bytes() for path in undisturbed.rglob("*") if path.is_file()}
    answer = cogarch("sweep", "--out", str(undisturbed), "--episodes", "3")
    assert answer.code == 2
    assert "holds the rows of another sweep" in answer.err
    assert "episodes 12, now 3" in answer.err
    assert {path: path.read_bytes() for path in undisturbed.rglob("*") if path.is_file()} == before


def test_a_folder_with_other_things_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(SweepError, match=r"files of something else \(thesis.txt\)"):
        run_sweep(TINY, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_rows_that_somebody_changed_are_refused(undisturbed: Path, tmp_path: Path) -> None:
    for name in ("sweep.json", "rows.csv"):
        (tmp_path / name).write_bytes((undisturbed / name).read_bytes())
    lines = (tmp_path / "rows.csv").read_text().splitlines(keepends=True)
    (tmp_path / "rows.csv").write_text("".join([lines[0], *lines[2:]]))
    with pytest.raises(SweepError, match="has been changed by something else"):
        run_sweep(TINY, tmp_path)


def test_other_versions_may_draw_but_not_go_on(undisturbed: Path, tmp_path: Path) -> None:
    manifest = (undisturbed / "sweep.json").read_text()
    (tmp_path / "sweep.json").write_text(manifest.replace('"numpy": "', '"numpy": "0.'))
    (tmp_path / "rows.csv").write_bytes((undisturbed / "rows.csv").read_bytes())
    assert run_sweep(TINY, tmp_path) == 0
    lines = (tmp_path / "rows.csv").read_text().splitlines(keepends=True)
    (tmp_path / "rows.csv").write_text("".join(lines[:20]))
    with pytest.raises(SweepError, match=r"begun with other versions \(numpy 0\."):
        run_sweep(TINY, tmp_path)
    assert (tmp_path / "rows.csv").read_text() == "".join(lines[:20])


def test_two_sweeps_do_not_write_into_one_folder(tmp_path: Path) -> None:
    def on_rows(done: int, total: int) -> None:
        if done == 0:
            with pytest.raises(SweepError, match="another process is writing"):
                run_sweep(TINY, tmp_path / "out")

    run_sweep(TINY, tmp_path / "out", on_rows=on_rows)


@pytest.fixture
def small_disk() -> Iterator[None]:
    """No file may grow beyond 2500 bytes, as if the disk were full then."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2500, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_keeps_whole_rows(tmp_path: Path, undisturbed: Path, small_disk: None) -> None:
    with pytest.raises(SweepError, match="the same command goes on from there"):
        run_sweep(TINY, tmp_path / "out")
    content = (tmp_path / "out" / "rows.csv").read_bytes()
    assert content.endswith(b"\n")
    assert 1 < content.count(b"\n") < TINY.total
    _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    run_sweep(TINY, tmp_path / "out")
    assert rows_of(tmp_path / "out") == rows_of(undisturbed)


@pytest.mark.physics
def test_physics_is_swept_in_the_same_way(tmp_path: Path) -> None:
    config = SweepConfig(
        backends=("symbolic", "drake"), heuristics=("reliability",), noise=(0.0,), episodes=1, seed=2
    )
    run_sweep(config, tmp_path / "out", jobs=2)
    header, *rows = rows_of(tmp_path / "out")
    found = [dict(zip(header, row, strict=True)) for row in rows]
    assert [row["backend"] for row in found] == ["symbolic", "drake"]
    assert [(row["success"], row["good"], row["total"]) for row in found] == [("true", "4", "4")] * 2
