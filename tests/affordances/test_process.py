"""The Gaussian process of how far things go."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

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
