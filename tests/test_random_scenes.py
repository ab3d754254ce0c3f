"""Laws of scenes made from a seed."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cognitive_arch.domain import domain_names, load_domain
from cognitive_arch.errors import ConfigError
from cognitive_arch.execution.backends import make_environment
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.footprint import footprint, smallest_gap
from cognitive_arch.random_scenes import ROOM, random_scene
from cognitive_arch.relational.parser import load_rules
from cognitive_arch.scenes import load_scene

EDGE_X, EDGE_Y = (-0.85, -0.15), (-0.45, 0.45)  # m, of the table in Drake


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(domain_names()), st.integers(0, 2**40), st.data())
def test_the_laws(name: str, seed: int, data: st.DataObject) -> None:
    domain = load_domain(name)
    things = [n for n, spec in domain.objects.items() if spec.kind == "object"]
    number = data.draw(st.none() | st.integers(1, len(things)))
    scene = random_scene(domain, seed, number)
    assert scene == random_scene(domain, seed, number)
    assert len(set(scene.objects) & set(things)) == (number or len(things))
    assert set(domain.objects) - set(things) <= set(scene.objects)  # all tools
    covered = {
        n: footprint(domain.objects[n].shape, place.position, place.yaw) for n, place in scene.objects.items()
    }
    for a, b in itertools.combinations(covered, 2):
        assert smallest_gap(covered[a], covered[b]) >= ROOM, (a, b)
    for capsule in itertools.chain(*covered.values()):
        for x, y in (capsule.a, capsule.b):
            assert EDGE_X[0] <= x - capsule.radius <= x + capsule.radius <= EDGE_X[1]
            assert EDGE_Y[0] <= y - capsule.radius <= y + capsule.radius <= EDGE_Y[1]


def test_other_seeds_are_other_scenes() -> None:
    domain = load_domain("toys")
    assert len({str(random_scene(domain, seed).objects) for seed in range(50)}) == 50


def test_by_name() -> None:
    assert load_scene("random:7") == random_scene(load_domain("sandwich"), 7)
    assert load_scene("random:7:toys:3") == random_scene(load_domain("toys"), 7, 3)
    names = {load_scene(text).name for text in ("random:7", "random:8", "random:7:toys", "random:7:toys:3")}
    assert len(names) == 4


@pytest.mark.parametrize(
    ("name", "valid"),
    [
        ("random", "random:SEED"),
        ("random:x", "random:SEED"),
        ("random:-1", "random:SEED"),
        ("random:1:cake", "sandwich, toys"),
        ("random:1:toys:0", "1 to 7"),
        ("random:1:toys:8", "1 to 7"),
        ("ramdom:1", "random:SEED"),
    ],
)
def test_bad_names_say_what_is_valid(name: str, valid: str, cogarch: Any) -> None:
    with pytest.raises(ConfigError, match=valid):
        load_scene(name)
    answer = cogarch("parse", "take the rake", "--scene", name)
    assert (answer.code, answer.out) == (2, "")
    assert valid in answer.err
    assert answer.err.count("\n") == 1


@pytest.mark.parametrize("backend", ["symbolic", "drake"])
@pytest.mark.parametrize("name", ["random:3", "random:4:toys"])
def test_both_worlds_are_as_the_scene_says(backend: str, name: str) -> None:
    scene = load_scene(name)
    domain = load_domain(scene.domain)
    environment = make_environment(backend, domain, scene, load_rules(domain.rules_path), noise=NoiseLevels())
    seen = {obj.name: obj for obj in environment.reset(0).objects}
    environment.close()
    assert set(seen) == set(scene.objects)
    for name, obj in seen.items():
        assert obj.position[:2] == pytest.approx(scene.objects[name].position, abs=0.002)
        if obj.kind == "tool":
            assert {"LeftHand", "RightHand"} & set(obj.reachable_with)


def test_a_run_on_a_random_scene_can_be_repeated(cogarch: Any) -> None:
    options = ("--scene", "random:7:toys", "--backend", "symbolic", "--json")
    answer = cogarch("run", "take the rake", *options)
    assert answer.code == 0, answer.err
    assert answer.json["scene"] == "random-7-toys"
    shown = cogarch("inspect", "latest", "--json").json
    assert shown["manifest"]["scene"] == "random:7:toys"
    assert cogarch("plan", "take the rake", *options[:2]).code == 0
