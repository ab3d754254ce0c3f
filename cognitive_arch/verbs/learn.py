"""`cogarch learn`: what the robot knows from examples, made again."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from cognitive_arch.verbs.common import Json, SeedOption, print_answer

app = typer.Typer(
    help="Learn again from examples: what objects look like.",
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def learn() -> None:
    """Learn again from examples."""


@app.command()
def objects(
    domain: Annotated[str, typer.Option(help="Whose objects to learn: a folder of domains/.")],
    views: Annotated[int, typer.Option(help="How many pictures to render to learn from.")] = 1600,
    seed: SeedOption = 0,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.npz", help="Where to write it instead of to the domain.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Learn what a domain's objects look like, from rendered pictures; do this when one was added."""
    from cognitive_arch.evaluation.recognition import learn_objects

    def progress(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    made = learn_objects(domain, views, seed, out, progress)
    text = (
        f"learnt {len(made['objects'])} objects of {domain} from {made['examples']} examples\n"
        f"held-out views right: {made['known_right']:.1%}, "
        f"unknown things called unknown: {made['unknown_right']:.1%}\nwrote {made['file']}"
    )
    print_answer(made, text, as_json)
