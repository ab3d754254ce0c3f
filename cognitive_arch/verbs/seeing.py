"""`cogarch see`: what is in an image, in a folder of images, or in a video."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cognitive_arch.errors import PerceptionError, one_line
from cognitive_arch.verbs.common import Json, Stopped, print_answer

if TYPE_CHECKING:
    from cognitive_arch.perception.calibration import TableView
    from cognitive_arch.perception.images import Image
    from cognitive_arch.perception.vision import Recogniser, SeenBlob


def see(
    source: Annotated[Path, typer.Argument(metavar="IMAGE", help="An image, a folder of them, or a video.")],
    mask: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Where things are: not black there; instead of a segmenter's mask."
        ),
    ] = None,
    ignore: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Where nothing is to be found, such as the robot's hands: not black."
        ),
    ] = None,
    segmenter: Annotated[str, typer.Option(help="colour or texture.")] = "colour",
    domain: Annotated[
        str | None, typer.Option(help="Name what is seen as things of this domain, or as unknown.")
    ] = None,
    margin: Annotated[
        int | None,
        typer.Option(
            help="Pixels added around what the segmenter finds, which keeps blobs apart: by default 2 for "
            "colour, as a camera blurs edges, and 0 for texture. Rendered pictures need 0."
        ),
    ] = None,
    formulas: Annotated[
        str, typer.Option(help="The descriptors' formulas: shapeDescriptor or blobDescriptor.")
    ] = "shapeDescriptor",
    min_area: Annotated[int, typer.Option(min=1, help="Pixels; smaller blobs are left out.")] = 60,
    camera: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The camera's calibration and the table's height: tell places in metres."
        ),
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write the annotated pictures there.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Find things in an image and describe their shapes, of the whole and of both halves."""
    from cognitive_arch.errors import unknown
    from cognitive_arch.perception import descriptors, images, segmentation, vision
    from cognitive_arch.perception.calibration import read_calibration

    find = segmentation.make_segmenter(segmenter)
    wider = segmentation.MARGINS[segmenter] if margin is None else margin
    segmentation.check_margin(wider)
    if formulas not in descriptors.FORMULAS:
        raise PerceptionError(unknown("set of formulas", formulas, descriptors.FORMULAS))
    names = None if domain is None else _recogniser(domain)
    view = None if camera is None else read_calibration(camera)
    if save is not None:
        _make_folder(save)
    masks = [(path, images.read_mask(path)) if path is not None else None for path in (mask, ignore)]
    answers: list[dict[str, Any]] = []
    try:
        for name, image in images.frames(source):
            try:
                if isinstance(image, PerceptionError):
                    raise image
                size = (image.shape[1], image.shape[0])
                given, hidden = (None if one is None else images.fitting(*one, size) for one in masks)
                if view is not None:
                    view.check(size)
            except PerceptionError as error:
                if not (os.path.isdir(source) or image is error):
                    raise
                answers.append({"image": name, "error": str(error)})  # the folder's others may be usable
                continue
            seen = vision.see(
                *(image, find, given, hidden),
                recogniser=names,
                formulas=formulas,
                min_area=min_area,
                margin=wider,
            )
            answers.append(_answer(name, image, seen, view))
            if save is not None:
                answers[-1]["annotated"] = str(_save(save, name, image, seen))
    except KeyboardInterrupt:
        raise Stopped(f"{len(answers)} images seen" + (f", pictures are in {save}" if save else "")) from None
    used = {
        "segmenter": "given mask" if mask else segmenter,
        "margin": 0 if mask else wider,
        "domain": domain,
        "formulas": formulas,
    }
    failed = sum("error" in answer for answer in answers)
    if images.is_many(source):
        whole = {"source": str(source), **used, "failed": failed, "images": answers}
    else:
        whole = {**answers[0], **used}
    print_answer(whole, "\n".join(map(_text, answers)), as_json)
    if failed:
        raise typer.Exit(1)


def _recogniser(domain: str) -> Recogniser:
    from cognitive_arch.perception.recognition import load_recogniser

    return load_recogniser(domain)


def _answer(name: str, image: Image, seen: list[SeenBlob], view: TableView | None) -> dict[str, Any]:
    blobs = [one.to_json() for one in seen]
    if view is not None:
        for one, told in zip(seen, blobs, strict=True):
            told["place"] = view.place(one.blob.centroid)
    return {"image": name, "width": image.shape[1], "height": image.shape[0], "blobs": blobs}


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PerceptionError(f"cannot write pictures to '{one_line(folder)}': {error.strerror}") from None


def _save(folder: Path, name: str, image: Image, seen: list[SeenBlob]) -> Path:
    from PIL import Image as Pictures

    from cognitive_arch.perception.vision import annotated

    path = folder / f"{name}.seen.png"
    try:
        Pictures.fromarray(annotated(image, seen)).save(path)
    except OSError as error:
        raise PerceptionError(f"cannot write the picture '{one_line(path)}': {error.strerror}") from None
    return path


def _text(answer: dict[str, Any]) -> str:
    if "error" in answer:
        return f"{answer['image']}: {answer['error']}"
    lines = [f"{answer['image']}: {answer['width']}x{answer['height']}, {len(answer['blobs'])} blobs"]
    for number, blob in enumerate(answer["blobs"], start=1):
        whole = blob["descriptors"]["whole"]
        shape = " ".join(
            f"{name} {whole[name]:.2f}"
            for name in ("convexity", "eccentricity", "compactness", "circularity", "squareness")
        )
        name = "" if blob["label"] is None else f"{blob['label']} ({blob['probability']:.2f})  "
        x, y = blob["centroid"]
        lines += [f"  {number:>2}  {name}at {x:.0f}, {y:.0f}  {blob['area']} pixels{_place(blob)}"]
        lines += [f"      {shape}"]
    if "annotated" in answer:
        lines.append(f"  picture: {answer['annotated']}")
    return "\n".join(lines)


def _place(blob: dict[str, Any]) -> str:
    if "place" not in blob:
        return ""
    if blob["place"] is None:
        return "  not on the table"
    (x, y), ((xx, _), (_, yy)) = blob["place"]["position"], blob["place"]["covariance"]
    return f"  on the table at {x:.3f}, {y:.3f} m (+- {xx**0.5:.3f}, {yy**0.5:.3f})"


def register(app: typer.Typer) -> None:
    """Add this verb to the command line."""
    app.command()(see)
