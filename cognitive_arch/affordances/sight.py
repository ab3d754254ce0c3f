"""Things seen in pictures, as things to ask about: the descriptors of their blobs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cognitive_arch.affordances.queries import Thing
from cognitive_arch.errors import AffordanceError, one_line, unknown

SUFFIXES = (".png", ".jpg", ".jpeg", ".ppm", ".bmp")
HALVES = ("top", "bottom")


def is_picture(text: str) -> bool:
    """Whether `text` names a picture, such as `view.png` or `view.png#2`."""
    return Path(text.partition("#")[0]).suffix.lower() in SUFFIXES


def check_formulas(name: str) -> None:
    """Raises `AffordanceError` where there is no such set of formulas."""
    from cognitive_arch.perception.descriptors import FORMULAS

    if name not in FORMULAS:
        raise AffordanceError(unknown("set of formulas", name, FORMULAS))


def seen_thing(text: str, part: str, names: Sequence[str], formulas: str) -> Thing:
    """The thing in a picture: `FILE` for its largest blob, `FILE#N` for the N-th from the top, from 1 on.

    `part` is whole (acted objects), top or bottom (the effector half of what is held); `names` are the
    descriptors wanted, by the table `formulas` of `perception.descriptors`. Raises `PerceptionError` for
    unusable pictures and `AffordanceError` for blobs and descriptors that are not there.
    """
    from cognitive_arch.perception import images, segmentation, vision

    check_formulas(formulas)
    file, _, number = text.partition("#")
    image = images.read_image(Path(file))
    # As `cogarch see` does, so that blobs have the same numbers and shapes.
    margin = segmentation.MARGINS["colour"]
    seen = vision.see(image, segmentation.make_segmenter("colour"), formulas=formulas, margin=margin)
    if not seen:
        raise AffordanceError(f"nothing is seen in '{one_line(file)}'")
    if not number:
        chosen = max(seen, key=lambda one: one.blob.area)
    elif number.isdigit() and 1 <= int(number) <= len(seen):
        chosen = seen[int(number) - 1]
    else:
        raise AffordanceError(
            f"there is no blob '{one_line(number, 20)}' in '{one_line(file)}'; valid: 1 to {len(seen)}"
        )
    missing = [name for name in names if name not in chosen.descriptions.whole]
    if missing:
        raise AffordanceError(f"descriptors {', '.join(missing)} cannot be computed from a picture")
    return Thing(Path(text).name, chosen.descriptions.vector([part], names))
