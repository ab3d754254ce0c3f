"""How a sweep looks on a terminal while it goes on, and what it answers in the end."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from cognitive_arch.evaluation.results import Results
from cognitive_arch.evaluation.sweep import SweepConfig

SHOWN = ("scene", "backend", "planner", "vary", "heuristics", "noise")


class Bar:
    """A progress bar with the time left, on stderr; where that is no terminal, a line every tenth."""

    def __init__(self, what: str = "episodes") -> None:
        self._what = what
        self._console = Console(stderr=True)
        columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, TextColumn("left:"), TimeRemainingColumn(), console=self._console)
        self._task = self._progress.add_task(what, total=None, visible=False)
        self._before: int | None = None
        self._told = 0
        self._started = time.monotonic()

    def __enter__(self) -> Bar:
        if self._console.is_terminal:
            self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._console.is_terminal:  # elsewhere it would leave an empty line
            self._progress.stop()

    def update(self, done: int, total: int) -> None:
        """`done` of `total` there are; the first call says where it starts."""
        if self._before is None:
            self._before, self._told = done, 10 * done // max(total, 1)
            # Rows that were there already must not make it look quick.
            self._progress.reset(self._task, total=total - done, visible=True)
            self._started = time.monotonic()
            if done:
                self.notice(f"{min(done, total)} of {total} {self._what} are there already")
        self._progress.update(self._task, completed=done - self._before)
        tenth = 10 * done // max(total, 1)
        if not self._console.is_terminal and tenth > self._told:
            self._told = tenth
            spent = time.monotonic() - self._started
            left = spent * (total - done) / max(done - self._before, 1)
            print(f"{done} of {total} {self._what}, {left:.0f} s left", file=sys.stderr, flush=True)

    def notice(self, text: str) -> None:
        """Something to know meanwhile."""
        if self._console.is_terminal:
            self._progress.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, file=sys.stderr, flush=True)


def sweep_answer(out: Path, config: SweepConfig, done: int, results: Results) -> dict[str, Any]:
    """The fields of `sweep --json`."""
    return {
        "out": str(out),
        "episodes": len(results.rows),
        "resumed_at": len(results.rows) - done,
        **{key: value for key, value in config.to_json().items() if key != "episodes"},
        "summary": results.summary.to_dict("records"),
        "comparisons": results.comparisons.to_dict("records"),
        "files": [str(path) for path in results.files],
    }


def sweep_text(answer: Mapping[str, Any]) -> str:
    """The summary as a table, and where everything is."""
    table = Table(box=None, pad_edge=False)
    same = {key for key in SHOWN if len({line[key] for line in answer["summary"]}) == 1}
    names = [key for key in SHOWN if key not in same]
    for name in names:
        table.add_column(name)
    for name in ("success", "95 %", "speed", "95 %", "good", "total", "cost"):
        table.add_column(name, justify="right")
    for line in answer["summary"]:
        table.add_row(
            *(f"{line[name]:g}" if name == "noise" else str(line[name]) for name in names),
            f"{line['success']:.2f}",
            f"{line['success_low']:.2f}-{line['success_high']:.2f}",
            f"{line['speed']:.2f}",
            f"{line['speed_low']:.2f}-{line['speed_high']:.2f}",
            *(f"{line[name]:.1f}" for name in ("good", "total", "cost")),
        )
    console = Console(width=120, color_system=None)
    with console.capture() as capture:
        console.print(table)
    lines = [line.rstrip() for line in capture.get().splitlines()]
    lines += [f"wrote {path}" for path in answer["files"] if not path.endswith(".svg")]
    return "\n".join(lines)
