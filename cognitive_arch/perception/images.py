"""Pictures from files: one image, a folder of them, or the frames of a video.

Whatever the file holds (grey, 16 bit, a palette, transparency), an image here is (height, width, 3) uint8
RGB. How large a picture is, is read from its header, so that a huge one is refused before it is decoded.
Only the formats below are ever tried, so that no file makes Pillow start another program.
"""

from __future__ import annotations

import os
import stat
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures
from PIL import ImageOps, UnidentifiedImageError

from cognitive_arch.errors import PerceptionError, one_line

Image = NDArray[np.uint8]  # (height, width, 3), RGB

MAX_PIXELS = 50_000_000
COMPLETE = 0.95  # of the frames that a video announces, which some only estimate
JPEG_NOISE = 12  # grey levels that compression leaves in what was black
IMAGE_SUFFIXES = (".bmp", ".gif", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp")
VIDEO_SUFFIXES = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".webm")
FORMATS = ("BMP", "GIF", "JPEG", "PNG", "PPM", "TIFF", "WEBP")  # Pillow's names for IMAGE_SUFFIXES

# FFmpeg asks for this once in a process, when it is first used; what it has to say is said by our errors.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


def frames(path: Path) -> Iterator[tuple[str, Image | PerceptionError]]:
    """What `path` holds, in order, each with its name: an image, all images of a folder, or all frames of a
    video ("clip.mp4-00012", counted from 0).

    An image of a folder that cannot be read comes as its error, so that one broken file does not hide the
    others, and so does the end of a video that is cut off. Raises `PerceptionError` for anything else that
    cannot be read.
    """
    if os.path.isdir(path):  # unlike Path's, this raises for no name
        yield from _folder(path)
    elif path.suffix.lower() in VIDEO_SUFFIXES:
        yield from _video(path)
    else:
        yield path.name, read_image(path)


def is_many(path: Path) -> bool:
    """Whether `path` is a folder or, by its name, a video."""
    return os.path.isdir(path) or path.suffix.lower() in VIDEO_SUFFIXES


def read_image(path: Path) -> Image:
    """One picture, (height, width, 3) uint8 RGB; what is transparent is black.

    Raises `PerceptionError` for what is no image, is cut off, or has more than `MAX_PIXELS`.
    """
    _check_file(path, "image", IMAGE_SUFFIXES)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's, of odd metadata
            with _opened(path) as picture:
                width, height = picture.size
                _check_size(path, width, height)
                return _rgb(path, ImageOps.exif_transpose(picture))
    except PerceptionError:
        raise
    except UnidentifiedImageError:
        empty = "is empty" if path.stat().st_size == 0 else "is no image"
        raise PerceptionError(f"{_quoted(path)} {empty}; valid: {_listed(IMAGE_SUFFIXES)}") from None
    except MemoryError:
        raise PerceptionError(f"{_quoted(path)} does not fit into memory") from None
    except Exception as error:  # Pillow's decoders raise nearly anything for broken files
        raise PerceptionError(f"cannot read the image {_quoted(path)}: {_reason(error)}") from None


def read_mask(path: Path) -> NDArray[np.bool_]:
    """A picture as a mask, (height, width) bool: true where it is not black, or in a JPEG brighter than its
    noise."""
    black = JPEG_NOISE if path.suffix.lower() in (".jpg", ".jpeg") else 0
    mask: NDArray[np.bool_] = read_image(path).max(axis=2) > black
    return mask


def fitting(path: Path, mask: NDArray[np.bool_], size: tuple[int, int]) -> NDArray[np.bool_]:
    """The mask (height, width) that was read from `path`, if it is of `size` (width, height); raises
    `PerceptionError` else."""
    if mask.shape != size[::-1]:
        raise PerceptionError(
            f"the mask {_quoted(path)} is {mask.shape[1]}x{mask.shape[0]} pixels; "
            f"valid for this image: {size[0]}x{size[1]}"
        )
    return mask


