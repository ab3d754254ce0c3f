from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cognitive_arch.affordances.published import read_published
from cognitive_arch.affordances.trials import (
    EDGES,
    TrialTable,
    effect_bins,
    from_frame,
    joined,
    read_trials,
    to_frame,
    write_trials,
)
from cognitive_arch.errors import AffordanceError
from tests.affordances.synthetic import synthetic_frame


@given(st.floats(-1, 1))
def test_bins_lie_between_their_edges(effect: float) -> None:
    bin_ = int(effect_bins(np.array(effect)))
    assert bin_ == sum(effect >= edge for edge in EDGES)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz"])
def test_a_table_survives_its_file(trials: TrialTable, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"trials{suffix}"
    write_trials(trials, path)
    again = read_trials(path)
    assert again.names_m == trials.names_m
    assert (again.object == trials.object).all()
    assert (again.action == trials.action).all()
    np.testing.assert_allclose(again.effect, trials.effect, atol=1e-12)
    np.testing.assert_allclose(again.shape_o, trials.shape_o, atol=1e-12)
    assert (again.kind == "tool").all()


def test_effects_may_be_given_without_places(trials: TrialTable) -> None:
    frame = to_frame(trials).drop(columns=["x0", "y0", "x1", "y1"])
    frame = frame.assign(effect_x=trials.effect[:, 0], effect_y=trials.effect[:, 1])
    table = from_frame(frame, "f")
    assert not table.has_start
    np.testing.assert_array_equal(table.bins, trials.bins)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.drop(columns="action"), "lacks the columns action"),
        (lambda f: f.drop(columns="y1"), "lacks the columns y1"),
        (lambda f: f.drop(columns=["x0", "x1", "y0", "y1"]), "effect_x, effect_y"),
        (lambda f: f[[c for c in f.columns if not c.startswith("m_")]], r"m_\* \(descriptors\)"),
        (lambda f: f.iloc[:0], "holds no trials"),
        (lambda f: f.assign(x1=np.nan), "column x1 has no finite number in 400 rows"),
        (lambda f: f.assign(o_convexity=np.inf), "column o_convexity has no finite number"),
        (lambda f: f.assign(m_convexity="round"), "column m_convexity holds 'round'"),
        (lambda f: f.assign(action="poke"), "unknown action 'poke'.*valid: pull, push"),
        (lambda f: f.assign(x1=f.x0, y1=f.y0), "all 400 trials have the same effect"),
        (lambda f: f.assign(kind="foot"), "unknown kind 'foot'"),
        (lambda f: f.assign(trial=0.5), "column trial holds other than whole numbers"),
    ],
)
def test_bad_tables_are_refused_in_one_line(change, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(AffordanceError, match=message) as caught:
        from_frame(change(synthetic_frame()), "bad.csv")
    assert "\n" not in str(caught.value)
    assert "bad.csv" in str(caught.value)


@pytest.mark.parametrize("name", ["empty.csv", "noise.npz", "noise.parquet", "trials.txt", "absent.csv"])
def test_bad_files_are_refused_in_one_line(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name != "absent.csv":
        path.write_bytes(b"" if name == "empty.csv" else b"\x00\xffnoise")
    with pytest.raises(AffordanceError) as caught:
        read_trials(path)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


def test_missing_descriptors_are_allowed_on_demand() -> None:
    frame = synthetic_frame()
    frame.loc[3, "m_convexity"] = np.nan
    with pytest.raises(AffordanceError, match="m_convexity"):
        from_frame(frame, "f")
    assert np.isnan(from_frame(frame, "f", allow_missing=True).shape_m[3, 0])


def test_joined_trials_keep_apart(trials: TrialTable) -> None:
    both = joined([trials, trials])
    assert len(np.unique(both.trial)) == 2 * len(np.unique(trials.trial))


def test_published_tables(published: Path) -> None:
    sizes = {name: len(read_published(published, name)) for name in ("hand", "tool", "icub_tools")}
    assert sizes == {"hand": 196, "tool": 195, "icub_tools": 922}
    grown = read_published(published, "hand").augmented()
    assert len(grown) > 100 * 196
    assert len(np.unique(grown.trial)) == 196
    pairs = read_published(published, "tools_2016")
    assert len(pairs) == 20_000
    assert len(np.unique(pairs.trial)) == 200
