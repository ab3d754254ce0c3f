"""Rendered views to learn from, and the shipped recognisers on views that they never saw."""

from __future__ import annotations

import colorsys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cognitive_arch.domain import domain_names, load_domain
from cognitive_arch.errors import PerceptionError
from cognitive_arch.evaluation.recognition import learn_objects, score
from cognitive_arch.perception.recognition import UNKNOWN, load_recogniser
from sim.strangers import LEARNT_KINDS, OTHER_COLOR, TEST_HUES, TEST_KINDS, chromaticity, stranger
from sim.views import MIN_PIXELS, Example, examples


@pytest.fixture(scope="module")
def shown() -> list[Example]:
    return list(examples(load_domain("sandwich"), 6, np.random.default_rng(1)))


def test_every_example_shows_what_it_says(shown: list[Example]) -> None:
    assert {UNKNOWN, "Ham", "Tomato", "Stick"} <= {example.name for example in shown}
    for example in shown:
        assert example.image.shape == (*example.mask.shape, 3)
        assert example.mask.sum() >= MIN_PIXELS
        assert 0 <= example.visible <= 1
    tomatoes = [e.image[e.mask].astype(float).sum(axis=0) for e in shown if e.name == "Tomato"]
    assert all(color[0] > 2 * color[1] for color in tomatoes)


def test_same_seed_same_views(shown: list[Example]) -> None:
    again = list(examples(load_domain("sandwich"), 6, np.random.default_rng(1)))
    assert [e.name for e in again] == [e.name for e in shown]
    assert all(np.array_equal(a.image, b.image) for a, b in zip(again, shown, strict=True))


def hue(color: tuple[float, float, float]) -> float | None:
    """0..1; none for what is nearly grey."""
    value, saturation, _ = colorsys.rgb_to_hsv(*color)
    return value if saturation > 0.25 else None


def test_strangers_to_test_with_are_of_other_kinds() -> None:
    assert not set(LEARNT_KINDS) & set(TEST_KINDS)
    rng, domain = np.random.default_rng(2), load_domain("toys")
    colors = [chromaticity(spec.color) for spec in domain.objects.values()]
    learnt = [stranger(domain, rng, test=False) for _ in range(200)]
    tested = [stranger(domain, rng, test=True) for _ in range(200)]
    for made in (learnt, tested):
        far = [min(np.linalg.norm(chromaticity(t.color) - c) for c in colors) > OTHER_COLOR for t in made]
        assert 0.3 < np.mean(far) < 0.9  # the others have a colour that is known, and another shape
        hues = [hue(t.color) for t, other in zip(made, far, strict=True) if other]
        kept = [h is not None and any(low < h < high for low, high in TEST_HUES) for h in hues]
        assert all(kept) if made is tested else not any(kept)


@pytest.mark.parametrize("name", domain_names())
def test_shipped_recognisers_know_their_things_and_no_strangers(name: str) -> None:
    """Few views, to be quick; benchmarks/recognition has many."""
    tested = examples(load_domain(name), 30, np.random.default_rng(4321), test=True)
    scores = score(load_recogniser(name), tested)
    assert scores["known_right"] >= 0.97  # three of about 80 may be wrong by chance
    assert scores["unknown_right"] >= 0.90
    told = load_recogniser(name).told["test"]  # 200 views
    assert told["known_right"] >= 0.99
    assert told["unknown_right"] >= 0.90


def test_learning_again(tmp_path: Path) -> None:
    told: list[str] = []
    made = learn_objects("toys", 20, 3, tmp_path / "r.npz", told.append)
    assert made["objects"] == sorted(load_domain("toys").objects)
    assert made["known_right"] > 0.6  # from a handful of views
    assert len(told) == 4


@pytest.mark.parametrize(
    ("change", "message"),
    [({"views": 1}, "valid: 20 to 20000"), ({"out": Path("nowhere/at/all.npz")}, "folder that exists")],
)
def test_what_cannot_be_learnt(change: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"domain_name": "toys", "views": 20, "seed": 0, "out": None}
    with pytest.raises(PerceptionError, match=message):
        learn_objects(**(arguments | change), progress=print)


def test_learn_on_the_command_line(cogarch: Any) -> None:
    answer = cogarch("learn", "objects", "--domain", "kitchenware", "--json")
    assert answer.code == 2
    assert "valid: sandwich, toys" in answer.err
