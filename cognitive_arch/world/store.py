"""The world-state store: every version of a run's world state, in SQLite."""

from __future__ import annotations

import json
import sqlite3

from cognitive_arch.errors import StoreError
from cognitive_arch.world.state import WorldState

SCHEMA = """
CREATE TABLE IF NOT EXISTS world_states (
    run_id TEXT NOT NULL,
    version INTEGER NOT NULL,
    time REAL NOT NULL,
    state TEXT NOT NULL,
    PRIMARY KEY (run_id, version)
) WITHOUT ROWID;
"""


class WorldStateStore:
    """World states by run and version, on a connection whose transactions the caller owns."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        connection.execute(SCHEMA)

    def add(self, run_id: str, state: WorldState) -> None:
        """Append one version; each is written once."""
        self._connection.execute(
            "INSERT INTO world_states VALUES (?, ?, ?, ?)",
            (run_id, state.version, state.time, json.dumps(state.to_json(), sort_keys=True)),
        )

    def forget_after(self, run_id: str, version: int) -> None:
        """Remove the versions of a run beyond `version`."""
        self._connection.execute(
            "DELETE FROM world_states WHERE run_id = ? AND version > ?", (run_id, version)
        )

    def get(self, run_id: str, version: int) -> WorldState:
        """One version; raises `StoreError` naming the versions there are."""
        row = self._connection.execute(
            "SELECT state FROM world_states WHERE run_id = ? AND version = ?", (run_id, version)
        ).fetchone()
        if row is None:
            known = self.versions(run_id)
            there = f"{known[0]} to {known[-1]}" if known else "none"
            raise StoreError(f"run {run_id} has no world state {version}; valid: {there}")
        return WorldState.from_json(json.loads(row[0]))

    def versions(self, run_id: str) -> list[int]:
        """The versions a run has, ascending."""
        rows = self._connection.execute(
            "SELECT version FROM world_states WHERE run_id = ? ORDER BY version", (run_id,)
        )
        return [version for (version,) in rows]
