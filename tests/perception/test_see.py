"""`cogarch see`, and reading pictures of all kinds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image as Pictures

from benchmarks.perception import six_objects
from cognitive_arch.domain import load_domain
from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception.images import read_image
from cognitive_arch.perception.segmentation import make_segmenter
from cognitive_arch.perception.vision import annotated, see

SCENE = six_objects((320, 240))


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "table.png"
    Pictures.fromarray(SCENE).save(path)
    return path


def test_a_picture_is_described(cogarch: Any, picture: Path, tmp_path: Path) -> None:
    answer = cogarch("see", str(picture), "--save", str(tmp_path / "out"), "--json")
    assert answer.code == 0
    assert len(answer.json["blobs"]) == 6
    for blob in answer.json["blobs"]:
        assert {"bbox", "centroid", "area", "label", "probability", "descriptors"} <= set(blob)
        assert set(blob["descriptors"]) == {"whole", "top", "bottom"}
        assert all(len(part) == 14 for part in blob["descriptors"].values())
        assert blob["label"] is None
    drawn = read_image(Path(answer.json["annotated"]))
    assert drawn.shape == SCENE.shape
    assert (drawn != SCENE).any()


def test_things_of_a_domain_are_named(cogarch: Any, picture: Path) -> None:
    answer = cogarch("see", str(picture), "--domain", "sandwich", "--json").json
    assert answer["domain"] == "sandwich"
    names = {*load_domain("sandwich").objects, "unknown"}
    for blob in answer["blobs"]:
        assert blob["label"] in names
        assert 0 < blob["probability"] <= 1
    # A blue ellipse and a purple star are nothing that a sandwich is made of.
    assert sum(blob["label"] == "unknown" for blob in answer["blobs"]) >= 2


def test_a_mask_takes_the_segmenters_place_and_ignore_hides(
    cogarch: Any, picture: Path, tmp_path: Path
) -> None:
    mask = np.zeros((240, 320), np.uint8)
    mask[50:90, 100:150] = 255
    mask[150:190, 100:150] = 255
    Pictures.fromarray(mask).save(tmp_path / "mask.png")
    mask[150:] = 0
    Pictures.fromarray(mask).save(tmp_path / "hide.png")
    given = ("see", str(picture), "--mask", str(tmp_path / "mask.png"), "--json")
    boxes = [blob["bbox"] for blob in cogarch(*given).json["blobs"]]
    assert boxes == [[100, 50, 50, 40], [100, 150, 50, 40]]
    hidden = cogarch(*given, "--ignore", str(tmp_path / "hide.png")).json
    assert [blob["bbox"] for blob in hidden["blobs"]] == [[100, 150, 50, 40]]


def test_a_folder_tells_of_broken_pictures_and_goes_on(cogarch: Any, picture: Path) -> None:
    (picture.parent / "broken.png").write_bytes(picture.read_bytes()[:500])
    (picture.parent / "notes.txt").write_text("not looked at")
    answer = cogarch("see", str(picture.parent), "--json")
    assert answer.code == 1
    assert answer.json["failed"] == 1
    broken, whole = answer.json["images"]
    assert "broken.png" in broken["error"]
    assert len(whole["blobs"]) == 6


@pytest.mark.parametrize("option", ["--mask", "--ignore"])
def test_a_mask_that_does_not_fit_one_picture_of_a_folder_costs_that_one_only(
    cogarch: Any, picture: Path, option: str, tmp_path: Path
) -> None:
    Pictures.fromarray(six_objects((160, 120))).save(picture.parent / "small.png")
    (tmp_path / "masks").mkdir()
    mask = tmp_path / "masks" / "mask.png"
    Pictures.new("L", (320, 240), 255 if option == "--mask" else 0).save(mask)
    answer = cogarch("see", str(picture.parent), option, str(mask), "--json")
    assert (answer.code, answer.json["failed"]) == (1, 1)
    small, whole = answer.json["images"]
    assert small["image"] == "small.png"
    assert "mask.png' is 320x240 pixels; valid for this image: 160x120" in small["error"]
    assert whole["blobs"]
    told = cogarch("see", str(picture.parent), option, str(mask)).out
    assert told.startswith("small.png: the mask ")
    assert "table.png: 320x240" in told


def test_the_margin_goes_with_the_segmenter_and_names_with_what_it_found(cogarch: Any, picture: Path) -> None:
    def seen(*options: str) -> dict[str, Any]:
        return cogarch("see", str(picture), "--domain", "sandwich", "--json", *options).json

    usual, none, two = seen(), seen("--margin", "0"), seen("--margin", "2")
    assert (usual["margin"], none["margin"]) == (2, 0)
    assert usual == two
    for wide, narrow in zip(usual["blobs"], none["blobs"], strict=True):
        assert wide["area"] > narrow["area"]
        assert (wide["label"], wide["probability"]) == (narrow["label"], narrow["probability"])
    assert seen("--segmenter", "texture")["margin"] == 0


def test_a_video_is_seen_frame_by_frame(cogarch: Any, tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10, (320, 240))
    for _ in range(3):
        writer.write(SCENE[:, :, ::-1])
    writer.release()
    answer = cogarch("see", str(path), "--save", str(tmp_path / "out"), "--json").json
    assert [image["image"] for image in answer["images"]] == [f"clip.mp4-{n:05d}" for n in range(3)]
    assert all(len(image["blobs"]) == 6 for image in answer["images"])
    assert len(list((tmp_path / "out").iterdir())) == 3


def huge(path: Path) -> None:
    """A bitmap's header that promises 20,000 x 20,000 pixels, and none of them."""
    size = (20_000).to_bytes(4, "little")
    path.write_bytes(
        b"BM" + bytes(8) + (54).to_bytes(4, "little") + (40).to_bytes(4, "little") + size + size
        + b"\1\0\x18\0" + bytes(24)
    )  # fmt: skip


