"""The run store: one SQLite file (WAL) per store folder, one transaction per step, one folder per run.

A process killed at any instant loses at most the step in flight. With each step goes a checkpoint, from
which the run can be taken up again; only the latest is kept, and none once the run is finished.

While a run goes on, its process holds a lock on `<run>/.lock`; the operating system lets go of it however
the process ends, so a run without result whose lock is free was interrupted.
"""

from __future__ import annotations

import fcntl
import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from cognitive_arch.errors import StoreError, one_line, unknown
from cognitive_arch.execution.episode import Step
from cognitive_arch.runlog.records import step_record
from cognitive_arch.world.state import StateChange, WorldState
from cognitive_arch.world.store import WorldStateStore

DATABASE = "runs.sqlite3"
SCHEMA = """
CREATE TABLE IF NOT EXISTS runs (
    run_id TEXT PRIMARY KEY,
    started TEXT NOT NULL,
    manifest TEXT NOT NULL,
    result TEXT
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS steps (
    run_id TEXT NOT NULL,
    step INTEGER NOT NULL,
    record TEXT NOT NULL,
    PRIMARY KEY (run_id, step)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS checkpoints (
    run_id TEXT PRIMARY KEY,
    step INTEGER NOT NULL,
    version INTEGER NOT NULL,
    wall_s REAL NOT NULL,
    state TEXT NOT NULL
) WITHOUT ROWID;
"""


class RunStatus(StrEnum):
    """What became of a run."""

    RUNNING = "running"
    INTERRUPTED = "interrupted"
    SUCCESS = "success"
    FAILURE = "failure"


@dataclass(frozen=True, slots=True)
class Run:
    """One run as the store knows it; `manifest` holds configuration, seed, versions and git commit."""

    run_id: str
    started: str
    status: RunStatus
    manifest: dict[str, Any]
    result: dict[str, Any] | None
    folder: Path


@dataclass(frozen=True, slots=True)
class Checkpoint:
    """Where a run was after `step`: `state` is all that the rest depends on, as plain data, `version` that
    of its latest world state, `wall_s` the time it had taken."""

    step: int
    version: int
    wall_s: float
    state: dict[str, Any]


