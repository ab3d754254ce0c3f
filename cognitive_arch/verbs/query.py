"""`cogarch query`: questions about what can be done with things."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cognitive_arch.verbs.common import Json, print_answer

DESCRIBED = (
    "by name, by its descriptors (convexity=0.9,eccentricity=0.4,...), or as seen in a picture: "
    "FILE for the largest blob, FILE#2 for the second from the top"
)


def query(
    learned: Annotated[
        Path | None,
        typer.Argument(
            metavar="MODEL",
            help="What cogarch learn networks kept (--out FILE.json) [default: what the robot learned from "
            "its own exploration].",
        ),
    ] = None,
    action: Annotated[
        str | None, typer.Option(help="tapFromRight, tapFromLeft, pull or push; left open without it.")
    ] = None,
    manipulator: Annotated[str | None, typer.Option(help=f"The hand's posture or tool, {DESCRIBED}")] = None,
    acted: Annotated[str | None, typer.Option("--object", help=f"The acted object, {DESCRIBED}")] = None,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Where the object stands, metres in the root frame.")
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            help="A wished effect: closer, away, left, right, still, several joined by +, or bins such as "
            "'x=LP,VP;y=NM'. Then the answer is a choice: of a tool (with --action), else of an action."
        ),
    ] = None,
    tools: Annotated[
        str | None, typer.Option(help="Tools to choose from, separated by commas [default: all known].")
    ] = None,
    half: Annotated[
        str, typer.Option(help="Which half of a seen manipulator touches the object: top or bottom.")
    ] = "top",
    formulas: Annotated[
        str, typer.Option(help="Formulas of descriptors in pictures: shapeDescriptor or blobDescriptor.")
    ] = "shapeDescriptor",
    picture: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the effects on the table (.png, .svg).")
    ] = None,
    as_json: Json = False,
) -> None:
    """Ask what an action will do, or which action or tool to take."""
    from cognitive_arch.affordances import answers
    from cognitive_arch.affordances.registry import Affordances
    from cognitive_arch.resources import learned_affordances

    question = answers.Question(
        action=action,
        manipulator=manipulator,
        object=acted,
        start=answers.parse_place(start),
        goal=goal,
        tools=tuple(part.strip() for part in tools.split(",")) if tools else (),
        half=half,
        formulas=formulas,
    )
    answer = answers.ask(Affordances.load(learned or learned_affordances()), question, picture)
    print_answer(answer, answers.ask_text(answer), as_json)


def register(app: typer.Typer) -> None:
    """Add this verb to the command line."""
    app.command()(query)
