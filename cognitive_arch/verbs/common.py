"""What the verbs share: options of the same meaning, and how an answer is printed."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]
SceneOption = Annotated[
    str,
    typer.Option(
        "--scene", help="A scene's name, random:SEED[:DOMAIN[:NUMBER]], or the path of a scene file."
    ),
]
RulesOption = Annotated[
    str | None, typer.Option("--rules", help="A rules file to use instead of the domain's own.")
]
StoreOption = Annotated[
    Path, typer.Option("--store", envvar="COGARCH_STORE", help="Folder where runs are kept.")
]
PlannerOption = Annotated[
    str, typer.Option(help="guided-prada, a-prada, prada, uct, sst, or one that another package adds.")
]
SeedOption = Annotated[int, typer.Option(help="Seed of everything random.")]


class Stopped(Exception):
    """Ctrl-C with something to say; no `KeyboardInterrupt`, which the argument parser would swallow."""


def print_answer(data: dict[str, Any], text: str, as_json: bool) -> None:
    """Print the answer of a verb on stdout: `data` as JSON, or `text`."""
    shown = json.dumps(data, sort_keys=False, allow_nan=False) if as_json else text
    try:
        if shown:
            print(shown, flush=True)
    except BrokenPipeError:
        # The reader went away (cogarch inspect | head); nothing is wrong with what was done.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
