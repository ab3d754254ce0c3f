"""The robot's own exploration: many trials in the simulation, kept as one table that can be learnt from.

Every trial is drawn from the seed and its number alone, so that the rows are the same however many processes
share the work, and after a kill the same command goes on where the file ends.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cognitive_arch.affordances.trials import EDGES, KINDS
from cognitive_arch.errors import ExplorationError, one_line, unknown
from cognitive_arch.evaluation.rows import RowFile, locked, whole_lines
from cognitive_arch.evaluation.running import in_processes, is_ctrl_c
from cognitive_arch.perception.descriptors import DEFAULT, FORMULAS
from cognitive_arch.runlog.records import other_versions, versions

if TYPE_CHECKING:
    from sim.exploration import Outcome

FORMAT = 1
BOTH = "both"
HAND_TURNS = (1, 4, 7)
HANDS_OF_TEN = len(HAND_TURNS)
"""Of ten blocks of both kinds, these are with bare hands."""
BLOCK = 8
"""Trials in a row with the same things: changing these costs as much as a trial."""
MOST = 1_000_000
_NAMES = FORMULAS[DEFAULT].names
COLUMNS = (
    "trial",
    "manipulator",
    "object",
    "kind",
    "hand",
    "action",
    *(f"{part}_{name}" for part in "mho" for name in _NAMES),
    "x0",
    "y0",
    "x1",
    "y1",
    "fell",
    "draws",
)
"""Those of `affordances.trials`, and: which hand did it, whether the object fell off the table (it ends where
it left it then), and how many places were drawn before that the arm does not reach."""
HEADER = ",".join(COLUMNS) + "\n"


@dataclass(frozen=True)
class ExploreConfig:
    """What decides all rows: `kind` (`hand`, `tool`, `both`), number of trials, seed."""

    kind: str = BOTH
    trials: int = 100
    seed: int = 0

    def __post_init__(self) -> None:
        if self.kind not in (*KINDS, BOTH):
            raise ExplorationError(unknown("kind", self.kind, (*KINDS, BOTH)))
        if not 1 <= self.trials <= MOST:
            raise ExplorationError(f"{self.trials} trials; valid: 1 to {MOST}")
        if self.seed < 0:
            raise ExplorationError(f"seed {self.seed}; valid: 0 or more")

    def kind_of(self, number: int) -> str:
        """Whether trial `number` is done with a hand or with a tool."""
        return self.block_of(number)[0]

    def block_of(self, number: int) -> tuple[str, int]:
        """The kind of trial `number`, and which block of that kind it belongs to."""
        block = number // BLOCK
        if self.kind != BOTH:
            return self.kind, block
        # So that a part of the trials has both kinds, too, they take turns.
        tens, place = divmod(block, 10)
        hands = tens * HANDS_OF_TEN + sum(turn < place for turn in HAND_TURNS)
        return ("hand", hands) if place in HAND_TURNS else ("tool", block - hands)

    def blocks(self, done: int) -> Iterator[range]:
        """Numbers of the trials to do, those of a block together."""
        while done < self.trials:
            end = min(self.trials, (done // BLOCK + 1) * BLOCK)
            yield range(done, end)
            done = end

    def identity(self) -> dict[str, Any]:
        """What must be the same to go on: more trials may be asked for later."""
        return {"kind": self.kind, "seed": self.seed}


@dataclass(frozen=True)
class TrialRow:
    """One trial as text, in the order of `COLUMNS`."""

    fields: tuple[str, ...]

    def line(self) -> str:
        """The row as a line of CSV."""
        buffer = io.StringIO()
        csv.writer(buffer, lineterminator="\n").writerow(self.fields)
        return buffer.getvalue()


class ExplorationInterrupted(KeyboardInterrupt):
    """Ctrl-C while exploring."""

    def __init__(self, done: int, total: int) -> None:
        super().__init__(f"{done} of {total} trials are kept")


def explore(
    config: ExploreConfig,
    out: Path,
    command: str = "",
    *,
    jobs: int = 1,
    pictures: Path | None = None,
    on_rows: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Do all trials that `out` (.csv) does not hold yet; returns how many those were.

    `pictures` is a folder for what each of these looks like before and after. Raises `ExplorationError` and
    `SweepError` for what cannot be used, and `ExplorationInterrupted` on Ctrl-C.
    """
    if not 1 <= jobs <= 1024:
        raise ExplorationError(f"{jobs} jobs; valid: 1 to 1024")
    if out.suffix != ".csv":
        raise ExplorationError(
            f"'{one_line(out.name)}' cannot be written while exploring; valid: a .csv file"
        )
    for folder in (out.parent, *([pictures] if pictures else [])):
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ExplorationError(f"cannot use the folder {folder}: {error.strerror}") from None
    _claim(config, out, command)
    with locked(out) as file:
        rows = RowFile(file, out, _done(whole_lines(file, out, HEADER), config, out))
        _note(config, out, command)
        before, total = rows.done, config.trials
        on_rows(before, total)
        work = partial(_trials, config, pictures=pictures)
        blocks: Iterable[range] = config.blocks(before)
        if jobs == 1:  # one by one, so that a kill costs one trial
            blocks = (range(n, n + 1) for block in blocks for n in block)
        try:
            for found in map(work, blocks) if jobs == 1 else in_processes(blocks, work, jobs):
                rows.append([_row(number, outcome) for number, outcome in found])
                on_rows(rows.done, total)
        except (KeyboardInterrupt, SystemError) as error:
            if not is_ctrl_c(error):
                raise
            raise ExplorationInterrupted(rows.done, total) from None
        return max(0, rows.done - before)


