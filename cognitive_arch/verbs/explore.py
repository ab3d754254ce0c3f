"""`cogarch explore`: the robot tries what its hands and tools do to things."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cognitive_arch.verbs.common import Json, SeedOption, Stopped, print_answer
from cognitive_arch.verbs.sweeps import JobsOption, command


def explore(
    out: Annotated[
        Path,
        typer.Option(metavar="FILE.csv", help="Where the trials go; if some are there already, it goes on."),
    ],
    kind: Annotated[
        str, typer.Option(help="hand (bare, in three postures), tool, or both (three of ten with a hand).")
    ] = "both",
    trials: Annotated[int, typer.Option(help="How many trials there are to be in the end.")] = 100,
    seed: SeedOption = 0,
    jobs: JobsOption = 1,
    picture: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Keep a picture of each trial, before and after.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Let the simulated robot try actions on objects, and note what they do: trials to learn from."""
    from cognitive_arch.evaluation import exploration
    from cognitive_arch.evaluation.report import Bar

    config = exploration.ExploreConfig(kind, trials, seed)
    try:
        with Bar("trials") as bar:
            done = exploration.explore(
                config, out, command(), jobs=jobs, pictures=picture, on_rows=bar.update
            )
    except KeyboardInterrupt as stopped:
        told = f"{stopped}; go on with: {command()}" if str(stopped) else f"go on with: {command()}"
        raise Stopped(told) from None
    answer = exploration.summary(out, done)
    print_answer(answer, exploration.summary_text(answer), as_json)


def register(app: typer.Typer) -> None:
    """Add this verb to the command line."""
    app.command()(explore)
