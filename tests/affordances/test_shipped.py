"""What comes along as learned: it is of the trials that come along, and knows what pulls."""

from __future__ import annotations

import numpy as np
import pytest

from cognitive_arch.affordances.explored import read_explored
from cognitive_arch.affordances.judgement import Judge, described_names
from cognitive_arch.perception.top_view import described
from cognitive_arch.resources import learned_affordances
from cognitive_arch.shapes import Cylinder, ToolShape

HAM = described(Cylinder(type="cylinder", radius=0.028, height=0.010))[0]
HAM_PLACE = (-0.518, -0.061)
TOOLS = {
    "stick": ToolShape(type="tool", length=0.34, width=0.018, bar=0.0),
    "thin stick": ToolShape(type="tool", length=0.30, width=0.014, bar=0.0),
    "rake": ToolShape(type="tool", length=0.34, width=0.018, bar=0.14),
    "wide rake": ToolShape(type="tool", length=0.36, width=0.020, bar=0.17),
    "hook": ToolShape(type="tool", length=0.33, width=0.020, bar=0.10, offset=0.04),
    "hook to the left": ToolShape(type="tool", length=0.33, width=0.020, bar=0.10, offset=-0.04),
}


@pytest.fixture(scope="module")
def judge() -> Judge:
    return Judge.load(learned_affordances())


def chance(judge: Judge, action: str, tool: str) -> float:
    halves = described(TOOLS[tool])[1]
    question = judge.question(action, halves, HAM, HAM_PLACE)
    return judge.chances([question])[question]


def test_it_was_learned_from_the_trials_that_come_along(judge: Judge) -> None:
    table = read_explored()
    assert judge.learned.trials == len(np.unique(table.trial))
    assert judge.learned.source == table.source
    assert set(judge.learned.things_m) == set(map(str, table.manipulator))
    assert set(judge.learned.names_m) <= set(described_names())


@pytest.mark.parametrize("tool", TOOLS)
def test_bars_pull_and_sticks_do_not_be_they_known_or_not(judge: Judge, tool: str) -> None:
    if "stick" in tool:
        assert chance(judge, "pull", tool) < 0.3
    else:
        assert chance(judge, "pull", tool) > 0.7
    assert chance(judge, "push", tool) > 0.7
