"""Shapes of things, what they cover of the table, and the points that keep others away."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter, ValidationError

from cognitive_arch.domain import ObjectSpec, jittered, load_domain
from cognitive_arch.execution.placing import CLEARANCE, nearest_free
from cognitive_arch.execution.placing import footprint as points
from cognitive_arch.footprint import footprint, gap, outer_radius, smallest_gap
from cognitive_arch.scenes import load_scene
from cognitive_arch.shapes import Shape

STUD = {"solid": {"type": "cylinder", "radius": 0.005, "height": 0.004}, "place": [0.02, 0.0], "above": 0.02}
BODY = {"solid": {"type": "box", "size": [0.06, 0.03, 0.02]}}


def shape(**fields: object) -> Shape:
    made: Shape = TypeAdapter(Shape).validate_python(fields)
    return made


def test_a_compound_is_as_large_as_its_parts_together() -> None:
    brick = shape(type="compound", parts=[BODY, STUD])
    assert brick.height == pytest.approx(0.024)
    assert brick.extent == pytest.approx((0.06, 0.03))
    assert not brick.is_round
    assert not brick.rolls
    off = shape(type="compound", parts=[BODY, STUD | {"place": [0.04, 0.0]}])
    assert off.extent == pytest.approx((0.09, 0.03))  # about the middle: the far side counts, too


def test_only_parts_about_the_middle_make_a_round_thing() -> None:
    ball = {"solid": {"type": "sphere", "radius": 0.02}}
    assert shape(type="compound", parts=[ball]).is_round
    assert not shape(type="compound", parts=[ball | {"place": [0.0, 0.001]}]).is_round
    assert shape(type="compound", parts=[ball]).rolls


@pytest.mark.parametrize(
    ("fields", "wrong"),
    [
        ({"type": "compound", "parts": []}, "at least 1"),
        ({"type": "compound", "parts": [STUD]}, "at the underside"),
        ({"type": "compound", "parts": [{"solid": {"type": "tool"}}]}, "'cylinder', 'box', 'sphere'"),
        ({"type": "pear"}, "'compound', 'tool'"),
    ],
)
def test_what_is_no_shape(fields: dict[str, object], wrong: str) -> None:
    with pytest.raises(ValidationError, match=wrong):
        shape(**fields)


def test_a_box_covers_its_corners_and_a_round_thing_no_more_than_itself() -> None:
    box = shape(type="box", size=[0.06, 0.08, 0.02])
    assert outer_radius(box) == pytest.approx(0.05)
    assert outer_radius(shape(type="sphere", radius=0.03)) == 0.03
    (here,) = footprint(box, (0.0, 0.0))
    (there,) = footprint(box, (0.12, 0.0), yaw=1.0)
    assert gap(here, there) == pytest.approx(0.02)


def test_what_is_large_keeps_others_farther_away() -> None:
    small, large = (shape(type="box", size=[side, side, 0.02]) for side in (0.05, 0.12))
    assert points(small, 0.3) == ((0.0, 0.0),)
    assert {(round(x, 6), round(y, 6)) for x, y in points(large, 0.0)} == {
        (x, y) for x in (-0.03, 0.03) for y in (-0.03, 0.03)
    }
    place = nearest_free((-0.4, 0.0), [(-0.4, 0.0)], points(large, 0.0))
    assert math.dist(place, (-0.4, 0.0)) > CLEARANCE + 0.02


def test_toys_come_in_every_shape() -> None:
    toys = load_domain("toys")
    kinds = {spec.shape.type for spec in toys.objects.values()}
    assert kinds == {"box", "sphere", "compound", "tool"}
    assert {name for name, spec in toys.objects.items() if spec.shape.rolls} == {
        "Red-ball",
        "Blue-ball",
        "Pear",
    }
    for name, spec in toys.objects.items():  # all of them fit between the fingers
        width = spec.shape.width if spec.shape.type == "tool" else min(spec.shape.extent)
        assert width <= 0.09, name


def test_a_tool_has_the_shape_of_one() -> None:
    made = {"kind": "tool", "mass": 0.1, "color": [0, 0, 0], "shape": {"type": "sphere", "radius": 0.02}}
    with pytest.raises(ValidationError, match="needs a shape of type tool, this is a sphere"):
        ObjectSpec.model_validate(made)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32))
def test_jitter_never_pushes_things_into_each_other(seed: int) -> None:
    scene, toys = load_scene("boxes"), load_domain("toys")
    moved = jittered(scene, 0.05, np.random.default_rng(seed), toys)
    covered = [footprint(toys.objects[n].shape, place.position) for n, place in moved.items()]
    for a, b in itertools.combinations(covered, 2):
        assert smallest_gap(a, b) > 0.0099
