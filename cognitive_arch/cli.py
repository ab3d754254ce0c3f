"""The command line: arguments -> library calls, nothing else.

Heavy imports stay inside the commands, so that `--help` is quick.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cognitive_arch import __version__
from cognitive_arch.errors import CogArchError, ConfigError, one_line
from cognitive_arch.verbs import explore, learn, query, seeing, sweeps
from cognitive_arch.verbs.common import (
    Json,
    PlannerOption,
    RulesOption,
    SceneOption,
    SeedOption,
    Stopped,
    StoreOption,
    print_answer,
)

if TYPE_CHECKING:
    from cognitive_arch.session import Progress

INTERRUPTED = 130

app = typer.Typer(
    name="cogarch",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Give a simulated iCub a sentence, watch it plan and act, and see why it did each thing.",
)

RecordOption = Annotated[
    bool, typer.Option("--record/--no-record", help="Keep a Meshcat recording and pictures (drake).")
]
VideoOption = Annotated[bool, typer.Option("--video", help="Make a video of the run, too (drake).")]
PerceptionOption = Annotated[
    str | None,
    typer.Option(
        help="How the robot knows its table: camera (drake's own way), noisy-camera, oracle (the simulation)."
    ),
]
AffordancesOption = Annotated[
    str | None,
    typer.Option(
        metavar="SOURCE",
        help="What the robot knows tools are good for: learned (from their shapes), default (the rules' own "
        "numbers), none (any tool may pull), or FILE.json of cogarch learn networks.",
    ),
]
EventOption = Annotated[
    list[str],
    typer.Option(
        "--event",
        metavar="STEP:KIND:NAME[:X,Y]",
        help="What happens from outside before that step, such as 3:remove:Tomato, 2:move:Ham:-0.35,0.10, "
        "4:add:Cheese:-0.3,0.1, 4:topple:Ham, 2:empty:LeftHand. May be given several times.",
    ),
]
Sentence = Annotated[str, typer.Argument(help='What to do, for example "make a ham sandwich".')]


@app.callback(invoke_without_command=True)
def options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    """Options of the command itself."""
    if version:
        print(__version__)
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
def parse(
    sentence: Sentence, scene: SceneOption = "simple", rules: RulesOption = None, as_json: Json = False
) -> None:
    """Show what a sentence means: semantic instructions and sub-goals, without acting."""
    from cognitive_arch import report
    from cognitive_arch.session import Setting

    task = Setting.load(scene, rules).understand(sentence)
    print_answer(task.to_json(), report.task_text(task), as_json)


@app.command()
def run(
    context: typer.Context,
    sentence: Annotated[
        str | None, typer.Argument(help='What to do, for example "make a ham sandwich".')
    ] = None,
    resume: Annotated[
        str | None,
        typer.Option(
            metavar="RUN", help="Go on with an interrupted run: its id, the start of one, or 'latest'."
        ),
    ] = None,
    scene: SceneOption = "simple",
    backend: Annotated[str, typer.Option(help="drake (physics) or symbolic (a coin).")] = "drake",
    noise: Annotated[
        str, typer.Option(help="Noise level: one number, or left=0.5,right=0.25,pull=0,push=0.")
    ] = "0",
    heuristics: Annotated[
        str,
        typer.Option(
            help="none, all (the published three), or a list of adaptability,creativity,goal_maintenance; or "
            "reliability, which takes the place of the first two."
        ),
    ] = "all",
    planner: PlannerOption = "guided-prada",
    seed: SeedOption = 0,
    jitter: Annotated[
        float, typer.Option(help="Move the objects by up to this many metres, and turn them, at the start.")
    ] = 0.0,
    reach: Annotated[
        str | None,
        typer.Option(
            help="How the robot knows what it reaches: kinematic (drake's own way) or published (constants)."
        ),
    ] = None,
    perception: PerceptionOption = None,
    affordances: AffordancesOption = None,
    rules: RulesOption = None,
    event: EventOption = [],  # noqa: B006 (typer wants a list)
    store: StoreOption = Path("runs"),
    record: RecordOption = True,
    video: VideoOption = False,
    as_json: Json = False,
) -> None:
    """Do what a sentence asks for: look, plan, act, notice what went wrong, find another way."""
    from cognitive_arch.execution.heuristics import Heuristics
    from cognitive_arch.execution.noise import NoiseLevels
    from cognitive_arch.outside import OutsideEvent
    from cognitive_arch.runs import resume_task, run_task
    from cognitive_arch.session import RunConfig

    if resume is not None:
        _check_alone(context, "--resume", {"resume", "store", "as_json"})
        _carry_out(lambda progress: resume_task(resume, store, progress), store, as_json)
        return
    if sentence is None:
        raise ConfigError('give a sentence, such as "make a ham sandwich", or --resume RUN')
    task = sentence
    config = RunConfig(
        scene=scene,
        backend=backend,
        noise=NoiseLevels.parse(noise),
        heuristics=Heuristics.parse(heuristics),
        planner=planner,
        seed=seed,
        jitter=jitter,
        reach=reach,
        perception=perception,
        affordances=affordances,
        rules=rules,
        record=record,
        video=video,
        events=tuple(map(OutsideEvent.parse, event)),
    )
    _carry_out(lambda progress: run_task(task, config, store, progress), store, as_json)


def _check_alone(context: typer.Context, option: str, allowed: set[str]) -> None:
    """Refuse whatever was given besides `option` and would contradict what it names."""
    for parameter in context.command.params:
        name = str(parameter.name)
        source = context.get_parameter_source(name)
        if name not in allowed and source is not None and source.name == "COMMANDLINE":
            given = "a sentence" if name == "sentence" else parameter.opts[0]
            raise ConfigError(f"{option} takes no {given.removeprefix('a ')}: a run goes on as it was begun")


def _carry_out(work: Callable[[Progress], dict[str, Any]], store: Path, as_json: bool) -> None:
    """Do a run, tell of it meanwhile, and print how it ended."""
    from cognitive_arch import report
    from cognitive_arch.runs import RunInterrupted

    try:
        with report.LiveProgress(quiet=as_json) as live:
            result = work(live.progress)
    except RunInterrupted as stopped:
        command = report.resume_command(stopped.run_id, store)
        raise Stopped(f"finished steps are kept, go on with: {command}") from None
    print_answer(result, report.result_text(result), as_json)
    if not result["success"]:
        raise typer.Exit(1)


@app.command()
def demo(
    name: Annotated[str | None, typer.Argument(help="Which demo; without it they are listed.")] = None,
    backend: Annotated[
        str | None, typer.Option(help="drake or symbolic, in place of the demo's own.")
    ] = None,
    seed: SeedOption = 0,
    perception: PerceptionOption = None,
    store: StoreOption = Path("runs"),
    record: RecordOption = True,
    video: VideoOption = False,
    as_json: Json = False,
) -> None:
    """Run a named scenario: a tool for what is out of reach, sabotage, a slip, a thing that disappears."""
    from cognitive_arch import report
    from cognitive_arch.demos import load_demos
    from cognitive_arch.runs import run_task

    demos = load_demos()
    if name is None:
        return print_answer(demos.to_json(), str(demos), as_json)
    chosen = demos.find(name)
    config = chosen.config(backend, seed, record, video, perception)
    print_answer({}, "" if as_json else report.demo_text(chosen, config), False)

    def work(progress: Progress) -> dict[str, Any]:
        return {"demo": name} | run_task(chosen.sentence, config, store, progress)

    _carry_out(work, store, as_json)


@app.command()
def plan(
    sentence: Annotated[
        str | None, typer.Argument(help='What to plan for, for example "make a ham sandwich".')
    ] = None,
    scene: SceneOption = "simple",
    goal: Annotated[
        str | None, typer.Option(help='Literals such as "on(Ham,Bun-bottom)", or a file with them.')
    ] = None,
    state: Annotated[
        Path | None, typer.Option(help="A file of literals to start from instead of the scene's own state.")
    ] = None,
    rules: RulesOption = None,
    symbols: Annotated[
        Path | None,
        typer.Option(help="libPRADA's symbols file; then --rules, --state and --goal are libPRADA's, too."),
    ] = None,
    planner: PlannerOption = "guided-prada",
    horizon: Annotated[int, typer.Option(help="How many actions a plan may have.")] = 5,
    samples: Annotated[int | None, typer.Option(help="Sequences (or episodes) to sample.")] = None,
    seed: SeedOption = 0,
    repeat: Annotated[int, typer.Option(help="Plan so often; the time told is the median.")] = 1,
    evaluate: Annotated[
        bool, typer.Option("--evaluate", help="Say how likely the plan is to reach the goal by the rules.")
    ] = False,
    actions: Annotated[
        str | None, typer.Option(help="Evaluate these actions instead of planning, separated by commas.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Plan once, without acting: for a scene, or for a problem in libPRADA's files."""
    from cognitive_arch import dry_run, report

    settings = dry_run.PlanSettings(planner, horizon, samples, seed, repeat, evaluate)
    load = dry_run.loader(sentence, scene, goal, state, rules, symbols)
    if actions is None:
        answer = dry_run.plan_once(load, settings, report.notice)
    else:
        answer = dry_run.evaluate_given(load, actions, settings)
    print_answer(answer, dry_run.plan_text(answer), as_json)
    if answer.get("status") == "no_plan" and answer["diagnosis"]["verdict"] != "holds":
        raise typer.Exit(1)


