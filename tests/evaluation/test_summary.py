"""Intervals and comparisons against known values; figures and page."""

from __future__ import annotations

import itertools
import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from cognitive_arch.errors import SweepError
from cognitive_arch.evaluation.bounds import Learner, Steps, Task, omniscient_cost, steps_of
from cognitive_arch.evaluation.figures import LOOKS
from cognitive_arch.evaluation.results import read_rows, write_results
from cognitive_arch.evaluation.running import run_sweep
from cognitive_arch.evaluation.summary import bootstrap, compare, cost_by_help, mcnemar, summarise, wilson
from cognitive_arch.evaluation.sweep import NOISE, SweepConfig
from cognitive_arch.execution.noise import NoiseLevels


@given(st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson(counts: tuple[int, int]) -> None:
    successes, n = counts
    expected = stats.binomtest(successes, n).proportion_ci(method="wilson")
    assert wilson(successes, n) == pytest.approx((expected.low, expected.high), abs=1e-9)


@given(st.integers(0, 40), st.integers(0, 40))
def test_mcnemar(only_a: int, only_b: int) -> None:
    n = only_a + only_b
    expected = stats.binomtest(only_a, n, 0.5).pvalue if n else 1.0
    assert mcnemar(only_a, only_b) == pytest.approx(expected)


def test_bootstrap_is_seeded_and_about_right() -> None:
    values = np.random.default_rng(3).normal(0.5, 0.1, 400)
    low, high = bootstrap(values, 1)
    assert (low, high) == bootstrap(values, 1)
    half = 1.96 * values.std() / 20
    assert low == pytest.approx(values.mean() - half, abs=0.002)
    assert high == pytest.approx(values.mean() + half, abs=0.002)


def rows() -> pd.DataFrame:
    """Ten pairs: `none` always succeeds with 10 actions, `adaptability` in four of ten, with 5."""
    base = {
        "scene": "simple", "backend": "symbolic", "planner": "a-prada", "vary": "both", "noise": 0.5,
        "left": 0.5, "right": 0.5, "pull": 0.5, "push": 0.5, "good": 4, "reason": "", "wall_s": 0.1,
    }  # fmt: skip
    lines = []
    for n in range(10):
        same = base | {"episode": n, "seed": 100 + n}
        lines.append(same | {"heuristics": "none", "success": True, "total": 10, "speed": 0.8})
        lines.append(same | {"heuristics": "adaptability", "success": n < 4, "total": 5, "speed": 0.9})
    return pd.DataFrame(lines)


def test_summary_and_pairs() -> None:
    summary = summarise(rows()).set_index("heuristics")
    assert summary.loc["none", ["success", "speed", "cost"]].tolist() == pytest.approx([1.0, 0.8, 10.0])
    assert summary.loc["adaptability", "cost"] == pytest.approx(5 + 0.6 * 20)
    assert summary.loc["adaptability", "success_low"] < 0.4 < summary.loc["adaptability", "success_high"]
    (pair,) = compare(rows()).to_dict("records")
    assert (pair["a"], pair["b"], pair["pairs"]) == ("none", "adaptability", 10)
    assert (pair["only_a"], pair["only_b"]) == (6, 0)
    assert pair["success_p"] == pytest.approx(2 / 2**6)
    assert pair["speed_difference"] == pytest.approx(-0.1)
    assert pair["cost_difference"] == pytest.approx(10 - 17)


def test_pairs_do_not_hang_on_the_order_of_rows() -> None:
    mixed = rows().sample(frac=1, random_state=1)
    one, other = (compare(r).iloc[0] for r in (rows(), mixed))
    assert {one["only_a"], one["only_b"]} == {other["only_a"], other["only_b"]}


def test_cost_against_the_price_of_help() -> None:
    table = cost_by_help(rows(), (5, 50))
    assert table["none"].tolist() == [10, 10]
    assert table["adaptability"].tolist() == pytest.approx([8, 35])


def test_what_somebody_who_knew_the_noise_would_pay() -> None:
    assert omniscient_cost("simple", NoiseLevels(0.5, 0.5, 0.5, 0.5), quiet_release=True) == pytest.approx(6)
    assert omniscient_cost("simple", NoiseLevels(0.95, 0.25), quiet_release=True) == pytest.approx(
        2 + 2 / 0.75
    )
    assert omniscient_cost("simple", NoiseLevels(1, 1, 1, 1), quiet_release=True) == 20
    assert omniscient_cost("complex", NoiseLevels(), quiet_release=False) == pytest.approx(7)


EQUAL = [NoiseLevels(level, level, level, level) for level in NOISE]
KNOWING = [min(2 + 2 / (1 - level), 20) for level in NOISE]


@pytest.fixture(scope="module")
def steps() -> Steps:
    return steps_of(Task("simple", quiet_release=True))


def test_steps_lead_to_the_goal_and_never_back(steps: Steps) -> None:
    assert len(steps) == 12
    assert steps.count(None) == 1
    reached: set[int] = set()

    def visit(state: int, path: tuple[int, ...]) -> None:
        assert state not in path
        reached.add(state)
        for step in steps[state] or ():
            visit(step.after, (*path, state))

    visit(0, ())
    assert reached == set(range(12))


def test_who_has_to_learn_the_noise_pays_more_than_who_knows_it(steps: Steps) -> None:
    learner = Learner(steps, EQUAL)
    ratio, mean = learner.least_ratio(KNOWING), learner.least_mean()
    assert 1.1 < ratio.least < 1.4
    assert max(c / k for c, k in zip(ratio.costs, KNOWING, strict=True)) == pytest.approx(ratio.least)
    assert np.mean(mean.costs) == pytest.approx(mean.least)
    assert np.mean(KNOWING) < mean.least <= np.mean(ratio.costs)


@pytest.mark.parametrize("n", range(len(NOISE)))
def test_with_one_level_there_is_nothing_to_learn(steps: Steps, n: int) -> None:
    """Then a policy pays what one that knows the level pays, however early it is told."""
    for failures in (0, 3):
        learner = Learner(steps, EQUAL[n : n + 1], failures=failures)
        assert learner.least_mean().least == pytest.approx(KNOWING[n])
        assert learner.least_ratio([KNOWING[n]]).least == pytest.approx(1)


def test_the_least_mean_is_what_looking_ahead_finds(steps: Steps) -> None:
    """By another way: dynamic programming over what is believed, all levels being as likely beforehand.

    Both takes come first: the two puts never fail, and would be in vain if help were asked for in the end.
    """

    @lru_cache(None)
    def expected(takes: int, failed: int) -> float:
        if takes == 0 or failed > 60:
            return 2.0 if takes == 0 else 20.0
        likely = [(1 - level) ** (2 - takes) * level**failed for level in NOISE]
        works = sum(w * (1 - level) for w, level in zip(likely, NOISE, strict=True)) / sum(likely)
        on = 1 + works * expected(takes - 1, failed) + (1 - works) * expected(takes, failed + 1)
        return min(on, 20.0)

    least = Learner(steps, EQUAL, failures=30).least_mean().least
    assert least == pytest.approx(expected(2, 0), rel=1e-4)


def test_the_later_the_levels_are_told_the_dearer(steps: Steps) -> None:
    least = [Learner(steps, EQUAL, failures=n).least_mean().least for n in (0, 2, 6, 13, 15)]
    assert least[0] == pytest.approx(np.mean(KNOWING))
    assert all(b > a - 1e-9 for a, b in itertools.pairwise(least))
    assert least[3] == pytest.approx(least[4], rel=2e-3)


def test_to_succeed_and_to_pay_nothing_more_without_noise_has_its_price(steps: Steps) -> None:
    learner = Learner(steps, [*EQUAL, *(NoiseLevels(level, 0.25) for level in NOISE)])
    free, bound = learner.least_mean(), learner.least_mean({5: 4.0}, {3: 0.97})
    assert free.costs[5] > 4.1  # it begins with the arm that is never bad
    assert free.success[3] < 0.9
    assert bound.costs[5] == pytest.approx(4)
    assert bound.success[3] >= 0.97 - 1e-6
    assert bound.least > free.least
    with pytest.raises(SweepError, match="cannot be computed"):
        learner.least_mean({0: 3.0})


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished") / "out"
    run_sweep(SweepConfig(noise=(0.0, 0.9), episodes=2, heuristics=(*LOOKS,)), folder, "cogarch sweep <x>")
    return folder


def test_the_results_of_a_sweep(finished: Path) -> None:
    results = write_results(finished)
    names = {str(path.relative_to(finished)) for path in results.files}
    assert {
        "rows.parquet",
        "summary.csv",
        "comparisons.csv",
        "index.html",
        "figures/simple-both.svg",
    } <= names
    pd.testing.assert_frame_equal(pd.read_parquet(finished / "rows.parquet"), read_rows(finished))
    assert len(pd.read_csv(finished / "summary.csv")) == 5 * 2
    assert len(pd.read_csv(finished / "comparisons.csv")) == 10 * 2
    text = (finished / "index.html").read_text()
    assert text.count("<svg") == 2
    assert "cogarch sweep &lt;x&gt;" in text
    assert "http://" not in text.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
        "http://creativecommons.org", ""
    )