class RunStore:
    """Opens `folder` for reading, or for writing too with `create`."""

    def __init__(self, folder: Path, *, create: bool = False) -> None:
        self.folder = folder
        path = folder / DATABASE
        if not create and not path.is_file():
            raise StoreError(
                f"there is no run store in '{folder}'; a run creates one, or name another with --store"
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
            # Autocommit: transactions are begun explicitly, one per step.
            self._db = sqlite3.connect(path, timeout=30, isolation_level=None)
            self._db.execute("PRAGMA journal_mode=WAL")
            self._db.execute("PRAGMA synchronous=NORMAL")
            self._db.executescript(SCHEMA)
            self.worlds = WorldStateStore(self._db)
        except (OSError, sqlite3.Error) as error:
            raise StoreError(f"cannot open the run store in '{folder}': {one_line(error, 200)}") from None

    def close(self) -> None:
        """Close the database; idempotent."""
        self._db.close()

    def __enter__(self) -> RunStore:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def begin(self, name: str, manifest: dict[str, Any]) -> RunWriter:
        """Register a new run under an id made of the time and `name`, and return its writer."""
        now = datetime.now(UTC)
        stem = f"{now:%Y%m%d-%H%M%S}-{name}"
        for attempt in range(1000):
            run_id = stem if attempt == 0 else f"{stem}-{attempt + 1}"
            lock = self._claim(run_id)
            if lock is None:
                continue
            with self._transaction():
                self._db.execute(
                    "INSERT INTO runs VALUES (?, ?, ?, NULL)",
                    (run_id, now.isoformat(timespec="microseconds"), json.dumps(manifest, sort_keys=True)),
                )
            return RunWriter(self, run_id, lock)
        raise StoreError(f"cannot find a free run id for {stem}")

    def resume(self, run: Run) -> RunWriter:
        """The writer of a run that was interrupted, to be rewound to its checkpoint.

        Raises `StoreError` for a run that goes on or is finished.
        """
        try:
            lock = (run.folder / ".lock").open("a")
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StoreError(f"run {run.run_id} is still running") from None
        except OSError as error:
            raise StoreError(f"cannot write to run {run.run_id}: {one_line(error, 200)}") from None
        # Somebody else may have finished it since `run` was read.
        status = self.find(run.run_id).status
        if status in (RunStatus.SUCCESS, RunStatus.FAILURE):
            lock.close()
            raise StoreError(f"run {run.run_id} is finished ({status}): there is nothing to go on with")
        return RunWriter(self, run.run_id, lock)

    def checkpoint(self, run_id: str) -> Checkpoint | None:
        """Where a run can be taken up; None if no step is finished, or the run is."""
        rows = self._query("SELECT step, version, wall_s, state FROM checkpoints WHERE run_id = ?", run_id)
        if not rows:
            return None
        step, version, wall_s, state = rows[0]
        try:
            return Checkpoint(int(step), int(version), float(wall_s), json.loads(state))
        except ValueError:
            raise StoreError(f"the checkpoint of run {run_id} cannot be read") from None

    def _claim(self, run_id: str) -> TextIO | None:
        """The locked lock file of a new run folder, or None if somebody else has that id."""
        try:
            (self.folder / run_id).mkdir()
            lock = (self.folder / run_id / ".lock").open("w")
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except FileExistsError:
            return None
        except OSError as error:
            raise StoreError(
                f"cannot write to the run store '{self.folder}': {one_line(error, 200)}"
            ) from None
        return lock

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        try:
            self._db.execute("BEGIN IMMEDIATE")
            yield
            self._db.execute("COMMIT")
        except sqlite3.Error as error:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            raise StoreError(
                f"cannot write to the run store '{self.folder}': {one_line(error, 200)}"
            ) from None

    # -- reading ------------------------------------------------------------------------------------

    def runs(self) -> list[Run]:
        """All runs, oldest first."""
        rows = self._query("SELECT run_id, started, manifest, result FROM runs ORDER BY started, run_id")
        return [self._run(*row) for row in rows]

    def find(self, name: str) -> Run:
        """The run with id `name`, or the one whose id starts with it, or the `latest`."""
        runs = self.runs()
        if name == "latest" and runs:
            return runs[-1]
        if not name:
            raise StoreError(unknown("run", name, ["latest"]))
        matching = [r for r in runs if r.run_id == name] or [r for r in runs if r.run_id.startswith(name)]
        if len(matching) == 1:
            return matching[0]
        recent = [run.run_id for run in runs[-5:]]
        if matching:
            raise StoreError(
                f"'{one_line(name)}' fits {len(matching)} runs: {', '.join(r.run_id for r in matching[:5])}"
            )
        raise StoreError(unknown("run", name, [*recent, "latest"] if recent else []))

    def steps(self, run_id: str) -> list[dict[str, Any]]:
        """The step records of a run, in order."""
        rows = self._query("SELECT record FROM steps WHERE run_id = ? ORDER BY step", run_id)
        return [json.loads(record) for (record,) in rows]

    def _run(self, run_id: str, started: str, manifest: str, result: str | None) -> Run:
        outcome = json.loads(result) if result else None
        if outcome is not None:
            status = RunStatus.SUCCESS if outcome["success"] else RunStatus.FAILURE
        else:
            status = RunStatus.RUNNING if self._locked(run_id) else RunStatus.INTERRUPTED
        return Run(run_id, started, status, json.loads(manifest), outcome, self.folder / run_id)

    def _locked(self, run_id: str) -> bool:
        try:
            with (self.folder / run_id / ".lock").open() as lock:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        except OSError:
            return False
        return False

    def _query(self, sql: str, *args: object) -> list[tuple[Any, ...]]:
        try:
            return self._db.execute(sql, args).fetchall()
        except sqlite3.Error as error:
            raise StoreError(f"cannot read the run store '{self.folder}': {one_line(error, 200)}") from None


class RunWriter:
    """Appends to one run; holds the run's lock until it is closed."""

    def __init__(self, store: RunStore, run_id: str, lock: TextIO) -> None:
        self.run_id = run_id
        self.folder = store.folder / run_id
        self._store = store
        self._lock = lock
        self._version = -1

    def add_step(
        self,
        step: Step,
        state: dict[str, Any] | None = None,
        wall_s: float = 0.0,
        misbelief: StateChange | None = None,
    ) -> dict[str, Any]:
        """Write one step and the world states it brought, in one transaction; returns its record.

        `state` becomes the run's checkpoint; without it the earlier one stays. `misbelief` is what the robot
        gets wrong after the step, as far as somebody can tell.
        """
        record = step_record(step, misbelief)
        with self._store._transaction():
            for world in (step.before, step.after):
                self._add_world(world)
            self._store._db.execute(
                "INSERT INTO steps VALUES (?, ?, ?)",
                (self.run_id, step.number, json.dumps(record, sort_keys=True)),
            )
            if state is not None:
                self._store._db.execute(
                    "INSERT OR REPLACE INTO checkpoints VALUES (?, ?, ?, ?, ?)",
                    (self.run_id, step.number, self._version, wall_s, json.dumps(state)),
                )
        return record

    def rewind(self) -> Checkpoint | None:
        """Take back what was written after the checkpoint (how the run ended, but not yet its result)."""
        checkpoint = self._store.checkpoint(self.run_id)
        step, self._version = (checkpoint.step, checkpoint.version) if checkpoint else (0, -1)
        with self._store._transaction():
            self._store._db.execute("DELETE FROM steps WHERE run_id = ? AND step > ?", (self.run_id, step))
            self._store.worlds.forget_after(self.run_id, self._version)
        return checkpoint

    def _add_world(self, state: WorldState) -> None:
        if state.version > self._version:
            self._store.worlds.add(self.run_id, state)
            self._version = state.version

    def finish(self, result: dict[str, Any]) -> None:
        """Write the run's result; without it the run counts as interrupted once its process is gone."""
        with self._store._transaction():
            self._store._db.execute(
                "UPDATE runs SET result = ? WHERE run_id = ?",
                (json.dumps(result, sort_keys=True), self.run_id),
            )
            self._store._db.execute("DELETE FROM checkpoints WHERE run_id = ?", (self.run_id,))

    def close(self) -> None:
        """Let go of the run's lock."""
        self._lock.close()

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
