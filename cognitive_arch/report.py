"""How tasks, steps and results look on a terminal."""

from __future__ import annotations

import os
import shlex
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.markup import escape

from cognitive_arch.demos import Demo
from cognitive_arch.execution.episode import Step
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.runlog.records import step_record
from cognitive_arch.session import Progress, RunConfig, Task


def task_text(task: Task) -> str:
    """The task in words, goals numbered."""
    lines = [f"instruction  {task.instruction}"]
    lines.append("means        " + ", ".join(map(str, task.semantic)))
    lines.extend(f"sub-goal {n}   {_joined(goal)}" for n, goal in enumerate(task.goals, 1))
    return "\n".join(lines)


def demo_text(demo: Demo, config: RunConfig) -> str:
    """What a demo shows, and how to run it with other settings."""
    look = textwrap.fill(demo.look, 100, initial_indent="look at      ", subsequent_indent=" " * 13)
    return f"demo         {demo.title}\n{look}\nthe same as  {demo.command(config)}"


def step_text(record: dict[str, Any]) -> str:
    """One step record on a few lines: what fired and why, what was done, what changed."""
    lines = _events(record["events"])
    if record["action"]:
        call = f"{record['action']}({','.join(record['args'])})"
        reason = "" if record["outcome"] == "success" else f" ({record['reason']})"
        lines.append(f"step {record['step']:<3}{call}  {record['outcome']}{reason}")
        plan = record["plan"]
        lines.append(
            f"        for sub-goal {record['subgoal']['index']}: {', '.join(record['subgoal']['missing'])}; "
            f"plan of {len(plan['actions'])}, probability {plan['goal_probability']:.2f}, "
            f"value {plan['value']:.2f}, horizon {record['horizon']}"
        )
        lines += _believed(record.get("probabilities", ()))
        change = _brief("+", record["added"]) + _brief("-", record["removed"])
        lines.append("        " + (" ".join(change) or "nothing changed"))
        wrong = record.get("misbelief") or {"wrong": [], "overlooked": []}
        if wrong["wrong"] or wrong["overlooked"]:
            told = _brief("+", wrong["wrong"]) + _brief("-", wrong["overlooked"])
            lines.append("        mistaken: " + " ".join(told))
    return "\n".join(lines)


def _events(events: Sequence[dict[str, str]]) -> list[str]:
    """One line per event; of a row of horizon extensions only the last says something new."""
    kinds = [event["kind"] for event in events] + [""]
    return [
        f"        {event['kind']}: {event['why']}"
        for event, following in zip(events, kinds[1:], strict=True)
        if not event["kind"] == following == "horizon_extended"
    ]


def _believed(probabilities: Sequence[dict[str, Any]]) -> list[str]:
    """One line per number that is not that of the rule itself."""
    return [
        f"        believed: {belief['action']} works with {belief['p']:.2f}, from {belief['from']}"
        for belief in probabilities
        if belief["from"] != "default"
    ]


def _brief(sign: str, atoms: Sequence[str]) -> list[str]:
    """Atoms with a sign; many that differ in the last argument only become one: `-reachableWith(Ham,*3)`."""
    groups: dict[str, list[str]] = {}
    for atom in atoms:
        groups.setdefault(atom.rpartition(",")[0] or atom, []).append(atom)
    brief = []
    for stem, same in groups.items():
        brief += [f"{sign}{stem},*{len(same)})"] if len(same) > 2 else [f"{sign}{atom}" for atom in same]
    return brief


def result_text(result: dict[str, Any]) -> str:
    """How the run ended and where it is kept."""
    verdict = "done"
    if not result["success"]:
        verdict = "failed: " + result["explanation"].replace("; ", "\n        ")
    lines = [
        verdict,
        f"{result['good']} of {result['total']} actions worked, "
        f"speed {result['speed']:.2f}, {result['wall_s']:.1f} s",
        f"kept as {result['run_id']} in {result['store']}; see: "
        + _in_store(["cogarch", "inspect", result["run_id"]], Path(result["store"])),
    ]
    pictures = [path for path in result["artifacts"] if Path(path).name.startswith("step-")]
    lines.extend(f"wrote {path}" for path in result["artifacts"] if path not in pictures)
    if pictures:
        lines.append(f"      and {len(pictures)} pictures of the steps beside them")
    return "\n".join(lines)


def resume_command(run_id: str, store: Path) -> str:
    """What to type to go on with a run, the store named only where it is not the usual one."""
    return _in_store(["cogarch", "run", "--resume", run_id], store)


def _in_store(words: list[str], store: Path) -> str:
    usual = Path(os.environ.get("COGARCH_STORE", "runs"))
    return shlex.join(words if store == usual else [*words, "--store", str(store)])


def _joined(literals: Sequence[object]) -> str:
    return ", ".join(map(str, literals))


class _Terminal(Console):
    """A console whose reader may go away without ending the run."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def notice(text: str) -> None:
    """Something the user should know while waiting; never on stdout."""
    print(text, file=sys.stderr, flush=True)


class LiveProgress:
    """Tells on the terminal what is going on: to stderr when `quiet` leaves stdout to a program."""

    def __init__(self, quiet: bool) -> None:
        self._console = _Terminal(stderr=quiet, highlight=False, soft_wrap=True)
        self._status = Console(stderr=True).status("getting ready")
        self.progress = Progress(self._task, self._act, self._step, notice)

    def __enter__(self) -> LiveProgress:
        if self._animated:
            self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._status.stop()

    @property
    def _animated(self) -> bool:
        return Console(stderr=True).is_terminal

    def _task(self, task: Task) -> None:
        self._console.print(escape(task_text(task)))

    def _act(self, action: GroundAction) -> None:
        self._status.update(escape(f"{action} ..."))

    def _step(self, step: Step) -> None:
        text = step_text(step_record(step))
        if text:
            self._console.print(escape(text))
        self._status.update("planning")
