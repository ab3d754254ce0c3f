"""Learning what a domain's objects look like, and how well that is known: on views that were held out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from cognitive_arch.domain import load_domain
from cognitive_arch.errors import PerceptionError, one_line
from cognitive_arch.execution.backends import drake_module
from cognitive_arch.perception.recognition import UNKNOWN, ObjectRecogniser, digest, recogniser_path
from cognitive_arch.perception.recognition_training import calibrate, describe, fit

VARIANTS = 2  # in which every view is learnt from besides itself
VIEWS = (20, 20_000)  # that may be asked for
HELD_OUT = 8  # views to learn from for every one to test with
WEIGHED = 4  # the same for those to calibrate with
TEST_SEED, CALIBRATION_SEED = 99, 55  # added to the seed
TO_LEARN = 0.5  # of a stranger must be in view to learn from it: a part of one may look like anything
MOSTLY = 0.8  # of a thing is in view where it counts as a view to recognise it from
HALF = 0.5  # the same for the harder test, told beside it


def learn_objects(
    domain_name: str, views: int, seed: int, out: Path | None, progress: Callable[[str], None]
) -> dict[str, Any]:
    """Render `views` pictures of a domain's objects, train on them, test on others, and write the result to
    `out` or beside the domain.

    Returns what was made: objects, examples, how many of the test's views were right, and the file. The
    same arguments give the same recogniser. Raises a `CogArchError` for an unknown domain, a number of
    views out of range, a file that cannot be written, or where nothing can be rendered.
    """
    domain = load_domain(domain_name)
    path = recogniser_path(domain_name) if out is None else out
    if not VIEWS[0] <= views <= VIEWS[1]:
        raise PerceptionError(f"{views} views are out of range; valid: {VIEWS[0]} to {VIEWS[1]}")
    if path.suffix != ".npz" or not path.parent.is_dir():
        raise PerceptionError(
            f"cannot write '{one_line(path)}'; valid: a file that ends in .npz in a folder that exists"
        )
    render = drake_module("sim.views").examples
    progress(f"rendering {views} views")
    shown = render(domain, views, np.random.default_rng(seed))
    chosen = ((e.image, e.mask, e.name) for e in shown if e.visible > TO_LEARN or e.name != UNKNOWN)
    learnt = describe(chosen, np.random.default_rng(seed + 1), VARIANTS)
    progress(f"learning from {len(learnt.names)} examples")
    command = f"cogarch learn objects --domain {domain_name} --views {views} --seed {seed}"
    told = {"domain": domain_name, "command": command, "views": views, "seed": seed, "looks": digest(domain)}
    recogniser = fit(learnt, sorted(domain.objects), told, seed)
    held_out, calibrating = -(-views // HELD_OUT), -(-views // WEIGHED)
    progress(f"weighing known against unknown on {calibrating} views")
    weighed = render(domain, calibrating, np.random.default_rng(seed + CALIBRATION_SEED))
    chosen = ((e.image, e.mask, e.name) for e in weighed if e.visible >= MOSTLY)
    calibrate(recogniser, describe(chosen, np.random.default_rng(seed)))
    progress(f"testing on {held_out} views with strangers of other kinds")
    tested = render(domain, held_out, np.random.default_rng(seed + TEST_SEED), test=True)
    scores = score(recogniser, tested)
    recogniser = ObjectRecogniser(**{**vars(recogniser), "told": {**told, "test": scores}})
    recogniser.save(path)
    return {
        "domain": domain_name,
        "objects": sorted(domain.objects),
        "examples": len(learnt.names),
        "seed": seed,
        "file": str(path),
        **scores,
    }


def score(recogniser: ObjectRecogniser, tested: Iterable[Any]) -> dict[str, Any]:
    """How well a recogniser does on examples of `sim.views`: for things of which at least 80 % is in view,
    the share of known ones that get their name and of strangers that are called unknown; the same for half
    of a thing in view, and the numbers of examples."""
    right: dict[str, list[bool]] = {f"{who}_{part}": [] for who in ("known", "unknown") for part in "mh"}
    for example in tested:
        if example.visible < HALF:
            continue
        answer, _ = recogniser.classify(example.image, example.mask)[0]
        who = "unknown" if example.name == UNKNOWN else "known"
        right[f"{who}_h"].append(answer == example.name)
        if example.visible >= MOSTLY:
            right[f"{who}_m"].append(answer == example.name)
    scores: dict[str, Any] = {}
    for who in ("known", "unknown"):
        for part, suffix in (("m", ""), ("h", "_half_hidden")):
            answers = right[f"{who}_{part}"]
            scores[f"{who}_right{suffix}"] = round(float(np.mean(answers)), 4) if answers else None
            scores[f"{who}_examples{suffix}"] = len(answers)
    return scores
