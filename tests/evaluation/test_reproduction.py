"""The registry of what can be recomputed, and the verb."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cognitive_arch.evaluation import reproduction
from cognitive_arch.evaluation.reproduction import REPRODUCTIONS, Check, Reproduced


@pytest.mark.parametrize("name", sorted(REPRODUCTIONS))
def test_every_entry_can_be_loaded(name: str) -> None:
    assert callable(REPRODUCTIONS[name].load())


def test_the_verb_lists_what_there_is(cogarch: Any) -> None:
    answer = cogarch("reproduce", "--json")
    assert answer.code == 0
    assert set(answer.json) == set(REPRODUCTIONS)


def test_an_unknown_name_lists_the_valid_ones(cogarch: Any) -> None:
    answer = cogarch("reproduce", "fig99")
    assert answer.code == 2
    assert all(name in answer.err for name in REPRODUCTIONS)
    assert len(answer.err.splitlines()) == 1


@pytest.mark.parametrize("holds", [True, False])
def test_what_does_not_agree_is_told_by_the_exit_code(
    cogarch: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, holds: bool
) -> None:
    checks = Check("speed", "0.83", "0.80", np.True_), Check("success", "1", "0", np.bool_(holds))
    found = Reproduced(checks, {"n": 3})
    monkeypatch.setattr(reproduction.Reproduction, "load", lambda self: lambda options: found)
    answer = cogarch("reproduce", "fig58", "--out", str(tmp_path), "--json")
    assert answer.code == (0 if holds else 1), answer.err
    assert answer.json["success"] is holds
    assert answer.json["n"] == 3
    assert answer.json["checks"][1] == {"what": "success", "published": "1", "ours": "0", "holds": holds}
    shown = cogarch("reproduce", "fig58", "--out", str(tmp_path))
    assert ("DIFFERS" in shown.out) is not holds


def test_what_nobody_can_reach_is_no_failure(
    cogarch: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    checks = (
        Check("speed", "1", "1", True, bound="not told where the target is met"),
        Check("cost", "at most 5 %", "20 %", False, bound="nobody stays below 18 %"),
    )
    found = Reproduced(checks)
    monkeypatch.setattr(reproduction.Reproduction, "load", lambda self: lambda options: found)
    answer = cogarch("reproduce", "reliability", "--out", str(tmp_path), "--json")
    assert (answer.code, answer.json["success"]) == (0, True)
    assert [check["holds"] for check in answer.json["checks"]] == [True, False]
    assert [check.get("bound") for check in answer.json["checks"]] == [None, "nobody stays below 18 %"]
    shown = cogarch("reproduce", "reliability", "--out", str(tmp_path)).out
    assert "BOUND    cost" in shown
    assert "nobody stays below 18 %" in shown
    assert "1 of 2 agree, 1 cannot be had by anyone" in shown
    assert "DIFFERS" not in shown


def test_a_figure_is_recomputed_with_its_checks(cogarch: Any, tmp_path: Path) -> None:
    """Three episodes a point are too few to agree in everything, but what is certain must hold."""
    answer = cogarch("reproduce", "fig58", "--episodes", "3", "--out", str(tmp_path / "fig58"), "--json")
    assert answer.code in (0, 1)
    checks = {check["what"]: check for check in answer.json["checks"]}
    assert checks["actions without noise"]["holds"]
    assert checks["actions without noise"]["ours"] == "4.00, 4.00, 4.00, 4.00 actions"
    assert len(answer.json["points"]) == 20
    assert any("3 episodes a point" in note for note in answer.json["notes"])
    for name in ("rows.csv", "rows.parquet", "summary.csv", "index.html", "figures/simple-both.png"):
        assert (tmp_path / "fig58" / name).stat().st_size > 0, name


def test_trials_are_refused_where_none_are_used(cogarch: Any, tmp_path: Path) -> None:
    found = cogarch("reproduce", "fig58", "--trials", "t.csv", "--out", str(tmp_path / "out"))
    assert (found.code, len(found.err.splitlines())) == (2, 1)
    assert "--trials is for table6" in found.err
    assert not (tmp_path / "out").exists()
