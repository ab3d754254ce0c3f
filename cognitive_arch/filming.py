"""A video of a run that is over, or was interrupted, from its trajectory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cognitive_arch.errors import ConfigError, StoreError
from cognitive_arch.execution.backends import drake_module
from cognitive_arch.runlog.store import RunStore
from cognitive_arch.runlog.trajectory import TRAJECTORY, Trajectory
from cognitive_arch.session import RunConfig, Setting


def film(name: str, store_folder: Path, path: Path) -> dict[str, Any]:
    """Write the video of a run (`name` as for `RunStore.find`) to `path`; returns what was made of what.

    Raises a `CogArchError` for a run without trajectory and for a file that cannot be written.
    """
    if path.suffix != ".mp4":
        raise ConfigError(f"'{path}' is no name for a video; valid: a file that ends in .mp4")
    with RunStore(store_folder) as store:
        run = store.find(name)
    trajectory = Trajectory.load(run.folder / TRAJECTORY)
    if "config" not in run.manifest:
        raise StoreError(f"run {run.run_id} was begun with an older version; its scene is not known any more")
    config = RunConfig.from_json(run.manifest["config"])
    setting = Setting.load(config.scene, config.rules, config.events)
    pictures = drake_module("sim.pictures")
    pictures.write_video(pictures.Stage(setting.domain, setting.scene), trajectory, path)
    return {"run_id": run.run_id, "video": str(path)}
