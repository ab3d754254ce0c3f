"""Segmenters: things are found, the table, its shadows and reflections and the surroundings are not."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from benchmarks.perception import overlap, six_objects
from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.background import estimate_background
from cognitive_arch.perception.camera import Camera
from cognitive_arch.perception.images import read_image, read_mask
from cognitive_arch.perception.labelling import label_blobs
from cognitive_arch.perception.segmentation import (
    FOR_PLAIN_IMAGES,
    MARGINS,
    SEGMENTERS,
    binary_patterns,
    make_segmenter,
    widened,
)
from tests.perception.test_camera import looking_down

ROOT = Path(__file__).resolve().parents[2]
PICTURES = Path(os.environ.get("COGARCH_DATA", ROOT.parent / "shared/data")) / "affordances" / "images"
BROWN, DARK_GREEN, GREY = (170, 136, 102), (14, 40, 34), (128, 128, 128)
RED = (220, 40, 30)
Image = NDArray[np.uint8]


def table(colour: tuple[int, int, int], noise: float = 2.0, size: tuple[int, int] = (160, 120)) -> Image:
    image = np.full((size[1], size[0], 3), colour, np.float64)
    return rounded(image + np.random.default_rng(0).normal(0, noise, image.shape))


def rounded(image: NDArray[np.floating]) -> Image:
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def disc(centre: tuple[int, int], radius: int, size: tuple[int, int] = (160, 120)) -> NDArray[np.bool_]:
    return cv2.circle(np.zeros((size[1], size[0]), np.uint8), centre, radius, 1, cv2.FILLED) > 0


@pytest.mark.parametrize("colour", [BROWN, DARK_GREEN, GREY])
def test_a_thing_is_found_and_its_shadow_is_not(colour: tuple[int, int, int]) -> None:
    thing, shadow = disc((70, 60), 20), disc((84, 68), 22)
    image = table(colour).astype(np.float64)
    image[shadow] *= 0.45
    image[thing] = RED
    mask = make_segmenter("colour").segment(rounded(image)) > 0
    assert overlap(mask, thing) > 0.97


@pytest.mark.parametrize("share", [0.3, 0.5, 0.6])
def test_a_sharp_shadow_over_half_of_the_table_hides_nothing_that_is_lit(share: float) -> None:
    image = table(BROWN).astype(np.float64)
    dark, lit = disc((20, 30), 12), disc((135, 80), 15)
    image[dark], image[lit] = RED, RED
    image[:, : round(share * 160)] *= 0.6
    mask = make_segmenter("colour").segment(rounded(image)) > 0
    assert overlap(mask, dark | lit) > 0.95


@pytest.mark.parametrize("brightness", [235, 250])
def test_white_things_are_found_on_a_grey_table(brightness: int) -> None:
    image, white = table((180, 180, 180)).astype(np.float64), disc((80, 60), 20)
    image[white] = brightness
    assert overlap(make_segmenter("colour").segment(rounded(image)) > 0, white) > 0.95


@pytest.mark.parametrize("colour", [BROWN, DARK_GREEN, GREY])
def test_a_reflection_is_no_thing_and_a_white_disc_is(colour: tuple[int, int, int]) -> None:
    y, x = np.mgrid[:120, :160]
    glare = 180 * np.exp(-((x - 45) ** 2 + (y - 60) ** 2) / (2 * 14**2))
    image = table(colour) + glare[:, :, None]
    white = disc((115, 60), 18)
    image[white] = 250
    mask = make_segmenter("colour").segment(rounded(image)) > 0
    assert overlap(mask, white) > 0.95


def test_dark_things_are_seen_on_a_bright_table() -> None:
    image, thing = table(BROWN), disc((80, 60), 20)
    image[thing] = (25, 20, 15)  # of the table's own hue
    assert overlap(make_segmenter("colour").segment(image) > 0, thing) > 0.97


def test_light_may_fade_over_the_table() -> None:
    image = table(BROWN) * np.linspace(0.45, 1.2, 160)[None, :, None]
    thing = disc((40, 60), 15)
    image[thing] = (60, 110, 40)
    assert overlap(make_segmenter("colour").segment(rounded(image)) > 0, thing) > 0.95


def test_what_surrounds_the_table_is_no_thing_but_what_touches_the_border_is() -> None:
    image = table(BROWN)
    image[105:] = (235, 240, 250)  # the floor
    cv2.fillPoly(image, [np.array([(0, 0), (40, 0), (0, 30)])], (90, 60, 160))
    at_border = disc((90, 0), 15)
    image[at_border] = RED
    assert overlap(make_segmenter("colour").segment(image) > 0, at_border) > 0.95


@pytest.mark.parametrize("name", FOR_PLAIN_IMAGES)
def test_the_robots_own_hands_are_no_thing(name: str) -> None:
    image, hand, thing = table(BROWN), disc((20, 60), 25), disc((110, 60), 20)
    image[hand], image[thing] = (240, 240, 240), RED
    mask = make_segmenter(name).segment(image, ignore=hand) > 0
    assert not mask[hand].any()
    assert mask[thing].mean() > 0.9


@pytest.mark.parametrize("name", FOR_PLAIN_IMAGES)
def test_six_objects_are_six_blobs(name: str) -> None:
    image = six_objects((640, 480))
    truth = np.abs(image.astype(int) - (170, 136, 102)).max(axis=2) > 25
    found = label_blobs(make_segmenter(name).segment(image))
    assert overlap(found.labels > 0, truth) > (0.97 if name == "colour" else 0.7)
    assert name == "texture" or len(found.blobs) == 6


@pytest.mark.parametrize("name", FOR_PLAIN_IMAGES)
@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (2, 2), (50, 1), (3, 3)])
def test_tiny_and_even_pictures_show_nothing(name: str, shape: tuple[int, int]) -> None:
    for colour in (0, 100, 255):
        assert not make_segmenter(name).segment(np.full((*shape, 3), colour, np.uint8)).any()


@pytest.mark.parametrize("name", FOR_PLAIN_IMAGES)
def test_all_ignored_is_nothing_seen(name: str) -> None:
    assert not make_segmenter(name).segment(table(BROWN), np.ones((120, 160), np.bool_)).any()


def test_the_tables_colour_is_that_of_the_most_pixels() -> None:
    image = table(BROWN)
    image[disc((80, 60), 40)] = RED
    found = estimate_background(image)
    assert found is not None
    assert found.colour == pytest.approx(BROWN, abs=2)


def test_depth_finds_what_rises_above_the_table_whatever_its_colour() -> None:
    camera = looking_down(size=(160, 120))
    low, high = flat_depth(camera, 0.0), flat_depth(camera, 0.02)
    thing = disc((80, 70), 20)
    depth = np.where(thing, high, low)
    depth[:5] = np.inf
    depth[5:8] = np.nan
    image = np.zeros((120, 160, 3), np.uint8)
    segmenter = make_segmenter("depth", camera=camera, table=0.0)
    assert np.array_equal(segmenter.segment(image, depth=depth) > 0, thing)
    assert not segmenter.segment(image, depth=flat_depth(camera, 0.003)).any()
    with pytest.raises(PerceptionError, match="depth image; without one: colour, texture"):
        segmenter.segment(image)


def flat_depth(camera: Camera, height: float) -> NDArray[np.float32]:
    width, rows = camera.size
    y, x = np.mgrid[:rows, :width]
    rays = camera.ray(np.column_stack([x.ravel(), y.ravel()]).astype(np.float64))
    return ((height - camera.position[2]) / rays[:, 2]).reshape(rows, width).astype(np.float32)


def test_patterns_know_which_neighbours_are_brighter() -> None:
    grey = np.array([[9, 0, 0], [0, 5, 0], [0, 0, 9]], np.uint8)
    assert binary_patterns(grey)[1, 1] == 0b10001
    assert binary_patterns(grey, flat=4)[1, 1] == 0
    assert not binary_patterns(np.full((4, 4), 255, np.uint8)).any()


def test_pieces_grow_and_stay_apart() -> None:
    mask = np.zeros((40, 60), np.uint8)
    mask[5:15, 5:15] = mask[5:15, 17:30] = mask[16:30, 5:15] = mask[33:38, 40:50] = mask[20:25, 40:50] = 255
    mask[30, 30] = mask[31, 31] = 255  # one piece, by a corner
    before = label_blobs(mask, 1)
    assert len(before.blobs) == 6
    for margin in (1, 2, 5):
        wider = widened(mask, margin)
        after = label_blobs(wider, 1)
        assert len(after.blobs) == 6
        assert (wider[mask > 0] == 255).all()
        assert not (wider[cv2.dilate(mask, np.ones((2 * margin + 1,) * 2, np.uint8)) == 0]).any()
        # A piece that is alone is a disc wider all around; where two meet, one pixel is left between them.
        number = after.labels[22, 45]
        assert (after.labels[22] == number).sum() == 10 + 2 * margin
        assert (wider[10, 5:30] == 0).sum() == (1 if margin > 0 else 2)
    assert widened(mask, 0) is mask


BETWEEN_THREE = np.zeros((12, 14), np.bool_)
BETWEEN_THREE[[3, 6, 8], [0, 2, 2]] = True
"""Of what is added here a pixel was left that touched nothing."""


@given(arrays(np.bool_, (12, 14)), st.integers(1, 4))
@example(BETWEEN_THREE, 2)
def test_no_margin_merges_or_loses_pieces(mask: np.ndarray, margin: int) -> None:
    pixels = mask.astype(np.uint8) * 255
    wider = widened(pixels, margin)
    assert (wider[mask] == 255).all()
    assert cv2.connectedComponents(wider)[0] == cv2.connectedComponents(pixels)[0]


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(PerceptionError, match=r"unknown segmenter 'color' \(did you mean colour\?\)"):
        make_segmenter("color")
    with pytest.raises(PerceptionError, match="valid for it: colour, texture"):
        make_segmenter("depth")
    with pytest.raises(PerceptionError, match="margin of -1"):
        widened(np.zeros((5, 5), np.uint8), -1)
    with pytest.raises(PerceptionError, match="mask of"):
        make_segmenter("colour").segment(table(BROWN), np.zeros((5, 5), np.bool_))
    with pytest.raises(PerceptionError, match="an image of"):
        make_segmenter("colour").segment(np.zeros((5, 5), np.uint8))
    assert set(FOR_PLAIN_IMAGES) < set(SEGMENTERS)


@pytest.mark.skipif(not PICTURES.is_dir(), reason="the published pictures are not here")
def test_published_masks_are_met() -> None:
    segmenter, found = make_segmenter("colour"), []
    for path in sorted(PICTURES.glob("*_FG.jpg"))[::3]:
        image = read_image(path.with_name(path.name.replace("_FG", "")))
        mask = read_mask(path)
        ours = widened(segmenter.segment(image), MARGINS["colour"])
        found.append(overlap(label_blobs(ours).labels > 0, mask))
    assert np.mean(found) > 0.85