def test_bad_input_is_one_clear_line(cogarch: Any, picture: Path, tmp_path: Path) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "cut.png").write_bytes(picture.read_bytes()[:500])
    (tmp_path / "no.mp4").write_text("no video")
    huge(tmp_path / "huge.bmp")
    Pictures.new("L", (5, 5)).save(tmp_path / "small.png")
    (tmp_path / "file").touch()
    for arguments, said in {
        ("nowhere.png",): "No such file",
        (str(folder),): "no image in the folder",
        (str(tmp_path / "empty.png"),): "is empty",
        (str(tmp_path / "text.png"),): "is no image; valid: bmp",
        (str(tmp_path / "cut.png"),): "truncated",
        (str(tmp_path / "no.mp4"),): "is no video",
        (str(tmp_path / "huge.bmp"),): "20000x20000 pixels; valid: at most 50 million",
        (str(picture), "--mask", str(tmp_path / "small.png")): "5x5 pixels; valid for this image: 320x240",
        (str(picture), "--segmenter", "magic"): "valid: colour, depth, texture",
        (str(picture), "--segmenter", "depth"): "valid for it: colour, texture",
        (str(picture), "--formulas", "mine"): "valid: blobDescriptor, shapeDescriptor",
        (str(picture), "--margin", "-2"): "valid: 0 to 50",
        (str(picture), "--mask", "nowhere.png"): "nowhere.png",
        (str(picture), "--domain", "kitchens"): "sandwich, toys",
        (str(picture), "--save", str(tmp_path / "file")): "cannot write pictures to",
    }.items():
        answer = cogarch("see", *arguments, "--json")
        assert (answer.code, answer.out) == (2, ""), arguments
        assert said in answer.err
        assert answer.err.count("\n") == 1


def test_all_kinds_of_pixels_become_rgb(tmp_path: Path) -> None:
    grey = SCENE[:, :, 0]
    kinds = {
        "grey": Pictures.fromarray(grey),
        "deep": Pictures.fromarray(grey.astype(np.uint16) << 8),
        "palette": Pictures.fromarray(SCENE).convert("P"),
        "two": Pictures.fromarray(grey).convert("1"),
        "dot": Pictures.new("RGB", (1, 1), (1, 2, 3)),
    }
    for name, kind in kinds.items():
        kind.save(tmp_path / f"{name}.png")
        image = read_image(tmp_path / f"{name}.png")
        assert image.dtype == np.uint8
        assert image.shape == (kind.height, kind.width, 3)
        if name in ("grey", "deep"):
            assert np.array_equal(image[:, :, 2], grey)
    assert read_image(tmp_path / "dot.png").tolist() == [[[1, 2, 3]]]
    assert see(read_image(tmp_path / "dot.png"), make_segmenter()) == []


def test_what_is_transparent_is_black(tmp_path: Path) -> None:
    pixels = np.full((2, 2, 4), 200, np.uint8)
    pixels[..., 3] = [[0, 255], [255, 0]]
    Pictures.fromarray(pixels).save(tmp_path / "alpha.png")
    assert read_image(tmp_path / "alpha.png")[:, :, 0].tolist() == [[0, 200], [200, 0]]


class Namer:
    """Calls what is mostly red a tomato."""

    def classify(self, image: np.ndarray, mask: np.ndarray) -> list[tuple[str, float]]:
        assert mask.shape == image.shape[:2]
        red, *others = image[mask].mean(axis=0)
        return (
            [("Tomato", 0.9), ("unknown", 0.1)]
            if red > 3 * max(others)
            else [("unknown", 0.8), ("Tomato", 0.2)]
        )


def test_a_recogniser_names_what_is_seen_and_shapes_stay_the_same() -> None:
    named, plain = (see(SCENE, make_segmenter(), recogniser=namer) for namer in (Namer(), None))
    assert sorted(str(one.label) for one in named) == ["Tomato", *["unknown"] * 5]
    assert [one.descriptions for one in named] == [one.descriptions for one in plain]
    assert (annotated(SCENE, named) != annotated(SCENE, plain)).any()


def test_five_hundred_things_are_seen() -> None:
    image = np.full((480, 640, 3), (170, 136, 102), np.uint8)
    for n in range(500):
        x, y = 25 * (n % 25) + 8, 23 * (n // 25) + 8
        image[y : y + 12, x : x + 12] = (200, 30, 40)
    assert len(see(image, make_segmenter())) == 500


def test_a_mask_of_another_size_is_refused() -> None:
    with pytest.raises(PerceptionError, match="valid for this image"):
        see(SCENE, make_segmenter(), mask=np.zeros((4, 4), np.uint8))
