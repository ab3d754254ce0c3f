"""The Gaussian process of how far things go."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from cognitive_arch.affordances import process
from cognitive_arch.affordances.process import ProcessCPD
from cognitive_arch.affordances.trials import ACTIONS, TrialTable, from_frame

PULL = ACTIONS.index("pull")


def sized(sizes: np.ndarray, noise: float = 0.003, seed: int = 0) -> TrialTable:
    """Trials in which things of size s (m) are pulled 2 s closer, and pushed s away."""
    import pandas as pd

    rng = np.random.default_rng(seed)
    action = np.array(["pull", "push"])[rng.integers(2, size=len(sizes))]
    x = np.where(action == "pull", 2.0, -1.0) * sizes + rng.normal(0, noise, len(sizes))
    return from_frame(
        pd.DataFrame(
            {"action": action, "m_area": rng.normal(0.5, 0.1, len(sizes)), "o_area": sizes, "o_rank": 1.0}
            | {"x0": -0.4, "y0": rng.uniform(-0.2, 0.2, len(sizes)), "x1": -0.4 + x, "y1": 0.0}
        ).assign(y1=lambda frame: frame["y0"]),
        "sizes",
    )


SIZES = np.random.default_rng(1).choice([0.005, 0.01, 0.02, 0.03, 0.04], 300)


@pytest.fixture(scope="module")
def learned() -> ProcessCPD:
    return ProcessCPD.fit(sized(SIZES), np.random.default_rng(0))


def test_sizes_in_between_are_foreseen(learned: ProcessCPD) -> None:
    """No thing of 1.5 or 3.5 cm was tried, so no tree could tell a bin for it by its like."""
    new = sized(np.repeat([0.015, 0.035], 30), seed=2)
    found = learned.marginals(new)
    assert np.allclose(found.sum(axis=2), 1)
    assert (found >= 0).all()
    right = found[:, 0].argmax(axis=1) == new.bins[:, 0]
    assert right.mean() > 0.9
    assert (found[:, 1].argmax(axis=1) == 2).all()


def test_little_is_said_of_what_is_unlike_everything(learned: ProcessCPD) -> None:
    usual = sized(np.full(20, 0.02))
    strange = replace(usual, shape_m=usual.shape_m + 50.0, shape_o=usual.shape_o + 50.0)
    near, far = (learned.marginals(table)[:, 0].max(axis=1) for table in (usual, strange))
    assert (far < near).all()


def test_actions_that_were_never_tried_have_the_effects_of_all(learned: ProcessCPD) -> None:
    table = sized(np.full(5, 0.02))
    found = learned.marginals(replace(table, action=np.full(5, ACTIONS.index("tapFromLeft"))))
    assert np.isfinite(found).all()
    assert np.allclose(found, found[0])
    assert found[0, 0].max() < 0.9


def test_the_same_trials_give_the_same_and_files_keep_it(learned: ProcessCPD) -> None:
    table = sized(SIZES)
    again = ProcessCPD.fit(table, np.random.default_rng(0))
    assert np.array_equal(again.marginals(table), learned.marginals(table))
    kept = ProcessCPD.from_json(json.loads(json.dumps(learned.to_json())))
    assert np.allclose(kept.marginals(table), learned.marginals(table), atol=2e-3)


def test_noise_is_told_from_what_shapes_do() -> None:
    quiet, loud = (
        ProcessCPD.fit(sized(SIZES, noise), np.random.default_rng(0)).found.noise[PULL, 0] ** 0.5
        for noise in (0.005, 0.03)
    )
    assert quiet == pytest.approx(0.005, rel=0.4)
    assert loud == pytest.approx(0.03, rel=0.3)


def test_one_thing_that_rolled_away_does_not_hide_the_rest(learned: ProcessCPD) -> None:
    table = sized(SIZES)
    effect, start = table.effect.copy(), table.start.copy()
    effect[np.flatnonzero(table.action == PULL)[0]] = (3.0, -2.0)
    start[np.flatnonzero(table.action == PULL)[1]] = (-9.0, 8.0)
    found = ProcessCPD.fit(replace(table, effect=effect, start=start), np.random.default_rng(0))
    test = sized(SIZES, seed=3)
    pulls = test.action == PULL
    right, before = (
        (cpd.marginals(test)[pulls, 0].argmax(axis=1) == test.bins[pulls, 0]).mean()
        for cpd in (found, learned)
    )
    assert right > before - 0.05


def test_views_of_a_trial_count_as_one(learned: ProcessCPD) -> None:
    table = sized(SIZES)
    seen_often = ProcessCPD.fit(table.take(np.repeat(np.arange(len(table)), 20)), np.random.default_rng(0))
    test = sized(np.linspace(0.005, 0.04, 50), seed=4)
    np.testing.assert_allclose(seen_often.marginals(test), learned.marginals(test), atol=0.02)


@pytest.mark.parametrize(("count", "most"), [(1, 0.6), (2, 0.85), (3, 0.98)])
def test_an_action_tried_once_or_twice_is_not_certain(count: int, most: float) -> None:
    """What was seen is likelier than before, but two trials that agree do not exclude the rest."""
    table = sized(SIZES)
    pulls = np.flatnonzero((table.action == PULL) & (table.bins[:, 0] == 4))[:count]
    few = table.take(np.concatenate([np.flatnonzero(table.action != PULL), pulls]))
    none = table.take(table.action != PULL)
    asked = table.take(pulls[:1])
    after, before = (
        ProcessCPD.fit(part, np.random.default_rng(0)).marginals(asked)[0, 0, 4] for part in (few, none)
    )
    assert before < after < most


def test_the_place_is_looked_at_as_told(learned: ProcessCPD) -> None:
    table = sized(SIZES)
    assert learned.with_start
    found = ProcessCPD.fit(table, np.random.default_rng(0), with_start=False)
    elsewhere = replace(table, start=table.start + 0.1)
    assert np.array_equal(found.marginals(table), found.marginals(elsewhere))


def test_evidence_is_that_of_a_multivariate_t() -> None:
    """Amplitude integrated out under its prior, against the density as scipy has it."""
    from scipy.stats import multivariate_t

    rng = np.random.default_rng(5)
    features, rest, spread = rng.normal(size=(7, 3)), rng.normal(0, 0.03, 7), 0.02**2
    roots, axes = np.linalg.eigh(features.T @ features)
    found = process._best_ratio(roots, axes.T @ (features.T @ rest), float(rest @ rest), 7, spread)
    values = {}
    for ratio in process.RATIOS:
        scale = spread / (1 + ratio) * (features @ features.T + ratio * np.eye(7))
        prior = -0.5 * (np.log(ratio) / process.RATIO_WIDTH) ** 2
        values[ratio] = multivariate_t.logpdf(rest, np.zeros(7), scale, df=process.PRIOR_TRIALS) + prior
    assert found[1] == max(values, key=lambda ratio: values[ratio])


@pytest.mark.parametrize("spread", [0.01, 0.05])
def test_amplitudes_of_few_trials_are_drawn_towards_those_of_all(spread: float) -> None:
    one = process._best_ratio(np.zeros(1), np.zeros(1), 0.03**2, 1.0, spread**2)
    many = process._best_ratio(np.zeros(1), np.zeros(1), 1000 * 0.03**2, 1000.0, spread**2)
    total_of_one, total_of_many = (ratio * amplitude for _, ratio, amplitude in (one, many))
    assert total_of_many == pytest.approx(0.03**2, rel=0.02)
    assert abs(total_of_one - spread**2) < abs(0.03**2 - spread**2)


def test_what_always_happened_the_same_is_not_certain_to_the_millimetre() -> None:
    table = sized(SIZES, noise=0.0)
    found = ProcessCPD.fit(table, np.random.default_rng(0)).found
    assert (found.noise[PULL] > process.LEAST_NOISE**2).all()  # and what is open of the mean
    pushes = ProcessCPD.fit(table, np.random.default_rng(0)).marginals(
        replace(table, shape_m=table.shape_m + 1)
    )
    assert pushes[:, 1, 2].min() > 0.9


@pytest.mark.parametrize("count", [1, 2, 3])
def test_two_trials_in_all_do_not_tell_what_comes(count: int) -> None:
    table = sized(SIZES)
    few = table.take(np.flatnonzero((table.action == PULL) & (table.bins[:, 0] == 4))[:count])
    learned = ProcessCPD.fit(few, np.random.default_rng(0))
    pushed = learned.marginals(replace(few, action=np.full(count, ACTIONS.index("push"))))
    assert pushed[:, 0, 4].max() < 0.95
    assert learned.marginals(few)[:, 0, 4].max() < 0.97


@pytest.mark.parametrize("share", [0.5, 0.6, 0.8])
def test_a_few_marked_places_are_told_apart(share: float) -> None:
    rng = np.random.default_rng(0)
    table = sized(SIZES)
    near = rng.random(len(table)) < share
    start = np.where(near[:, None], [-0.3, 0.0], [-0.5, 0.1])
    effect = np.where(near[:, None], [0.05, 0.0], [-0.05, 0.0]) + rng.normal(0, 0.003, (len(table), 2))
    table = replace(table, start=start, effect=effect)
    found = ProcessCPD.fit(table, rng).marginals(table)
    assert (found[:, 0].argmax(axis=1) == table.bins[:, 0]).mean() > 0.95


def test_places_out_of_sight_do_not_hide_where_the_rest_stood() -> None:
    table = sized(SIZES)
    start = table.start.copy()
    start[:3] = [[-9.0, 8.0], [30.0, 2.0], [5.0, -40.0]]
    effect = np.column_stack([0.3 * start[:, 1].clip(-0.2, 0.2), np.zeros(len(table))])
    table = replace(table, start=start, effect=effect)
    found = ProcessCPD.fit(table, np.random.default_rng(0)).marginals(table)
    assert (found[3:, 0].argmax(axis=1) == table.bins[3:, 0]).mean() > 0.9
