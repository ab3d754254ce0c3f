"""The rows of a sweep on disk: appended in order, so that what a kill leaves is a beginning of the whole."""

from __future__ import annotations

import csv
import fcntl
import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, NamedTuple, Protocol

from cognitive_arch.errors import SweepError, one_line
from cognitive_arch.evaluation.sweep import SweepConfig
from cognitive_arch.runlog.records import other_versions, versions

ROWS, MANIFEST = "rows.csv", "sweep.json"
FORMAT = 1


class Row(NamedTuple):
    """One episode. Noise levels and speed in 0..1, `wall_s` in seconds; counts as in thesis Sec. 6.4.6.2."""

    scene: str
    backend: str
    planner: str
    heuristics: str
    vary: str
    left: float
    right: float
    pull: float
    push: float
    noise: float
    episode: int
    seed: int
    success: bool
    speed: float
    good: int
    total: int
    reason: str
    wall_s: float

    def line(self) -> str:
        """The row as a line of CSV; numbers are written so that they are read back exactly."""
        buffer = io.StringIO()
        fields = [_text(value) for value in self]
        csv.writer(buffer, lineterminator="\n").writerow(fields)
        return buffer.getvalue()


HEADER = ",".join(Row._fields) + "\n"


def _text(value: object) -> str:
    return (
        str(value).lower()
        if isinstance(value, bool)
        else repr(value)
        if isinstance(value, float)
        else str(value)
    )


class Line(Protocol):
    """Something that is a line of CSV."""

    def line(self) -> str:
        """With its end."""
        ...


class RowFile:
    """A file of rows while work goes on; `done` rows are in it. Others are kept from writing there."""

    def __init__(self, file: IO[bytes], path: Path, done: int) -> None:
        self._file = file
        self._path = path
        self.done = done

    def append(self, rows: Iterable[Line]) -> None:
        """Write rows and have them on the disk; raises `SweepError` if that fails (a full disk)."""
        lines = [row.line() for row in rows]
        start = self._file.seek(0, os.SEEK_END)
        try:
            _write(self._file, "".join(lines))
            os.fdatasync(self._file.fileno())
        except OSError as error:
            # What got half onto the disk is taken off again where that is possible; else on resuming.
            with _ignored():
                os.ftruncate(self._file.fileno(), start)
            raise SweepError(
                f"cannot write {self._path}: {error.strerror}; {self.done} rows are kept, the same command "
                "goes on from there"
            ) from None
        self.done += len(lines)


def _write(file: IO[bytes], text: str) -> None:
    """All of `text`; an unbuffered file may take a part of it only."""
    data = text.encode()
    while data:
        data = data[file.write(data) :]


@contextmanager
def _ignored() -> Iterator[None]:
    with suppress(OSError):
        yield


