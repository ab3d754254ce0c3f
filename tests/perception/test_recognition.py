"""Recognition: features that do not mind light and view, trees as arrays, files that say what is wrong."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cognitive_arch.domain import domain_names, load_domain
from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception import recognition
from cognitive_arch.perception.appearance import FEATURES, appearance
from cognitive_arch.perception.recognition import (
    UNKNOWN,
    ObjectRecogniser,
    check_fits,
    load_recogniser,
    recogniser_path,
)
from cognitive_arch.perception.recognition_training import KNOWN_RIGHT, calibrate, describe, fit

COLORS = {"Red": (200, 40, 30), "Blue": (40, 60, 200), UNKNOWN: (60, 180, 60)}


def picture(name: str, shape: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    mask = np.zeros((60, 60), np.uint8)
    angle = float(rng.uniform(0, 180))
    if shape == "disc":
        cv2.ellipse(mask, (30, 30), (22, int(rng.integers(10, 22))), angle, 0, 360, 1, -1)
    else:
        corners = cv2.boxPoints(((30, 30), (34.0, float(rng.uniform(15, 34))), angle))
        cv2.fillConvexPoly(mask, np.rint(corners).astype(np.int32), 1)
    image = np.full((60, 60, 3), (158, 128, 97), np.uint8)
    image[mask > 0] = np.clip(np.array(COLORS[name]) * rng.uniform(0.7, 1.1), 0, 255).astype(np.uint8)
    return image, mask.astype(bool)


def pictures(count: int, seed: int) -> list[tuple[np.ndarray, np.ndarray, str]]:
    """Red discs, blue squares; green things and red squares are unknown."""
    rng, made = np.random.default_rng(seed), []
    for _ in range(count):
        for name, shape, told in (
            ("Red", "disc", "Red"),
            ("Blue", "square", "Blue"),
            (UNKNOWN, "disc", UNKNOWN),
            ("Red", "square", UNKNOWN),
        ):
            made.append((*picture(name, shape, rng), told))
    return made


@pytest.fixture(scope="module")
def recogniser() -> ObjectRecogniser:
    learnt = describe(pictures(60, 0), np.random.default_rng(1), 1)
    return fit(learnt, ["Red", "Blue"], {"command": "by hand"}, 0)


def by_name(image: np.ndarray, mask: np.ndarray) -> dict[str, float]:
    return dict(zip(FEATURES, map(float, appearance(image, mask)), strict=True))


def test_less_light_changes_nothing_but_the_brightness() -> None:
    image, mask = picture("Red", "disc", np.random.default_rng(3))
    bright, dim = by_name(image, mask), by_name((image * 0.7).astype(np.uint8), mask)
    assert dim.pop("brightness") < bright.pop("brightness") - 0.2
    for name, value in bright.items():
        assert dim[name] == pytest.approx(value, abs=0.12), name


@pytest.mark.parametrize("narrow", [12, 16, 22])
@pytest.mark.parametrize("angle", [0, 30, 75])
def test_a_slanted_disc_stays_a_disc(narrow: int, angle: int) -> None:
    y, x = np.mgrid[0:60, 0:60] - 30.0
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    mask = ((c * x + s * y) / 22) ** 2 + ((c * y - s * x) / narrow) ** 2 <= 1
    found = by_name(np.full((60, 60, 3), 100, np.uint8), mask)
    assert found["spread"] == pytest.approx(4 / 3, abs=0.03)  # of an even disc
    assert found["square"] < 0.2  # of a square 2.4
    assert found["lopsided"] < 0.05
    assert found["filling"] == pytest.approx(1.0, abs=0.02)
    assert found["roundness"] == pytest.approx(narrow / 22, abs=0.02)


def test_a_square_is_no_disc() -> None:
    mask = np.zeros((60, 60), bool)
    mask[15:45, 15:45] = True
    found = by_name(np.full((60, 60, 3), 100, np.uint8), mask)
    assert found["spread"] == pytest.approx(1.4, abs=0.02)
    assert found["square"] == pytest.approx(2.4, abs=0.05)
    assert found["squareness"] == pytest.approx(1.0, abs=0.1)


def test_round_things_have_slopes_and_flat_ones_edges() -> None:
    y, x = np.mgrid[0:60, 0:60] - 29.5
    disc = x**2 + y**2 < 25**2
    ball = np.where(disc, 200 * np.sqrt(np.maximum(0, 1 - (x**2 + y**2) / 26**2)), 0)
    tile = np.where(x > 5, 90, 200)  # two flat sides
    by_form = {}
    for name, tones in (("flat", np.full((60, 60), 200)), ("round", ball), ("edged", tile)):
        for light in (0.6, 1.0):
            image = np.repeat((tones * light).astype(np.uint8)[:, :, None], 3, axis=2)
            by_form[name, light] = by_name(image, disc)
    for light in (0.6, 1.0):
        flat, curved, edged = (by_form[name, light] for name in ("flat", "round", "edged"))
        assert flat["slope"] == flat["slope_90"] == flat["edges"] == 0
        assert curved["slope_50"] > 0.2
        assert edged["slope_50"] == 0
        assert edged["slope"] > 0.2
        assert 0.05 < edged["edges"] < 0.2
    for name in ("round", "edged"):  # brighter light changes nothing
        for feature in ("slope", "slope_50", "slope_90", "edges"):
            dim, bright = by_form[name, 0.6][feature], by_form[name, 1.0][feature]
            assert dim == pytest.approx(bright, rel=0.1, abs=0.02)


def test_where_the_region_is_in_the_image_does_not_matter() -> None:
    image, mask = picture("Blue", "square", np.random.default_rng(5))
    large, elsewhere = np.zeros((200, 300, 3), np.uint8), np.zeros((200, 300), bool)
    large[100:160, 200:260], elsewhere[100:160, 200:260] = image, mask
    assert np.allclose(appearance(large, elsewhere), appearance(image, mask), atol=1e-5)


@pytest.mark.parametrize(
    ("image", "mask", "message"),
    [
        (np.zeros((4, 4), np.uint8), np.ones((4, 4), bool), "valid: .height, width, 3. uint8"),
        (np.zeros((4, 4, 3)), np.ones((4, 4), bool), "float64"),
        (np.zeros((4, 4, 3), np.uint8), np.ones((5, 4), bool), r"\(4, 4\) bool"),
        (np.zeros((4, 4, 3), np.uint8), np.ones((4, 4), np.uint8), "bool"),
        (np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4), bool), "without a pixel"),
    ],
)
def test_what_is_no_region(image: Any, mask: Any, message: str) -> None:
    with pytest.raises(PerceptionError, match=message):
        appearance(image, mask)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_a_few_pixels_are_described_as_well(size: int) -> None:
    mask = np.zeros((5, 5), bool)
    mask[1 : 1 + size, 1] = True
    assert np.isfinite(appearance(np.full((5, 5, 3), 30, np.uint8), mask)).all()
    assert np.isfinite(appearance(np.zeros((5, 5, 3), np.uint8), mask)).all()


def test_it_tells_apart_what_it_learnt(recogniser: ObjectRecogniser) -> None:
    tested = pictures(40, 7)
    right = [recogniser.classify(image, mask)[0][0] == name for image, mask, name in tested]
    assert np.mean(right) > 0.95


def test_probabilities_add_up_and_come_in_order(recogniser: ObjectRecogniser) -> None:
    for image, mask, _ in pictures(3, 8):
        answers = recogniser.classify(image, mask)
        assert {name for name, _ in answers} == {"Red", "Blue", UNKNOWN}
        shares = [share for _, share in answers]
        assert sum(shares) == pytest.approx(1)
        assert shares == sorted(shares, reverse=True)


def test_a_colour_never_seen_is_unknown(recogniser: ObjectRecogniser) -> None:
    _, mask = picture("Red", "disc", np.random.default_rng(9))
    violet = np.full((60, 60, 3), (150, 40, 150), np.uint8)
    assert recogniser.classify(violet, mask)[0][0] == UNKNOWN


def test_the_arrays_say_what_the_trees_said() -> None:
    from sklearn.ensemble import HistGradientBoostingClassifier

    from cognitive_arch.perception.recognition_training import DEPTH, _forest

    rng = np.random.default_rng(0)
    x = rng.normal(size=(600, 5)).astype(np.float32)
    y = (x[:, 0] > 0).astype(int) + (x[:, 1] * x[:, 2] > 0.3)
    trees = HistGradientBoostingClassifier(
        max_iter=20, max_depth=DEPTH, l2_regularization=1.0, early_stopping=False
    ).fit(x, y)
    forest = _forest(trees)
    assert np.allclose([forest.scores(row) for row in x[:50]], trees.decision_function(x[:50]), atol=1e-4)


def test_same_examples_same_recogniser(recogniser: ObjectRecogniser, tmp_path: Path) -> None:
    again = fit(describe(pictures(60, 0), np.random.default_rng(1), 1), ["Blue", "Red"], recogniser.told, 0)
    for one, name in ((recogniser, "one.npz"), (again, "two.npz")):
        one.save(tmp_path / name)
    image, mask, _ = pictures(1, 4)[0]
    loaded = ObjectRecogniser.load(tmp_path / "two.npz")
    assert loaded.classify(image, mask) == recogniser.classify(image, mask)
    assert loaded.told["command"] == "by hand"


def test_unknown_is_said_as_readily_as_known_things_allow() -> None:
    learnt = describe(pictures(60, 0), np.random.default_rng(1), 1)
    ready = fit(learnt, ["Red", "Blue"], {}, 0)
    before = ready.forest.start[-1]
    held_out = describe(pictures(60, 12), np.random.default_rng(2))
    calibrate(ready, held_out)
    assert ready.forest.start[-1] != before
    names = np.array(held_out.names)
    answers = np.array([ready.names[ready.probabilities(f).argmax()] for f in held_out.features])
    known = names != UNKNOWN
    assert np.mean(answers[known] == names[known]) >= KNOWN_RIGHT
    assert np.mean(answers[~known] == UNKNOWN) > 0.95
    with pytest.raises(PerceptionError, match="nothing to calibrate with"):
        calibrate(ready, describe([p for p in pictures(3, 0) if p[2] == UNKNOWN], np.random.default_rng(0)))


def test_too_few_examples() -> None:
    learnt = describe(pictures(3, 0), np.random.default_rng(1))
    with pytest.raises(PerceptionError, match="too few views show Blue"):
        fit(learnt, ["Red", "Blue"], {}, 0)
    with pytest.raises(PerceptionError, match="nothing to learn from"):
        describe([], np.random.default_rng(1))


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04broken"])
def test_a_broken_file_is_one_clear_line(tmp_path: Path, content: bytes) -> None:
    for folder, domain in (("elsewhere", r"NAME \(sandwich, toys\)"), ("toys", "toys")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "r.npz").write_bytes(content)
        told = rf"no recogniser .*; make one with: cogarch learn objects --domain {domain}$"
        with pytest.raises(PerceptionError, match=told):
            ObjectRecogniser.load(tmp_path / folder / "r.npz")


def test_a_recogniser_of_another_version_names_its_domain(tmp_path: Path) -> None:
    with np.load(recogniser_path("sandwich")) as data:
        arrays = {name: data[name] for name in data.files}
    (tmp_path / "sandwich").mkdir()
    np.savez(tmp_path / "sandwich" / "r.npz", **(arrays | {"features": arrays["features"][1:]}))
    with pytest.raises(PerceptionError, match=r"another version; make one with: .* --domain sandwich$"):
        ObjectRecogniser.load(tmp_path / "sandwich" / "r.npz")


def test_a_domain_without_recogniser_names_the_command(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(recognition, "recogniser_path", lambda name: tmp_path / name)
    load_recogniser.cache_clear()
    with pytest.raises(PerceptionError, match="cogarch learn objects --domain toys"):
        load_recogniser("toys")
    load_recogniser.cache_clear()


def test_a_changed_domain_is_to_be_learnt_again(recogniser: ObjectRecogniser) -> None:
    with pytest.raises(PerceptionError, match=r"not learnt yet .*Ham.*learn objects --domain sandwich"):
        check_fits(recogniser, load_domain("sandwich"))


@pytest.mark.parametrize("name", domain_names())
def test_what_ships_fits_its_domain(name: str) -> None:
    """Whoever adds an object learns them again: `cogarch learn objects --domain NAME`."""
    domain = load_domain(name)
    shipped = ObjectRecogniser.load(recogniser_path(name))
    check_fits(shipped, domain)
    assert shipped.names == (*sorted(domain.objects), UNKNOWN)
    assert f"--domain {name}" in shipped.told["command"]
    assert recogniser_path(name).stat().st_size < 600_000


def test_a_changed_look_is_noticed() -> None:
    shipped, domain = load_recogniser("sandwich"), load_domain("sandwich")
    ham = domain.objects["Ham"].model_copy(update={"color": (0.1, 0.2, 0.3)})
    changed = domain.model_copy(update={"objects": {**domain.objects, "Ham": ham}})
    with pytest.raises(PerceptionError, match="look different"):
        check_fits(shipped, changed)


def test_loading_is_quick() -> None:
    started = time.process_time()
    ObjectRecogniser.load(recogniser_path("sandwich"))
    assert time.process_time() - started < 0.5


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("forest_feature", lambda array: array[:10]),
        ("forest_child", lambda array: array + 100_000),
        ("forest_feature", lambda array: array + 1000),
        ("forest_roots", lambda array: array[:, :-1]),
        ("forest_depth", lambda array: np.array(-1)),
        ("means", lambda array: array[:, :-1]),
        ("limits", lambda array: array[:-1]),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(
    tmp_path: Path, field: str, change: Callable[[np.ndarray], np.ndarray]
) -> None:
    with np.load(recogniser_path("toys")) as data:
        arrays = {name: data[name] for name in data.files}
    arrays[field] = change(arrays[field])
    np.savez(tmp_path / "r.npz", **arrays)
    with pytest.raises(PerceptionError, match="no recogniser"):
        ObjectRecogniser.load(tmp_path / "r.npz")
