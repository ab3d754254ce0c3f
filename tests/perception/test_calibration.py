"""A camera from a file: where blobs are on the table, and how sure that is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image as Pictures

from cognitive_arch.errors import CogArchError
from cognitive_arch.perception.calibration import read_calibration
from cognitive_arch.perception.camera import Camera
from tests.perception.test_camera import looking_down

SIZE, TABLE = (160, 120), -0.1


def told(camera: Camera, **changes: Any) -> dict[str, Any]:
    pose = camera.X_WC.tolist()
    return {"size": list(camera.size), "focal": camera.focal, "pose": pose, "table": TABLE} | changes


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(told(looking_down(size=SIZE))))
    return path


def test_a_coin_is_found_where_it_lies(cogarch: Any, file: Path, tmp_path: Path) -> None:
    camera, place = looking_down(size=SIZE), np.array([-0.45, 0.06, TABLE])
    ring = np.linspace(0, 2 * np.pi, 40)
    edge = place + 0.03 * np.column_stack([np.cos(ring), np.sin(ring), 0 * ring])
    image = np.full((SIZE[1], SIZE[0], 3), (170, 136, 102), np.uint8)
    cv2.fillPoly(image, [np.rint(camera.project(edge)).astype(np.int32)], (220, 40, 30))
    Pictures.fromarray(image).save(tmp_path / "coin.png")
    asked = ("see", str(tmp_path / "coin.png"), "--camera", str(file))
    (blob,) = cogarch(*asked, "--json").json["blobs"]
    assert blob["place"]["position"] == pytest.approx(place[:2], abs=0.004)
    sigma = np.sqrt(np.diag(blob["place"]["covariance"]))
    assert 0.002 < sigma[1] < sigma[0] < 0.02  # along the view a height that is off matters most
    assert "on the table at -0.4" in cogarch(*asked).out
    assert "place" not in cogarch(*asked[:2], "--json").json["blobs"][0]


def test_how_sure_it_is_follows_from_the_file(tmp_path: Path) -> None:
    spread = {}
    for name, sigma in (("sure", 0.0), ("unsure", 0.02)):
        path = tmp_path / f"{name}.yaml"
        path.write_text(json.dumps(told(looking_down(size=SIZE), height_sigma=sigma)))
        found = read_calibration(path).place((80.0, 60.0))
        assert found is not None
        spread[name] = np.trace(found["covariance"])
    assert spread["unsure"] > 5 * spread["sure"] > 0


def test_a_rounded_pose_will_do(file: Path) -> None:
    camera = looking_down(size=SIZE)
    file.write_text(json.dumps(told(camera, pose=camera.X_WC.round(3).tolist())))
    assert np.allclose(read_calibration(file).camera.X_WC, camera.X_WC, atol=1e-3)


def test_the_sky_is_on_no_table(file: Path) -> None:
    level = told(looking_down(tilt=0.1, size=SIZE))
    file.write_text(json.dumps(level))
    assert read_calibration(file).place((80.0, 0.0)) is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"focal": -3}, "more than 0"),
        ({"focal": "long"}, "focal: .*fields: size, focal, centre, pose, table"),
        ({"pose": [[1, 0], [0, 1]]}, "pose"),
        ({"pose": np.ones((4, 4)).tolist()}, "rotation"),
        ({"table": float("nan")}, "table: .*finite"),
        ({"height_sigma": -1}, "height_sigma"),
        ({"zoom": 3}, "zoom"),
    ],
)
def test_what_is_no_calibration(file: Path, changes: dict[str, Any], message: str) -> None:
    file.write_text(json.dumps(told(looking_down(size=SIZE), **changes)).replace("NaN", ".nan"))
    with pytest.raises(CogArchError, match=message) as caught:
        read_calibration(file)
    assert "\n" not in str(caught.value)


def test_a_picture_of_another_size_is_refused(cogarch: Any, file: Path, tmp_path: Path) -> None:
    Pictures.new("RGB", (64, 48)).save(tmp_path / "small.png")
    answer = cogarch("see", str(tmp_path / "small.png"), "--camera", str(file), "--json")
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.count("\n") == 1
    assert "64x48 pixels; this camera's are 160x120" in answer.err
    assert cogarch("see", str(tmp_path / "small.png"), "--camera", "nowhere.yaml").code == 2