@app.command()
def inspect(
    run_id: Annotated[
        str | None, typer.Argument(metavar="[RUN]", help="A run's id, the start of one, or 'latest'.")
    ] = None,
    step: Annotated[int | None, typer.Option(help="Show the world as it was when this step began.")] = None,
    format_: Annotated[str, typer.Option("--format", help="text, or jsonl: one line per step.")] = "text",
    video: Annotated[
        Path | None, typer.Option(metavar="FILE.mp4", help="Make a video of the run from its trajectory.")
    ] = None,
    store: StoreOption = Path("runs"),
    as_json: Json = False,
) -> None:
    """List the runs; or show one: plans, actions, the world at any step, why each heuristic fired."""
    if video is not None:
        from cognitive_arch.filming import film

        if run_id is None or step is not None or format_ != "text":
            raise ConfigError("--video needs a run (or 'latest'), and goes without --step and --format")
        made = film(run_id, store, video)
        return print_answer(made, f"wrote {made['video']}", as_json)
    from cognitive_arch import inspection

    view = inspection.view(store, run_id, step, format_)
    print_answer(view.data, view.text, as_json)


query.register(app)
sweeps.register(app)
explore.register(app)
app.add_typer(learn.app, name="learn")
seeing.register(app)


def main() -> None:
    """Entry point of `cogarch`: exit code 0 done, 1 honestly failed, 2 bad input, 130 interrupted."""
    sys.exit(_guarded())