def _opened(path: Path) -> Pictures.Image:
    """The picture behind a header, not decoded yet. The library's own limit is left out here, for its
    message does not tell the size; ours comes next."""
    limit, Pictures.MAX_IMAGE_PIXELS = Pictures.MAX_IMAGE_PIXELS, None
    try:
        return Pictures.open(path, formats=FORMATS)
    finally:
        Pictures.MAX_IMAGE_PIXELS = limit


def _check_file(path: Path, what: str, suffixes: tuple[str, ...]) -> None:
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        raise PerceptionError(f"cannot read the {what} {_quoted(path)}: {_reason(error)}") from None
    if not stat.S_ISREG(mode):  # a pipe would be waited for, a device read without end
        raise PerceptionError(f"{_quoted(path)} is no regular file; valid: {_listed(suffixes)}")


def _check_size(path: Path, width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise PerceptionError(
            f"{_quoted(path)} is {width}x{height} pixels; valid: at most {MAX_PIXELS // 10**6} million"
        )


def _rgb(path: Path, picture: Pictures.Image) -> Image:
    if picture.mode == "F":
        raise PerceptionError(f"{_quoted(path)} has floating point pixels; valid: whole numbers")
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
        raise PerceptionError(f"cannot read the folder {_quoted(path)}: {_reason(error)}") from None
    names = [name for name in names if not os.path.isdir(path / name)]
    if not names:
        raise PerceptionError(f"no image in the folder {_quoted(path)}; valid: {_listed(IMAGE_SUFFIXES)}")
    for name in names:
        try:
            yield name, read_image(path / name)
        except PerceptionError as error:
            yield name, error


def _video(path: Path) -> Iterator[tuple[str, Image | PerceptionError]]:
    import cv2

    _check_file(path, "video", VIDEO_SUFFIXES)
    name = str(path.resolve())  # in full, as FFmpeg takes some names for addresses
    try:
        name.encode()  # or OpenCV crashes
    except UnicodeError:
        raise PerceptionError(f"the name of the video {_quoted(path)} is not UTF-8; rename it") from None
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        reader = cv2.VideoCapture(name, cv2.CAP_FFMPEG)  # others take '%' for a series of images
    finally:
        cv2.utils.logging.setLogLevel(level)
    try:
        if not reader.isOpened():
            raise PerceptionError(
                f"{_quoted(path)} is no video that can be read; valid: {_listed(VIDEO_SUFFIXES)}"
            )
        _check_size(
            path, int(reader.get(cv2.CAP_PROP_FRAME_WIDTH)), int(reader.get(cv2.CAP_PROP_FRAME_HEIGHT))
        )
        count = 0
        while (answer := reader.read())[0]:
            yield f"{path.name}-{count:05d}", np.asarray(cv2.cvtColor(answer[1], cv2.COLOR_BGR2RGB), np.uint8)
            count += 1
        if count == 0:
            raise PerceptionError(f"the video {_quoted(path)} has no frame that can be read")
        announced = int(reader.get(cv2.CAP_PROP_FRAME_COUNT))
        if count < COMPLETE * announced - 1:
            told = (
                f"only {count} of about {announced} frames of {_quoted(path)} could be read: is it cut off?"
            )
            yield f"{path.name}-{count:05d}", PerceptionError(told)
    except cv2.error as error:
        raise PerceptionError(f"cannot read the video {_quoted(path)}: {_reason(error)}") from None
    finally:
        reader.release()


def _quoted(path: Path) -> str:
    """`path` on one line; of a long one its end, for the file's name is there."""
    flat = one_line(path, 100_000)
    return f"'{flat}'" if len(flat) <= 160 else f"'...{flat[-157:]}'"


def _reason(error: Exception) -> str:
    strerror = error.strerror if isinstance(error, OSError) else None
    return one_line(strerror or error) or type(error).__name__


def _listed(suffixes: tuple[str, ...]) -> str:
    return ", ".join(suffix[1:] for suffix in suffixes)
