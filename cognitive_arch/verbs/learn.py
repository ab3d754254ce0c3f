"""`cogarch learn`: what the robot knows from examples and from trials, made again."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from cognitive_arch.verbs.common import Json, SeedOption, print_answer

app = typer.Typer(
    help="Learn: what objects look like (objects), what can be done with them (networks).",
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def learn() -> None:
    """Learn from examples and from trials."""


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


@app.command()
def networks(
    trials: Annotated[
        str,
        typer.Argument(
            metavar="TRIALS",
            help="A file of trials (.csv, .parquet, .npz); explored, explored-hand, explored-tool (the "
            "robot's own, which come along); or, with --data, a published table: hand, tool, icub_tools, "
            "tools_2016.",
        ),
    ] = "explored",
    model: Annotated[
        str,
        typer.Option(
            help="default; full, pca, pca-two-blocks, k2, bde, bde-annealed, mcmc (the thesis' networks); "
            "majority, forest, logistic (to compare with)."
        ),
    ] = "default",
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Keep what was learned, for cogarch query.")
    ] = None,
    graph: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the network (.png, .svg, .dot) or write it (.bif)."),
    ] = None,
    evaluate: Annotated[
        int, typer.Option(metavar="SPLITS", help="Measure it on so many splits, beside the baselines.")
    ] = 0,
    protocol: Annotated[
        str,
        typer.Option(
            help="trial, views, leave-one-object-out, leave-one-manipulator-out, or published (leaky: views "
            "of one trial on both sides)."
        ),
    ] = "trial",
    reliability: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw how sure it was against how right (.png, .svg)."),
    ] = None,
    descriptors: Annotated[
        str | None,
        typer.Option(help="Learn from these descriptors only, such as area,convexity [default: all]."),
    ] = None,
    data: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder with the published tables.")
    ] = None,
    seed: SeedOption = 0,
    as_json: Json = False,
) -> None:
    """Learn from trials what actions with hands and tools do to objects."""
    from cognitive_arch.affordances import answers, evaluation, features
    from cognitive_arch.errors import ConfigError, unknown

    if evaluate < 0:
        raise ConfigError(f"{evaluate} splits; valid: 0 (do not measure) or more")
    if protocol not in evaluation.PROTOCOLS:
        raise ConfigError(unknown("protocol", protocol, evaluation.PROTOCOLS))
    if reliability is not None and not evaluate:
        raise ConfigError("--reliability needs --evaluate SPLITS")
    table = answers.load_table(trials, data)
    if descriptors is not None:
        table = features.described_by(table, [name.strip() for name in descriptors.split(",")])
    answer = answers.learn(
        table,
        model,
        out,
        graph,
        answers.Study(protocol, evaluate, reliability),
        seed,
        lambda text: print(text, file=sys.stderr),
    )
    print_answer(answer, answers.learn_text(answer), as_json)
