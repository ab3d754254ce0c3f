"""A trajectory is read as it was written, cut where it is asked to, and a broken file gets one line."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from cognitive_arch.errors import StoreError
from cognitive_arch.runlog.trajectory import Trajectory


@pytest.fixture
def trajectory() -> Trajectory:
    rng = np.random.default_rng(0)
    n, m, k = 7, 3, 2
    depths = np.zeros((n, 2))
    depths[3] = 0.001, 0.002
    return Trajectory(
        time=np.arange(n) * 0.08,
        joint_names=("elbow", "wrist", "finger"),
        limits=np.array([[-1.0, 1.0]] * m),
        joints=rng.normal(size=(n, m)),
        commands=rng.normal(size=(n, m)),
        beyond=np.zeros((n, m)),
        object_names=("Bun-top", "Ham"),
        poses=rng.normal(size=(n, k, 7)),
        pairs=(("Ham", "l_finger_a"), ("Ham", "table")),
        depths=depths,
        labels=("", "graspWith(Ham,LeftHand)"),
        label=np.array([0, 0, 1, 1, 1, 0, 0], dtype=np.int32),
    )


def test_written_and_read(tmp_path: Path, trajectory: Trajectory) -> None:
    path = tmp_path / "trajectory.npz"
    trajectory.save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["trajectory.npz"]
    read = Trajectory.load(path)
    for field in fields(Trajectory):
        ours, theirs = getattr(trajectory, field.name), getattr(read, field.name)
        assert np.allclose(ours, theirs, atol=1e-6) if isinstance(ours, np.ndarray) else ours == theirs
    read.save(path)
    again = Trajectory.load(path)
    assert all(np.array_equal(getattr(read, f.name), getattr(again, f.name)) for f in fields(Trajectory))


def test_nothing_at_all(tmp_path: Path, trajectory: Trajectory) -> None:
    empty = replace(trajectory.until(-1.0), pairs=(), depths=np.zeros((0, 0)))
    empty.save(tmp_path / "t.npz")
    assert len(Trajectory.load(tmp_path / "t.npz")) == 0
    assert Trajectory.load(tmp_path / "t.npz").deepest({"Ham"}, {"table"}) == 0


def test_cut_and_asked(trajectory: Trajectory) -> None:
    assert len(trajectory.until(0.17)) == 3
    assert trajectory.deepest({"Ham"}, {"table"}) == 0.002
    assert trajectory.deepest({"table"}, {"Ham", "Bun-top"}) == 0.002
    assert trajectory.deepest({"table"}, {"Bun-top"}) == 0
    assert trajectory.until(0.17).deepest({"Ham"}, {"table", "l_finger_a"}) == 0


def test_unreadable_files(tmp_path: Path, trajectory: Trajectory) -> None:
    path = tmp_path / "trajectory.npz"
    with pytest.raises(StoreError, match="there is no trajectory"):
        Trajectory.load(path)
    trajectory.save(path)
    whole = path.read_bytes()
    pickled = {"format": np.int32(1), "time": np.array([{}], dtype=object)}
    for write in (
        lambda: path.write_bytes(b""),
        lambda: path.write_bytes(b"no archive at all"),
        lambda: path.write_bytes(whole[: len(whole) // 2]),
        lambda: np.savez(path, format=np.int32(99)),
        lambda: np.savez(path, format=np.int32(1)),
        lambda: np.savez(path, **pickled),  # type: ignore[arg-type]
        lambda: replace(trajectory, poses=trajectory.poses[:3]).save(path),
        lambda: replace(trajectory, label=trajectory.label + 1).save(path),
    ):
        write()
        with pytest.raises(StoreError, match="cannot read the trajectory") as error:
            Trajectory.load(path)
        assert len(str(error.value).splitlines()) == 1
