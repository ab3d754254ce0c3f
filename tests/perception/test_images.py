"""Broken and odd files: one line for each, nothing else on the terminal, nothing waited for."""

from __future__ import annotations

import contextlib
import os
import struct
import sys
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image as Pictures

from cognitive_arch.errors import PerceptionError
from cognitive_arch.perception import images
from cognitive_arch.perception.images import (
    IMAGE_SUFFIXES,
    VIDEO_SUFFIXES,
    Image,
    frames,
    is_many,
    read_image,
    read_mask,
)

BLUE = (10, 60, 200)


def noise(width: int = 40, height: int = 30) -> Image:
    return np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)


def saved(path: Path, picture: Pictures.Image | None = None, **options: Any) -> Path:
    (Pictures.fromarray(noise()) if picture is None else picture).save(path, **options)
    return path


def png(path: Path, width: int, height: int) -> Path:
    """A PNG that says it has this size, with a single byte of image data."""
    blocks = [
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"\0")),
        (b"IEND", b""),
    ]
    body = b"".join(
        struct.pack(">I", len(d)) + t + d + struct.pack(">I", zlib.crc32(t + d)) for t, d in blocks
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)
    return path


def filmed(path: Path, count: int = 3, code: str = "MJPG") -> Path:
    """A video of `count` frames, 64x48, each brighter in red than the one before."""
    video = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 25, (64, 48))
    assert video.isOpened()
    for i in range(count):
        video.write(np.full((48, 64, 3), (0, 0, 60 * (i + 1)), np.uint8))
    video.release()
    return path


def assert_told(call: Callable[[], object], *parts: object) -> None:
    """`call` raises an error of one line, with a cause that stays hidden, that says all of `parts`."""
    with pytest.raises(PerceptionError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    assert message.isprintable()
    assert caught.value.__suppress_context__ or caught.value.__context__ is None
    for part in parts:
        assert str(part) in message


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".ppm", ".tif", ".tiff"])
def test_colours_come_as_they_were_stored(tmp_path: Path, suffix: str) -> None:
    assert np.array_equal(read_image(saved(tmp_path / f"a{suffix}")), noise())


@pytest.mark.parametrize("suffix", [".jpg", ".webp", ".gif"])
def test_compressed_colours_come_close(tmp_path: Path, suffix: str) -> None:
    pixels = read_image(saved(tmp_path / f"a{suffix}", Pictures.new("RGB", (40, 30), BLUE)))
    assert pixels.shape == (30, 40, 3)
    assert np.abs(pixels.astype(int) - BLUE).max() < 5


def test_cmyk_becomes_rgb(tmp_path: Path) -> None:
    ink = Pictures.new("CMYK", (2, 3), (0, 255, 255, 0))
    for name in ("ink.tif", "ink.jpg"):
        assert np.abs(read_image(saved(tmp_path / name, ink)).astype(int) - (255, 0, 0)).max() < 5


@pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm"])
def test_sixteen_bits_are_scaled(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    cv2.imwrite(str(path), np.array([[0, 0x1234, 0x80FF, 0xFFFF]], np.uint16))
    assert read_image(path)[0, :, 1].tolist() == [0, 0x12, 0x80, 255]
    cv2.imwrite(str(tmp_path / "colour.png"), np.array([[[0x1234, 0x80FF, 0xFFFF]]], np.uint16))
    assert read_image(tmp_path / "colour.png").tolist() == [[[255, 0x80, 0x12]]]


def test_a_photograph_is_turned_upright(tmp_path: Path) -> None:
    exif = Pictures.Exif()
    exif[0x0112] = 6
    assert read_image(saved(tmp_path / "a.jpg", exif=exif)).shape == (40, 30, 3)


def test_what_is_no_file_is_told_apart(tmp_path: Path) -> None:
    assert_told(
        lambda: read_image(tmp_path / "none.png"), "cannot read the image", "none.png", "No such file"
    )
    assert_told(lambda: read_image(tmp_path), "no regular file", tmp_path.name, "webp")
    assert_told(lambda: read_image(Path("nul\0l.png")), "'nul l.png'")
    assert_told(lambda: read_image(tmp_path / "new\nline.png"), "new line.png")
    assert_told(lambda: list(frames(Path("x" * 300))), "cannot read the image", "too long")
    assert_told(lambda: list(frames(Path("x" * 300 + ".mp4"))), "cannot read the video", "too long")
    assert not is_many(Path("x" * 300))


def test_a_long_path_keeps_the_name_of_its_file(tmp_path: Path) -> None:
    assert_told(
        lambda: read_image(tmp_path.joinpath(*["folder" * 10] * 5, "table.png")), "'...", "/table.png'"
    )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes on this system")
def test_pipes_and_devices_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.png")
    os.mkfifo(tmp_path / "a.mp4")
    assert_told(lambda: list(frames(tmp_path / "a.png")), "a.png' is no regular file; valid: bmp")
    assert_told(lambda: list(frames(tmp_path / "a.mp4")), "a.mp4' is no regular file; valid: avi")
    assert_told(lambda: read_mask(Path("/dev/zero")), "no regular file")
    ((name, found),) = frames(tmp_path)
    assert name == "a.png"
    assert isinstance(found, PerceptionError)


@pytest.mark.parametrize(
    "content",
    [
        b"\x89PNG\r\n\x1a\n",
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n",
        b"P6 0 0 255\n",
    ],
)
def test_what_is_no_image(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.png").write_bytes(content)
    assert_told(lambda: read_image(tmp_path / "a.png"), "a.png' is no image; valid: bmp, gif")


@pytest.mark.parametrize("suffix", IMAGE_SUFFIXES)
@pytest.mark.parametrize("share", [0.02, 0.3, 0.7])
def test_an_image_cut_off(
    tmp_path: Path, suffix: str, share: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = saved(tmp_path / f"a{suffix}", Pictures.fromarray(noise(200, 100)))
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * share)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert_told(lambda: read_image(path), path.name)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_adobe_deflate", "jpeg", "packbits"])
def test_damage_within_is_told_or_does_not_matter(tmp_path: Path, compression: str) -> None:
    path = saved(tmp_path / "a.tif", compression=compression)
    whole = bytearray(path.read_bytes())
    rng = np.random.default_rng(1)
    for _ in range(50):
        damaged = whole.copy()
        for place in rng.integers(0, len(whole), 20):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        found: Image | PerceptionError
        try:
            found = read_image(path)
        except PerceptionError as error:
            found = error
        if isinstance(found, PerceptionError):
            assert "a.tif" in str(found)
            assert str(found).isprintable()  # hence one line
        else:
            assert found.dtype == np.uint8
            assert found.shape[2:] == (3,)


@pytest.mark.parametrize("size", [(10_000, 5_001), (12_000, 10_000), (2**31 - 1, 2**31 - 1)])
def test_too_many_pixels_are_refused_by_the_header(tmp_path: Path, size: tuple[int, int]) -> None:
    path = png(tmp_path / "a.png", *size)
    assert_told(lambda: read_image(path), f"a.png' is {size[0]}x{size[1]} pixels; valid: at most 50 million")


def test_the_limit_itself_is_valid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path / "a.png")
    monkeypatch.setattr(images, "MAX_PIXELS", 40 * 30)
    assert read_image(path).shape == (30, 40, 3)
    monkeypatch.setattr(images, "MAX_PIXELS", 40 * 30 - 1)
    assert_told(lambda: read_image(path), "40x30")


def test_a_mask_is_what_is_not_black(tmp_path: Path) -> None:
    values = np.array([[0, 12, 13], [255, 0, 100]], np.uint8)
    mask = read_mask(saved(tmp_path / "grey.png", Pictures.fromarray(values)))
    assert mask.tolist() == (values > 0).tolist()
    clear = Pictures.new("RGBA", (3, 2), (255, 255, 255, 0))
    assert not read_mask(saved(tmp_path / "clear.png", clear)).any()
    nearly = Pictures.new("L", (3, 2), 8)
    assert not read_mask(saved(tmp_path / "nearly.jpg", nearly)).any()


def test_a_folder_gives_its_images_by_name(tmp_path: Path) -> None:
    for name in ("c.JPG", "a.png", "d.gif"):
        saved(tmp_path / name)
    (tmp_path / "b.png").write_text("none")
    (tmp_path / "notes.txt").write_text("none")
    (tmp_path / "f.png").mkdir()
    found = dict(frames(tmp_path))
    assert list(found) == ["a.png", "b.png", "c.JPG", "d.gif"]
    assert [name for name, one in found.items() if isinstance(one, PerceptionError)] == ["b.png"]
    assert_told(
        lambda: list(frames(tmp_path / "f.png")), "no image in the folder", "f.png", "valid: bmp, gif"
    )


@pytest.mark.parametrize(("name", "code"), [("clip.avi", "MJPG"), ("clip.MP4", "mp4v"), ("clip.mkv", "mp4v")])
def test_a_video_gives_its_frames(tmp_path: Path, name: str, code: str) -> None:
    found = list(frames(filmed(tmp_path / name, code=code)))
    assert [name for name, _ in found] == [f"{name}-{i:05d}" for i in range(3)]
    for i, (_, pixels) in enumerate(found):
        assert not isinstance(pixels, PerceptionError)
        assert pixels.dtype == np.uint8
        assert pixels.shape == (48, 64, 3)
        assert np.abs(pixels.astype(int) - (60 * (i + 1), 0, 0)).max() < 12


def test_the_name_of_a_video_is_no_pattern(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clip = filmed(tmp_path / "clip.avi").read_bytes()
    monkeypatch.chdir(tmp_path)
    for name in ("concat:a%02d.avi", "3.04\u202fPM.avi"):
        Path(name).write_bytes(clip)
        assert len(list(frames(Path(name)))) == 3


@pytest.mark.skipif(os.name == "nt" or sys.platform == "darwin", reason="names are UTF-8 on this system")
def test_a_name_that_is_not_utf_8_is_no_crash(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"a\xff.mp4")
    path.write_text("no video")
    assert_told(lambda: list(frames(path)), "is not UTF-8")
    assert np.array_equal(read_image(saved(tmp_path / os.fsdecode(b"a\xff.png"))), noise())


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_what_is_no_video(tmp_path: Path, suffix: str, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / f"a{suffix}"
    assert_told(lambda: list(frames(path)), "cannot read the video", path.name, "No such file")
    for content in (b"", b"no video\n" * 500):
        path.write_bytes(content)
        assert_told(lambda: list(frames(path)), path.name, " video")  # FFmpeg takes text for some kinds
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("name", "code"), [("clip.avi", "MJPG"), ("clip.mp4", "mp4v"), ("clip.mkv", "mp4v")])
def test_a_broken_video_writes_nothing(
    tmp_path: Path, name: str, code: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = filmed(tmp_path / name, 10, code)
    whole = path.read_bytes()
    damaged = bytearray(whole)
    damaged[len(whole) // 3 : len(whole) // 2] = b"\xff" * (len(whole) // 2 - len(whole) // 3)
    capfd.readouterr()
    for content in (whole[: len(whole) // 2], bytes(damaged)):
        path.write_bytes(content)
        with contextlib.suppress(PerceptionError):
            assert list(frames(path))
    assert capfd.readouterr() == ("", "")


def test_a_video_that_is_cut_off_says_so_after_what_could_be_read(tmp_path: Path) -> None:
    path = filmed(tmp_path / "clip.avi", 200)
    assert all(isinstance(frame, np.ndarray) for _, frame in frames(path))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    found = [frame for _, frame in frames(path)]
    assert 0 < len(found) - 1 < 200
    assert f"only {len(found) - 1} of about 200 frames" in str(found[-1])


class FakeCapture:
    """Stands in for OpenCV's: as many frames as `left`, then `end`."""

    released = 0

    def __init__(self, left: int, end: BaseException | None = None, side: int = 4) -> None:
        self.left, self.end, self.side = left, end, side

    def __call__(self, *_: object) -> FakeCapture:
        return self

    def isOpened(self) -> bool:
        return True

    def get(self, _: int) -> float:
        return self.side

    def read(self) -> tuple[bool, Image | None]:
        if self.left:
            self.left -= 1
            return True, np.zeros((4, 4, 3), np.uint8)
        if self.end is not None:
            raise self.end
        return False, None

    def release(self) -> None:
        self.released += 1


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    (tmp_path / "a.mp4").write_text("stands for a video")
    return tmp_path / "a.mp4"


def test_a_video_without_frames_or_with_too_large_ones(clip: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for capture, part in [
        (FakeCapture(0), "no frame"),
        (FakeCapture(3, side=20_000), "is 20000x20000 pixels"),
        (FakeCapture(1, cv2.error("bad\nframe")), "bad frame"),
    ]:
        monkeypatch.setattr(cv2, "VideoCapture", capture)
        assert_told(lambda: list(frames(clip)), "a.mp4", part)
        assert capture.released == 1


def test_a_video_is_read_frame_by_frame_and_released(clip: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    capture = FakeCapture(5)
    monkeypatch.setattr(cv2, "VideoCapture", capture)
    found = frames(clip)
    assert next(found)[0] == "a.mp4-00000"
    assert (capture.left, capture.released) == (4, 0)
    del found
    assert (capture.left, capture.released) == (4, 1)

    interrupted = FakeCapture(1, KeyboardInterrupt())
    monkeypatch.setattr(cv2, "VideoCapture", interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(frames(clip))
    assert interrupted.released == 1
