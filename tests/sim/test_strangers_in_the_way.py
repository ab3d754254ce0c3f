"""What the robot sees and does not know is in its way, though nothing can be done with it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import sim.environment
from cognitive_arch.domain import Domain, ObjectSpec, Placement, Scene, load_domain
from cognitive_arch.execution.environment import FailureReason, Outcome
from cognitive_arch.outside import OutsideEvent
from sim.environment import DrakeEnvironment
from sim.perception import Perception
from sim.sight import CameraPerception
from sim.skills.drop import free_places
from tests.conftest import action

pytestmark = pytest.mark.physics

SIZES = {"Crate": (0.09, 0.05, 0.10), "Post": (0.06, 0.06, 0.12)}  # m
SPECS = {
    "Crate": {"shape": {"type": "box", "size": SIZES["Crate"]}, "mass": 0.3, "color": (0.15, 0.35, 0.8)},
    "Post": {
        "shape": {"type": "cylinder", "radius": 0.03, "height": 0.12},
        "mass": 0.3,
        "color": (0.5, 0.1, 0.6),
    },
}
PLACES = {
    "Ham": Placement(position=(-0.36, 0.10)),
    "Bun-bottom": Placement(position=(-0.30, 0.0)),
    "Crate": Placement(position=(-0.28, 0.18), yaw=0.5),
    "Post": Placement(position=(-0.36, 0.19)),
}


def with_strangers() -> Domain:
    sandwich = load_domain("sandwich")
    more = {name: ObjectSpec.model_validate(spec) for name, spec in SPECS.items()}
    return sandwich.model_copy(update={"objects": {**sandwich.objects, **more}})


class Unsuspecting(CameraPerception):
    """Knows of the things of the sandwich only, not even which shapes others may have."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        for name in SIZES:
            del self._shapes[name]


def new_table() -> DrakeEnvironment:
    return DrakeEnvironment(with_strangers(), Scene(name="strangers", domain="sandwich", objects=PLACES))


@pytest.fixture(scope="module")
def table() -> Iterator[DrakeEnvironment]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sim.environment, "CameraPerception", Unsuspecting)
        environment = new_table()
        yield environment
        environment.close()


@pytest.fixture
def visited(table: DrakeEnvironment) -> DrakeEnvironment:
    table.reset(0)
    return table


def moved(environment: DrakeEnvironment, name: str) -> float:
    """How far (m) something is from where it stood."""
    return math.dist(environment.world.pose(name).translation()[:2], PLACES[name].position)


def test_strangers_are_boxes_around_what_is_seen(visited: DrakeEnvironment) -> None:
    perception = visited.robot.perception
    strangers = list(perception.strangers().values())
    assert perception.names() == ("Bun-bottom", "Ham")
    assert len(strangers) == len(SIZES)
    for name, size in SIZES.items():
        truth = visited.world.pose(name).translation()
        one = min(strangers, key=lambda s: math.dist(s.pose[:2, 3], truth[:2]))
        assert one.pose[:3, 3] == pytest.approx(truth, abs=0.006)
        assert sorted(one.shape.size) == pytest.approx(sorted(size), abs=0.009)


def test_a_sweep_into_a_stranger_is_refused(
    visited: DrakeEnvironment, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = visited.execute(action("tapFromLeft(Ham,RightHand)"))
    assert result.reason is FailureReason.BLOCKED
    assert max(moved(visited, name) for name in PLACES) < 0.002
    # Were strangers nothing to the robot, it would run into them.
    monkeypatch.setattr(CameraPerception, "strangers", Perception.strangers)
    assert visited.execute(action("tapFromLeft(Ham,RightHand)")).reason is not FailureReason.BLOCKED
    assert max(moved(visited, name) for name in SIZES) > 0.005


def test_it_takes_what_stands_beside_them_and_puts_it_elsewhere(visited: DrakeEnvironment) -> None:
    assert visited.execute(action("graspWith(Ham,RightHand)")).outcome is Outcome.SUCCESS
    for x, y in free_places(visited.robot, "Ham", "RightHand"):
        assert all(math.dist((x, y), PLACES[name].position) > 0.08 for name in SIZES)
    assert visited.execute(action("dropWith(Ham,RightHand)")).outcome is Outcome.SUCCESS
    assert max(moved(visited, name) for name in SIZES) < 0.002


def test_they_are_kept_and_forgotten_when_they_go(visited: DrakeEnvironment) -> None:
    perception = visited.robot.perception
    before = perception.strangers()
    again = new_table()
    again.restore(json.loads(json.dumps(visited.save())))
    restored = again.robot.perception.strangers()
    assert [one.shape for one in restored.values()] == [one.shape for one in before.values()]
    assert all(np.array_equal(restored[name].pose, one.pose) for name, one in before.items())
    visited.disturb(OutsideEvent.parse("1:remove:Post"))
    visited.observe()
    (left,) = perception.strangers().values()
    assert left.pose[:2, 3] == pytest.approx(PLACES["Crate"].position, abs=0.006)
