"""The robot's own trials that come with the project."""

from __future__ import annotations

import numpy as np
import pytest

from cognitive_arch.affordances import answers
from cognitive_arch.affordances.explored import EXPLORED, HELD_OUT, read_explored
from cognitive_arch.affordances.trials import ACTIONS
from cognitive_arch.errors import AffordanceError


def test_the_trials_come_along_with_everything_that_was_tried() -> None:
    table = read_explored()
    assert table.source == "explored"
    assert table.has_start
    assert set(table.action) == set(range(len(ACTIONS)))
    forms = {name.split("-")[-1].lower() for name in set(table.object)}
    assert len(forms) == 8
    assert len(set(table.object)) == 3 * 7 + 1
    assert len(set(table.manipulator[table.kind == "tool"])) >= 8
    assert set(table.manipulator[table.kind == "hand"]) == {"straight", "bent", "arched"}
    assert np.isfinite(np.hstack([table.shape_m, table.shape_h, table.shape_o])).all()


def test_names_choose_hands_or_tools() -> None:
    sizes = {name: len(answers.load_table(name, None)) for name in EXPLORED}
    assert sizes["explored"] == sizes["explored-hand"] + sizes["explored-tool"]
    with pytest.raises(AffordanceError, match="unknown exploration 'explored-foot'"):
        read_explored("explored-foot")


def test_the_eighth_object_can_be_kept_for_testing() -> None:
    seven, eighth = read_explored("explored-seven"), read_explored("explored-eighth")
    assert set(eighth.object) == {HELD_OUT}
    assert HELD_OUT not in set(seven.object)
    assert len(eighth) / (len(seven) + len(eighth)) == pytest.approx(690 / 2353, abs=0.06)


def explained(effect: np.ndarray, names: np.ndarray) -> float:
    """How much of the variance of `effect` (n,) is between things of different `names` (n,), 0..1."""
    means = {name: effect[names == name].mean() for name in np.unique(names)}
    return float(np.var([means[name] for name in names]) / np.var(effect))


def test_effects_are_those_of_the_actions() -> None:
    """What the robot found out agrees with what everyone knows."""
    table = read_explored()

    def some(action: str, *manipulators: str) -> np.ndarray:
        rows = table.action == ACTIONS.index(action)
        if manipulators:
            rows = rows & np.isin(table.manipulator, manipulators)
        return np.asarray(table.effect[rows])

    assert np.median(some("push")[:, 0]) < -0.025
    assert np.median(some("tapFromLeft")[:, 1]) > 0.025
    assert np.median(some("tapFromRight")[:, 1]) < -0.025
    assert (some("pull", "Rake", "Wide-rake", "Hook-left", "Hook-right")[:, 0] > 0.025).mean() > 0.8
    assert (some("pull", "Stick", "Short-stick", "Thick-stick", "straight")[:, 0] > 0.025).mean() < 0.1


@pytest.mark.parametrize(
    ("thing", "axis", "action"),
    [
        ("object", 1, "tapFromLeft"),
        ("object", 1, "tapFromRight"),
        ("object", 0, "push"),
        ("manipulator", 1, "tapFromLeft"),
        ("manipulator", 1, "tapFromRight"),
        ("manipulator", 0, "pull"),
    ],
)
def test_how_far_things_go_depends_on_what_they_are(thing: str, axis: int, action: str) -> None:
    """More than names given at random explain: else nothing could be learned of shapes."""
    table = read_explored("explored-tool")
    rows = table.action == ACTIONS.index(action)
    effect = table.effect[rows, axis].clip(-0.09, 0.09)
    names = getattr(table, thing)[rows]
    rng = np.random.default_rng(0)
    by_chance = [explained(effect, rng.permutation(names)) for _ in range(200)]
    assert explained(effect, names) > 2 * max(by_chance)
