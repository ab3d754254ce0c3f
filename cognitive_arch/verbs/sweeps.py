"""`cogarch sweep` and `cogarch reproduce`: evaluations of many episodes."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from cognitive_arch.errors import ConfigError, unknown
from cognitive_arch.verbs.common import Json, SeedOption, Stopped, print_answer

JobsOption = Annotated[int, typer.Option(help="How many processes share the work on this machine.")]
SCENES = "Scenes, separated by commas; as for run."


def sweep(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for rows, summary, figures and page.")],
    scene: Annotated[str, typer.Option(help=SCENES)] = "simple",
    backend: Annotated[str, typer.Option(help="symbolic, drake, or both with a comma.")] = "symbolic",
    noise: Annotated[str, typer.Option(help="The levels to sweep.")] = "0,0.25,0.5,0.75,0.95",
    vary: Annotated[
        str,
        typer.Option(
            help="Whose noise is swept: both (arms and what they do with tools), left, right, pull, push, or "
            "several joined by +; a list is swept one after the other."
        ),
    ] = "both",
    fixed: Annotated[float, typer.Option(help="The noise level of what is not varied.")] = 0.25,
    heuristics: Annotated[
        str,
        typer.Option(
            help="Sets of heuristics: none, all, or names joined by +; sets are separated by commas."
        ),
    ] = "none,creativity,adaptability,adaptability+creativity",
    planner: Annotated[str, typer.Option(help="Planners, separated by commas; as for run.")] = "guided-prada",
    episodes: Annotated[int, typer.Option(help="Episodes a point.")] = 100,
    seed: SeedOption = 0,
    jobs: JobsOption = 1,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler whose workers do it instead.")
    ] = None,
    task: Annotated[str, typer.Option(help="What the robot is told.")] = "make a ham sandwich",
    coin: Annotated[
        str,
        typer.Option(
            help="symbolic: text (put and drop as noisy as the arm) or published (they never fail)."
        ),
    ] = "text",
    jitter: Annotated[
        float, typer.Option(help="Move the objects by up to this many metres at the start.")
    ] = 0.0,
    memory: Annotated[
        bool, typer.Option("--memory/--no-memory", help="Remember plans; the rows are the same either way.")
    ] = True,
    beside: Annotated[
        list[Path],
        typer.Option(metavar="DIR", help="Another sweep to show in the same figures; may be repeated."),
    ] = [],  # noqa: B006 (typer wants a list)
    as_json: Json = False,
) -> None:
    """Run many episodes under noise, for every combination of settings, and draw figures."""
    from cognitive_arch.evaluation import report
    from cognitive_arch.evaluation.results import read_rows, write_results
    from cognitive_arch.evaluation.running import run_sweep
    from cognitive_arch.evaluation.sweep import SweepConfig, parse_heuristics, parse_levels, split

    config = SweepConfig(
        scenes=split(scene),
        backends=split(backend),
        planners=split(planner),
        vary=split(vary),
        heuristics=parse_heuristics(heuristics),
        noise=parse_levels(noise),
        fixed=fixed,
        episodes=episodes,
        seed=seed,
        sentence=task,
        coin=coin,
        jitter=jitter,
    )
    for other in beside:
        read_rows(other)

    def work(on_rows: Callable[[int, int], None], on_notice: Callable[[str], None]) -> dict[str, Any]:
        settings = {"jobs": jobs, "dask": dask, "remember": memory}
        done = run_sweep(config, out, command(), on_rows=on_rows, on_notice=on_notice, **settings)  # type: ignore[arg-type]
        return report.sweep_answer(out, config, done, write_results(out, beside))

    answer = _carry_out(work, f"go on with: {command()}")
    print_answer(answer, report.sweep_text(answer), as_json)


def reproduce(
    name: Annotated[
        str | None, typer.Argument(help="Which table or figure; without it they are listed.")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder with the data sets it needs.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder for its files [default: reproduced/NAME, with episodes and seed if given].",
        ),
    ] = None,
    episodes: Annotated[
        int | None, typer.Option(help="Episodes a point (or splits), other than published.")
    ] = None,
    trials: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Affordance trials of your own (table8 to fig47).")
    ] = None,
    protocol: Annotated[
        str, typer.Option(help="How affordance trials are split: trial, views, or published (leaky).")
    ] = "trial",
    seed: SeedOption = 0,
    jobs: JobsOption = 1,
    as_json: Json = False,
) -> None:
    """Recompute a published table or figure, ours beside it; exit code 1 if they do not agree."""
    from cognitive_arch.evaluation import reproduction

    if name is None:
        return print_answer(reproduction.listing(), reproduction.listing_text(), as_json)
    if episodes is not None and episodes < 1:
        raise ConfigError(f"{episodes} episodes; valid: 1 or more")
    if protocol not in ("trial", "views", "published"):
        raise ConfigError(unknown("protocol", protocol, ("trial", "views", "published")))
    named = [name, *([f"episodes-{episodes}"] if episodes else []), *([f"seed-{seed}"] if seed else [])]
    folder = out or Path("reproduced") / "-".join(named)

    def work(on_rows: Callable[[int, int], None], on_notice: Callable[[str], None]) -> dict[str, Any]:
        options = reproduction.Options(
            folder, data, episodes, seed, jobs, trials, protocol, on_rows, on_notice
        )
        return reproduction.reproduce(name, options)

    answer = _carry_out(work, f"what is finished is kept, go on with: {command()}")
    print_answer(answer, reproduction.answer_text(answer), as_json)
    if not answer["success"]:
        raise typer.Exit(1)


def command() -> str:
    """What was typed, as it can be typed again."""
    return shlex.join(["cogarch", *sys.argv[1:]])


def _carry_out(
    work: Callable[[Callable[[int, int], None], Callable[[str], None]], dict[str, Any]], advice: str
) -> dict[str, Any]:
    """Do it behind a progress bar; Ctrl-C says how to go on."""
    from cognitive_arch.evaluation.report import Bar

    try:
        with Bar() as bar:
            return work(bar.update, bar.notice)
    except KeyboardInterrupt as stopped:
        told = f"{stopped}; {advice}" if str(stopped) else advice
        raise Stopped(told) from None


def register(app: typer.Typer) -> None:
    """Add these verbs to the command line."""
    app.command()(sweep)
    app.command()(reproduce)