def _guarded() -> int:
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # What a terminal cannot show (quotes in ASCII, broken bytes) is shown escaped.
            stream.reconfigure(errors="backslashreplace")
    command = typer.main.get_command(app)
    try:
        code = command.main(prog_name="cogarch", standalone_mode=False)
        if code == INTERRUPTED:  # the argument parser caught Ctrl-C itself
            return _interrupted()
        return code if isinstance(code, int) else 0
    except CogArchError as error:
        return _complain(str(error))
    except Stopped as stopped:
        return _interrupted(f"; {stopped}")
    except KeyboardInterrupt:
        return _interrupted()
    except OSError as error:
        # Output that cannot be written (a full disk) must not fail once more when Python exits.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _complain(f"cannot write the output: {one_line(error)}")
    except Exception as error:
        message = _usage_message(error)
        if message is None:
            raise
        return _complain(message)


def _interrupted(more: str = "") -> int:
    print(f"interrupted{more}", file=sys.stderr)
    return INTERRUPTED


def _usage_message(error: Exception) -> str | None:
    """One line for an error of the argument parser; None for anything else.

    Recognised by what it offers, for typer carries that parser's classes under names that change.
    """
    if type(error).__name__ == "Abort":
        return "aborted"
    if not hasattr(error, "format_message"):
        return None
    message = one_line(error.format_message(), 400)
    context = getattr(error, "ctx", None)
    if "command" in message.lower() and context is not None and hasattr(context.command, "commands"):
        message += f" valid: {', '.join(sorted(context.command.commands))}"
    return f"{message} (see: {context.command_path if context else 'cogarch'} --help)"


def _complain(message: str) -> int:
    print(f"cogarch: {' '.join(message.split())}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    main()
