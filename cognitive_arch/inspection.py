"""`inspect`: what the run store knows, as data and as text."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cognitive_arch.errors import ConfigError, StoreError, unknown
from cognitive_arch.report import resume_command, step_text
from cognitive_arch.runlog.store import Run, RunStatus, RunStore
from cognitive_arch.world.state import WorldState, sorted_atoms

FORMATS = ("text", "jsonl")


@dataclass(frozen=True, slots=True)
class View:
    """One answer in both forms."""

    data: dict[str, Any]
    text: str


def view(folder: Path, run_id: str | None, step: int | None, format_: str = "text") -> View:
    """All runs, one run, or the world at one of its steps; raises `StoreError` or `ConfigError`."""
    if format_ not in FORMATS:
        raise ConfigError(unknown("format", format_, FORMATS))
    if step is not None and format_ != "text":
        raise ConfigError("--step shows one step: leave --format away, or use --json")
    if run_id is None and (step is not None or format_ != "text"):
        raise ConfigError("name a run (or 'latest') to see its steps")
    with RunStore(folder) as store:
        if run_id is None:
            return _list(store.runs())
        run = store.find(run_id)
        steps = store.steps(run.run_id)
        if step is not None:
            return _world(store, run, steps, step)
        return _run(run, steps, format_)


def _summary(run: Run) -> dict[str, Any]:
    result = run.result or {}
    return {
        "run_id": run.run_id,
        "started": run.started,
        "status": str(run.status),
        "instruction": run.manifest["instruction"],
        **{key: result.get(key) for key in ("success", "good", "total", "speed", "wall_s")},
    }


def _list(runs: list[Run]) -> View:
    rows = [_summary(run) for run in runs]
    lines = [f"{r['run_id']:<44} {r['status']:<12} {_count(r):<7} {r['instruction']}" for r in rows]
    return View({"runs": rows}, "\n".join(lines) or "no runs yet")


def _count(row: dict[str, Any]) -> str:
    return "" if row["total"] is None else f"{row['good']}/{row['total']}"


def _run(run: Run, steps: list[dict[str, Any]], format_: str) -> View:
    data = _summary(run) | {"manifest": run.manifest, "result": run.result, "steps": steps}
    if format_ == "jsonl":
        return View(data, "\n".join(json.dumps(step, sort_keys=True) for step in steps))
    manifest = run.manifest
    lines = [
        f"run          {run.run_id}  ({run.status})",
        f"instruction  {manifest['instruction']}",
        f"setting      scene {manifest['scene']}, {manifest['backend']}, seed {manifest['seed']}, "
        f"planner {manifest['planner']}, heuristics {manifest['heuristics']}, noise {manifest['noise']}",
        "means        " + ", ".join(" ".join(triple) for triple in manifest["semantic"]),
    ]
    if manifest.get("learned"):
        learned = manifest["learned"]
        lines.append(
            f"learned      {learned['model']} model of {learned['trials']} trials ({learned['source']}), "
            f"fingerprint {learned['fingerprint']}"
        )
    if manifest.get("events"):
        lines.append("outside      " + ", ".join(manifest["events"]))
    lines += [f"sub-goal {n}   {', '.join(goal)}" for n, goal in enumerate(manifest["subgoals"], 1)]
    lines += [text for text in map(step_text, steps) if text]
    lines.append(_ending(run, steps))
    return View(data, "\n".join(lines))


def _ending(run: Run, steps: list[dict[str, Any]]) -> str:
    if run.result is None:
        ending = f"{run.status} after {len(steps)} finished step{'' if len(steps) == 1 else 's'}"
        if run.status is RunStatus.INTERRUPTED:
            ending += f"; go on with: {resume_command(run.run_id, run.folder.parent)}"
        return ending
    result = run.result
    verdict = "done" if result["success"] else f"failed: {result['explanation']}"
    return f"{verdict} ({result['good']} of {result['total']} actions worked, speed {result['speed']:.2f})"


def _world(store: RunStore, run: Run, steps: list[dict[str, Any]], number: int) -> View:
    record = next((s for s in steps if s["step"] == number), None)
    if record is None:
        there = f"{steps[0]['step']} to {steps[-1]['step']}" if steps else "none"
        raise StoreError(f"run {run.run_id} has no step {number}; valid: {there}")
    state = store.worlds.get(run.run_id, record["world_before"])
    data = {
        "run_id": run.run_id,
        "step": record,
        "world": state.to_json(),
        "atoms": sorted_atoms(state.atoms()),
    }
    return View(
        data, "\n".join([f"the world when step {number} began", *_world_lines(state), step_text(record)])
    )


def _world_lines(state: WorldState) -> list[str]:
    lines = [f"  {hand.id}  {hand.name:<12} {'free' if hand.is_clear else 'busy'}" for hand in state.hands]
    for obj in state.objects:
        x, y, z = obj.position
        where = f"in {obj.in_hand}" if obj.in_hand else f"on {', '.join(obj.on_top_of) or 'the table'}"
        seen = "" if obj.visible else "  (remembered)"
        lines.append(f"  {obj.id}  {obj.name:<12} ({x:+.3f}, {y:+.3f}, {z:+.3f}) m  {where}{seen}")
    return [*lines, "  true: " + " ".join(sorted_atoms(state.atoms()))]
