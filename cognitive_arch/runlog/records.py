"""What is written about a run: plain data, the same for the store, `--json` and exports."""

from __future__ import annotations

import hashlib
import platform
import subprocess
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from cognitive_arch import __version__
from cognitive_arch.execution.episode import EpisodeResult, Step
from cognitive_arch.world.state import StateChange, sorted_atoms

LIBRARIES = ("drake", "icub_models", "numpy", "numba", "lark")


def step_record(step: Step, misbelief: StateChange | None = None) -> dict[str, Any]:
    """One step as JSON data. Holds nothing that differs between two runs of one seed.

    `misbelief` is how the world as the robot believes it to be after the step differs from the real one.
    """
    atoms = step.before.atoms()
    return {
        "step": step.number,
        "world_before": step.before.version,
        "world_after": step.after.version,
        "atoms": sorted_atoms(atoms),
        "subgoal": {
            "index": step.subgoal,
            "literals": [str(lit) for lit in step.goal],
            "missing": [str(lit) for lit in step.goal if not lit.holds(atoms)],
        },
        "horizon": step.horizon,
        "events": [{"kind": str(e.kind), "why": e.why} for e in step.events],
        "plan": None
        if step.plan is None
        else {
            "status": str(step.plan.status),
            "actions": [str(a) for a in step.plan.actions],
            "value": step.plan.value,
            "goal_probability": step.plan.goal_probability,
        },
        "probabilities": [
            {"action": str(belief.action), "p": round(belief.probability, 6), "from": belief.source}
            for belief in step.probabilities
        ],
        "action": step.action.name if step.action else None,
        "args": list(step.action.args) if step.action else [],
        "outcome": str(step.outcome) if step.outcome else None,
        "reason": str(step.reason),
        "effect": step.effect,
        "added": list(step.change.added),
        "removed": list(step.change.removed),
        "misbelief": None
        if misbelief is None
        else {"wrong": list(misbelief.added), "overlooked": list(misbelief.removed)},
    }


def action_record(record: dict[str, Any]) -> dict[str, Any]:
    """The part of a step record that `run --json` lists under `actions`."""
    return {key: record[key] for key in ("action", "args", "outcome", "reason")}


def result_record(result: EpisodeResult, speed: float) -> dict[str, Any]:
    """The end of an episode as JSON data."""
    return {
        "success": result.success,
        "reason": str(result.reason),
        "speed": speed,
        "good": result.good,
        "total": result.total,
        "failure": result.failure.to_json() if result.failure else None,
        "explanation": str(result.failure) if result.failure else None,
        "final_state": sorted_atoms(result.final.atoms()),
    }


def versions() -> dict[str, str]:
    """Versions of this project and of what its results depend on, and the git commit if there is one."""
    found = {"cognitive_arch": __version__, "python": platform.python_version()}
    for name in LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    found["git"] = _git_commit()
    return found


def other_versions(then: Mapping[str, str]) -> str:
    """What is different from `versions` now, in words; empty if nothing is."""
    now = versions()
    changed = sorted(key for key in {*then, *now} if then.get(key) != now.get(key))
    return ", ".join(f"{key} {then.get(key)}, now {now.get(key)}" for key in changed)


def _git_commit() -> str:
    """The commit; of a checkout with changes also a digest of these, so that no two of them look alike."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists():
        return "none"
    try:
        commit = _git(root, "describe", "--always", "--dirty", "--abbrev=12")
        if not commit.endswith("-dirty"):
            return commit
        return f"{commit}-{hashlib.sha256(_git(root, 'diff', 'HEAD').encode()).hexdigest()[:8]}"
    except (OSError, subprocess.SubprocessError):
        return "unknown"


def _git(root: Path, *args: str) -> str:
    """What git says of the checkout."""
    command = ["git", "-C", str(root), *args]
    out = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=5, check=True)
    return out.stdout.strip()
