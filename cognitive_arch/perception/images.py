"""Pictures from files: one image, a folder of them, or the frames of a video.

Whatever the file holds (grey, 16 bit, a palette, transparency), an image here is (height, width, 3) uint8
RGB. How large a picture is, is read from its header, so that a huge one is refused before it is decoded.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures
from PIL import ImageOps, UnidentifiedImageError

from cognitive_arch.errors import PerceptionError, one_line

Image = NDArray[np.uint8]  # (height, width, 3), RGB

MAX_PIXELS = 50_000_000
JPEG_NOISE = 12  # grey levels that compression leaves in what was black
IMAGE_SUFFIXES = (".bmp", ".gif", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp")
VIDEO_SUFFIXES = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".webm")


def frames(path: Path) -> Iterator[tuple[str, Image | PerceptionError]]:
    """What `path` holds, in order, each with its name: an image, all images of a folder, or all frames of a
    video ("clip.mp4-00012", counted from 0).

    An image of a folder that cannot be read comes as its error, so that one broken file does not hide the
    others. Raises `PerceptionError` for anything else that cannot be read.
    """
    if path.is_dir():
        yield from _folder(path)
    elif path.suffix.lower() in VIDEO_SUFFIXES:
        yield from _video(path)
    else:
        yield path.name, read_image(path)


def is_many(path: Path) -> bool:
    """Whether `path` is a folder or, by its name, a video."""
    return path.is_dir() or path.suffix.lower() in VIDEO_SUFFIXES


def read_image(path: Path) -> Image:
    """One picture, (height, width, 3) uint8 RGB; what is transparent is black.

    Raises `PerceptionError` for what is no image, is cut off, or has more than `MAX_PIXELS`.
    """
    try:
        with _opened(path) as picture:
            width, height = picture.size
            _check_size(path, width, height)
            return _rgb(path, ImageOps.exif_transpose(picture))
    except UnidentifiedImageError:
        empty = "is empty" if path.stat().st_size == 0 else "is no image"
        raise PerceptionError(
            f"'{one_line(path)}' {empty}; valid: {', '.join(s[1:] for s in IMAGE_SUFFIXES)}"
        ) from None
    except MemoryError:
        raise PerceptionError(f"'{one_line(path)}' does not fit into memory") from None
    except (OSError, SyntaxError, ValueError, EOFError) as error:  # what decoders raise for broken files
        said = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise PerceptionError(f"cannot read the image '{one_line(path)}': {one_line(said)}") from None


def read_mask(path: Path, size: tuple[int, int]) -> NDArray[np.bool_]:
    """A picture as a mask, (height, width) bool: true where it is not black, or in a JPEG brighter than its
    noise.

    Raises `PerceptionError` where it is not of `size` (width, height).
    """
    black = JPEG_NOISE if path.suffix.lower() in (".jpg", ".jpeg") else 0
    mask: NDArray[np.bool_] = read_image(path).max(axis=2) > black
    if mask.shape != size[::-1]:
        raise PerceptionError(
            f"the mask '{one_line(path)}' is {mask.shape[1]}x{mask.shape[0]} pixels; "
            f"valid for this image: {size[0]}x{size[1]}"
        )
    return mask


def _opened(path: Path) -> Pictures.Image:
    """The picture behind a header, not decoded yet. The library's own limit is left out here, for its
    message does not tell the size; ours comes next."""
    limit, Pictures.MAX_IMAGE_PIXELS = Pictures.MAX_IMAGE_PIXELS, None
    try:
        return Pictures.open(path)
    finally:
        Pictures.MAX_IMAGE_PIXELS = limit


def _check_size(path: Path, width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise PerceptionError(
            f"'{one_line(path)}' is {width}x{height} pixels; valid: at most {MAX_PIXELS // 10**6} million"
        )


def _rgb(path: Path, picture: Pictures.Image) -> Image:
    if picture.mode == "F":
        raise PerceptionError(f"'{one_line(path)}' has floating point pixels; valid: whole numbers")
    if picture.mode.startswith("I"):  # 16 bits of grey
        grey = np.clip(np.asarray(picture).astype(np.int64) >> 8, 0, 255).astype(np.uint8)
        return np.ascontiguousarray(np.broadcast_to(grey[:, :, None], (*grey.shape, 3)))
    if picture.has_transparency_data:
        opaque = picture.convert("RGBA")
        picture = Pictures.alpha_composite(Pictures.new("RGBA", opaque.size, (0, 0, 0, 255)), opaque)
    return np.array(picture.convert("RGB"), dtype=np.uint8)


def _folder(path: Path) -> Iterator[tuple[str, Image | PerceptionError]]:
    try:
        names = sorted(name for name in os.listdir(path) if name.lower().endswith(IMAGE_SUFFIXES))
    except OSError as error:
        raise PerceptionError(f"cannot read the folder '{one_line(path)}': {error.strerror}") from None
    if not names:
        raise PerceptionError(
            f"no image in the folder '{one_line(path)}'; valid: {', '.join(s[1:] for s in IMAGE_SUFFIXES)}"
        )
    for name in names:
        try:
            yield name, read_image(path / name)
        except PerceptionError as error:
            yield name, error


def _video(path: Path) -> Iterator[tuple[str, Image]]:
    import cv2

    if not path.is_file():
        raise PerceptionError(f"there is no video '{one_line(path)}'")
    reader = cv2.VideoCapture(str(path))
    try:
        if not reader.isOpened():
            raise PerceptionError(
                f"'{one_line(path)}' is no video that can be read; valid: "
                f"{', '.join(s[1:] for s in VIDEO_SUFFIXES)}"
            )
        _check_size(
            path, int(reader.get(cv2.CAP_PROP_FRAME_WIDTH)), int(reader.get(cv2.CAP_PROP_FRAME_HEIGHT))
        )
        count = 0
        while (answer := reader.read())[0]:
            yield f"{path.name}-{count:05d}", np.asarray(cv2.cvtColor(answer[1], cv2.COLOR_BGR2RGB), np.uint8)
            count += 1
        if count == 0:
            raise PerceptionError(f"the video '{one_line(path)}' has no frame that can be read")
    finally:
        reader.release()