def _trials(config: ExploreConfig, numbers: range, pictures: Path | None) -> list[tuple[int, Outcome]]:
    from sim import exploration

    found = []
    for number in numbers:
        picture = None if pictures is None else pictures / f"trial_{number:05d}.png"
        kind, block = config.block_of(number)
        found.append((number, exploration.explore(kind, config.seed, block, number % BLOCK, picture)))
    return found


def _row(number: int, found: Outcome) -> TrialRow:
    setup = found.setup
    told = {
        "trial": number,
        "manipulator": setup.manipulator,
        "object": setup.object,
        "kind": setup.kind,
        "hand": setup.hand,
        "action": setup.action,
        **found.descriptors,
        **dict(zip(("x0", "y0", "x1", "y1"), (*found.start, *found.end), strict=True)),
        "fell": int(found.fell),
        "draws": found.draws,
    }
    return TrialRow(tuple(_text(told[column]) for column in COLUMNS))


def _text(value: object) -> str:
    # A tenth of a millimetre is more than any camera tells; shorter files are easier to ship.
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _manifest(out: Path) -> Path:
    return out.with_name(out.name + ".json")


def _claim(config: ExploreConfig, out: Path, command: str) -> None:
    """Say beside the file what it is of, or see that it is of this very exploration."""
    path = _manifest(out)
    if path.exists():
        try:
            theirs = json.loads(path.read_text(encoding="utf-8"))
            kept = {key: theirs["config"][key] for key in config.identity()}
            made_by, format_ = dict(theirs["versions"]), theirs["format"]
            int(theirs["config"]["trials"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise ExplorationError(f"{path} cannot be read: {one_line(error)}") from None
        if kept != config.identity():
            told = ", ".join(f"{k} {kept[k]}, now {v}" for k, v in config.identity().items() if kept[k] != v)
            raise ExplorationError(f"{out} holds another exploration ({told}); take another --out")
        told = other_versions(made_by) if format_ == FORMAT else f"format {format_}, now {FORMAT}"
        if told:
            raise ExplorationError(f"{out} was begun with other versions ({told}); take another --out")
        return
    if out.exists():
        raise ExplorationError(
            f"{out} is not a file of this exploration (there is no {path.name} beside it); take another --out"
        )
    _write_manifest(config, out, command)


def _note(config: ExploreConfig, out: Path, command: str) -> None:
    """Say beside the file if more trials are asked for than before."""
    asked = json.loads(_manifest(out).read_text(encoding="utf-8"))["config"]["trials"]
    if asked < config.trials:
        _write_manifest(config, out, command)


def _write_manifest(config: ExploreConfig, out: Path, command: str) -> None:
    path = _manifest(out)
    manifest = {"format": FORMAT, "command": command, "config": asdict(config), "versions": versions()}
    draft = path.with_name(path.name + ".part")
    try:
        draft.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        raise ExplorationError(f"cannot write {path}: {error.strerror}") from None


def _done(lines: list[str], config: ExploreConfig, out: Path) -> int:
    """How many rows there are; raises `ExplorationError` if they are not the first ones of `config`."""
    if not lines:
        return 0
    foreign = ExplorationError(f"{out} has been changed by something else; take another --out")
    if lines[0] + "\n" != HEADER:
        raise foreign
    for number, row in enumerate(csv.reader(lines[1:])):
        if len(row) != len(COLUMNS) or row[0] != str(number) or row[3] != config.kind_of(number):
            raise foreign
    return len(lines) - 1


def summary(out: Path, done: int) -> dict[str, Any]:
    """What `cogarch explore` answers: how many trials, with what, and how often pulling succeeded.

    A few trials may all have the same effect, from which nothing could be learnt yet.
    """
    import pandas as pd

    frame = pd.read_csv(out)
    pulls = frame[frame["action"] == "pull"]
    closer = pulls["x1"] - pulls["x0"] >= EDGES[2]
    succeeded = {
        str(name): {"trials": len(some), "pulled": round(float(some.mean()), 3)}
        for name, some in closer.groupby(pulls["manipulator"])
    }
    return {
        "file": str(out),
        "trials": len(frame),
        "new": done,
        **{f"{what}s": _counts(frame[what]) for what in ("kind", "object")},
        "pull": succeeded,
    }


def _counts(column: Any) -> dict[str, int]:
    return {str(name): int(n) for name, n in column.value_counts().sort_index().items()}


def summary_text(answer: dict[str, Any]) -> str:
    """The same for a terminal."""
    kinds = ", ".join(f"{n} with {kind}s" for kind, n in answer["kinds"].items())
    lines = [f"{answer['trials']} trials ({kinds}), {answer['new']} of them new, in {answer['file']}"]
    if answer["pull"]:
        lines += ["", f"{'pulling with':<16}{'trials':>7}{'pulled closer':>15}"]
        lines += [f"{n:<16}{row['trials']:>7}{row['pulled']:>15.0%}" for n, row in answer["pull"].items()]
    return "\n".join(lines)
