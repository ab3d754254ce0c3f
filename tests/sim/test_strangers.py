"""A thing that the robot never saw is found by its shape, and used by what its shape is good for."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from cognitive_arch.execution.environment import Outcome
from cognitive_arch.perception.descriptors import DEFAULT, FORMULAS
from cognitive_arch.perception.top_view import described
from cognitive_arch.scenes import domain_of, load_scene
from cognitive_arch.world.anchoring import WorldModel
from sim.environment import DrakeEnvironment
from sim.sight import CameraPerception
from tests.conftest import action

pytestmark = pytest.mark.physics

NAMES = FORMULAS[DEFAULT].names
TELLING = ("area", "convexity", "compactness", "circularity", "squareness")


@pytest.fixture(scope="module")
def stranger() -> Iterator[DrakeEnvironment]:
    scene = load_scene("stranger")
    environment = DrakeEnvironment(domain_of(scene), scene)
    environment.reset(0)
    yield environment
    environment.close()


def test_the_recogniser_has_never_heard_of_it(stranger: DrakeEnvironment) -> None:
    perception = stranger.robot.perception
    assert isinstance(perception, CameraPerception)
    image = perception.image
    assert image is not None
    sighting = next(s for s in perception.sightings if s.label == "Crook")
    named = dict(perception._classify(image.color, sighting.region.mask))
    assert "Crook" not in named
    assert max(named, key=lambda name: named[name]) == "unknown"


def test_it_is_believed_to_be_where_it_is(stranger: DrakeEnvironment) -> None:
    seen = {obj.name: obj for obj in stranger.observe().objects}
    assert set(seen) == set(stranger.robot.world.scenario.objects)
    for name in seen:
        assert seen[name].position == pytest.approx(stranger.world.pose(name).translation(), abs=0.004), name


def test_its_shape_is_seen_as_it_is_from_above(stranger: DrakeEnvironment) -> None:
    """The descriptors that what was learned is asked with agree with those of the shape itself."""
    for obj in stranger.observe().objects:
        whole, halves = described(stranger.robot.domain.objects[obj.name].shape)
        parts = [(obj.desc, whole)]
        if obj.kind == "tool":
            parts.append((obj.tooldesc[: len(NAMES)], halves[: len(NAMES)]))
        for found, known in parts:
            for name in TELLING:
                place = NAMES.index(name)
                assert found[place] == pytest.approx(known[place], abs=0.06, rel=0.12), (obj.name, name)


def test_what_is_held_keeps_the_shape_it_had_on_the_table(stranger: DrakeEnvironment) -> None:
    before = {obj.name: obj.tooldesc for obj in stranger.observe().objects}
    stranger.execute(action("graspWith(Crook,RightHand)"))
    after = {obj.name: obj for obj in stranger.observe().objects}
    assert stranger.robot.perception.held("RightHand") == "Crook"
    np.testing.assert_array_equal(after["Crook"].tooldesc, before["Crook"])


def test_it_pulls(stranger: DrakeEnvironment) -> None:
    if stranger.robot.perception.held("RightHand") != "Crook":
        stranger.execute(action("graspWith(Crook,RightHand)"))
    result = stranger.execute(action("pull(Ham,Crook,RightHand)"))
    assert result.outcome is Outcome.SUCCESS
    assert result.effect["displacement_x"] > 0.08
    assert "reachableWith(Ham,LeftHand)" in {
        str(atom) for atom in WorldModel().update(stranger.observe()).atoms()
    }