def test_the_same_rows_give_the_same_files(finished: Path) -> None:
    first = {path: path.read_bytes() for path in write_results(finished).files}
    assert {path: path.read_bytes() for path in write_results(finished).files} == first


def test_another_sweep_beside(finished: Path, tmp_path: Path) -> None:
    """As if its rows were those of physics: the figure has a row of panels for each."""
    for path in ("sweep.json", "rows.csv"):
        text = (finished / path).read_text()
        (tmp_path / path).write_text(text.replace(",symbolic,", ",drake,"))
    alone = (finished / "figures" / "simple-both.svg").read_text()
    results = write_results(finished, [tmp_path])
    both = (finished / "figures" / "simple-both.svg").read_text()
    assert both.count("axes_") > alone.count("axes_")
    assert ">(a) drake<" in both
    assert set(results.rows["backend"]) == {"symbolic"}


def test_the_verb_answers_in_json(cogarch: Any, tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    options = ["--noise", "0", "--heuristics", "none,reliability", "--episodes", "2", "--json"]
    answer = cogarch("sweep", "--out", out, *options)
    assert answer.code == 0
    assert (answer.json["episodes"], answer.json["resumed_at"]) == (4, 0)
    assert [line["total"] for line in answer.json["summary"]] == [4, 4]
    assert cogarch("sweep", "--out", out, *options).json["resumed_at"] == 4
    manifest = json.loads((tmp_path / "out" / "sweep.json").read_text())
    assert manifest["command"].startswith(f"cogarch sweep --out {out} --noise 0")
    shown = cogarch("sweep", "--out", out, *options[:-1])
    assert "reliability" in shown.out
    assert "index.html" in shown.out


def test_a_folder_without_a_sweep(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match="holds no sweep"):
        write_results(tmp_path)