@contextmanager
def open_rows(folder: Path, config: SweepConfig, command: str) -> Iterator[RowFile]:
    """Begin the sweep in `folder`, or go on with it; raises `SweepError` if that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SweepError(f"cannot use {folder} as --out: {error.strerror}") from None
    _claim(folder, config, command)
    path = folder / ROWS
    with locked(path) as file:
        rows = RowFile(file, path, _mend(file, path, config))
        if rows.done < config.total:
            _check_versions(folder)
        yield rows


@contextmanager
def locked(path: Path) -> Iterator[IO[bytes]]:
    """The file, to read and to append to, other processes being kept from that; raises `SweepError`."""
    try:
        file = open(path, "a+b", buffering=0)  # noqa: SIM115 (closed below)
    except OSError as error:
        raise SweepError(f"cannot write {path}: {error.strerror}") from None
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise SweepError(
                f"another process is writing to {path}; wait for it or take another --out"
            ) from None
        yield file


def whole_lines(file: IO[bytes], path: Path, header: str) -> list[str]:
    """The lines of a file of rows, without what a kill left of the last; an empty one gets its header."""
    file.seek(0)
    content = file.read()
    whole = content[: content.rfind(b"\n") + 1]
    try:
        if len(whole) < len(content):
            os.ftruncate(file.fileno(), len(whole))
        if not whole:
            _write(file, header)
    except OSError as error:
        raise SweepError(f"cannot write {path}: {error.strerror}") from None
    file.seek(0, os.SEEK_END)
    return whole.decode("utf-8", "replace").splitlines()


def read_manifest(folder: Path) -> dict[str, Any]:
    """`sweep.json` of a folder; raises `SweepError` if it holds no sweep."""
    path = folder / MANIFEST
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
        if manifest["format"] != FORMAT:
            raise SweepError(f"{path} was written by another version (format {manifest['format']})")
    except FileNotFoundError:
        raise SweepError(f"{folder} holds no sweep: there is no {MANIFEST}") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SweepError(f"{path} cannot be read: {one_line(error)}") from None
    return dict(manifest)


def _claim(folder: Path, config: SweepConfig, command: str) -> None:
    """Write the manifest into an empty folder, or see that the one there is of this very sweep."""
    mine = {"config": config.to_json(), "setting": config.fingerprint(), "versions": versions()}
    path = folder / MANIFEST
    if path.exists():
        theirs = read_manifest(folder)
        _compare(folder, mine, theirs)
        return
    strangers = sorted(p.name for p in folder.iterdir() if not p.name.startswith("."))
    if strangers:
        raise SweepError(
            f"{folder} holds files of something else ({one_line(', '.join(strangers))}); "
            "give --out a new or empty folder, or that of the same sweep to go on with it"
        )
    text = json.dumps({"format": FORMAT, "command": command, **mine}, indent=1) + "\n"
    draft = folder / f".{MANIFEST}"
    try:
        draft.write_text(text, encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        raise SweepError(f"cannot write {path}: {error.strerror}") from None


def _compare(folder: Path, mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> None:
    differing = [
        f"{key} {_brief(theirs['config'].get(key))}, now {_brief(value)}"
        for key, value in mine["config"].items()
        if theirs["config"].get(key) != value
    ]
    if differing:
        raise SweepError(
            f"{folder} holds the rows of another sweep ({'; '.join(differing)}); take another --out"
        )
    if mine["setting"] != theirs["setting"]:
        raise SweepError(f"scene, domain or rules have changed since {folder} was begun; take another --out")


def _check_versions(folder: Path) -> None:
    """What is missing must be added by what made the rest; a finished sweep may be drawn anew by any."""
    told = other_versions(read_manifest(folder)["versions"])
    if told:
        raise SweepError(f"{folder} was begun with other versions ({told}); take another --out")


def _brief(value: object) -> str:
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)


def _mend(file: IO[bytes], path: Path, config: SweepConfig) -> int:
    """Cut off what a kill left of a line; returns how many rows there are: these must come first."""
    lines = whole_lines(file, path, HEADER)
    if not lines:
        return 0
    foreign = SweepError(f"{path} has been changed by something else; take another --out")
    if lines[0] + "\n" != HEADER or len(lines) - 1 > config.total:
        raise foreign
    for expected, row in zip(_identities(config), csv.reader(lines[1:]), strict=False):
        if tuple(row[:12]) != expected or len(row) != len(Row._fields):
            raise foreign
    return len(lines) - 1


def _identities(config: SweepConfig) -> Iterator[tuple[str, ...]]:
    """What the rows say of themselves before anything has happened, in order."""
    from cognitive_arch.scenes import load_scene

    names = {scene: load_scene(scene).name for scene in config.scenes}
    seeds = [config.episode_seed(episode) for episode in range(config.episodes)]
    for cell in config.cells():
        fixed = (names[cell.scene], cell.backend, cell.planner, cell.heuristics, cell.vary)
        level = cell.levels
        noise = (level.left, level.right, level.pull, level.push, cell.noise)
        for episode, seed in enumerate(seeds):
            yield tuple(map(_text, (*fixed, *noise, episode, seed)))
