"""What moved how during a run: `trajectory.npz` in the run's folder, and its reader.

The simulator samples at every command tick and keeps every fourth sample; what can be deep or far for a
moment only (overlaps, joints beyond their limits) is the maximum since the sample before. Joints are read
at every tick, overlaps at every third (60 ms), or every fourth while nothing moves.
"""

from __future__ import annotations

import os
import zipfile
import zlib
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import StoreError, one_line

TRAJECTORY = "trajectory.npz"
FORMAT = 1

Floats = NDArray[np.float64] | NDArray[np.float32]


@dataclass(frozen=True)
class Trajectory:
    """n samples of m joints, k objects and p pairs of bodies that ever touched."""

    time: NDArray[np.float64]  # (n,) s since the episode began, increasing
    joint_names: tuple[str, ...]  # (m,) the actuated joints
    limits: Floats  # (m, 2) lowest and highest position, rad (fingers: m)
    joints: Floats  # (n, m) measured positions, rad (fingers: m)
    commands: Floats  # (n, m) what the controllers were asked for
    beyond: Floats  # (n, m) how far beyond its limits each joint was at most since the last sample
    object_names: tuple[str, ...]  # (k,)
    poses: Floats  # (n, k, 7) x, y, z in metres (root frame) and the unit quaternion w, x, y, z
    pairs: tuple[tuple[str, str], ...]  # (p,) names of links, objects and `table`, each pair in order
    depths: Floats  # (n, p) deepest overlap of a pair since the last sample, m; 0 where it did not touch
    labels: tuple[str, ...]  # what was going on: actions such as `graspWith(Ham,LeftHand)`; "" for none
    label: NDArray[np.int32]  # (n,) index into `labels`

    def __len__(self) -> int:
        return len(self.time)

    def until(self, time: float) -> Trajectory:
        """The samples up to `time`, s."""
        kept = self.time <= time
        return replace(self, **{name: getattr(self, name)[kept] for name in _SAMPLED})

    def deepest(self, one: set[str], other: set[str]) -> float:
        """The deepest overlap at any time between two groups of bodies, m; 0 if they never touched."""
        columns = [
            i for i, (a, b) in enumerate(self.pairs) if (a in one and b in other) or (a in other and b in one)
        ]
        return float(self.depths[:, columns].max(initial=0.0))

    def save(self, path: Path) -> None:
        """Write the file whole or not at all: a process may be killed at any moment."""
        arrays: dict[str, Any] = {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}
        arrays |= {name: arrays[name].astype(np.float32) for name in _SHORT}
        partial = path.with_name(path.name + ".part")
        with partial.open("wb") as file:
            np.savez_compressed(file, format=np.int32(FORMAT), **arrays)
            file.flush()
            os.fsync(file.fileno())  # or a power cut could leave the name without the contents
        os.replace(partial, path)

    @classmethod
    def load(cls, path: Path) -> Trajectory:
        """Read what `save` wrote; raises `StoreError`."""
        try:
            with np.load(path, allow_pickle=False) as data:
                if int(data["format"]) != FORMAT:
                    raise ValueError(f"its format is {int(data['format'])}, not {FORMAT}")
                arrays: dict[str, Any] = {f.name: data[f.name] for f in fields(cls)}
            _check(arrays)
        except FileNotFoundError:
            raise StoreError(
                f"there is no trajectory at '{path}'; runs in Drake leave one unless --no-record is given"
            ) from None
        except (
            OSError,
            EOFError,
            ValueError,
            KeyError,
            NotImplementedError,
            zipfile.BadZipFile,
            zlib.error,
        ) as error:
            raise StoreError(f"cannot read the trajectory '{path}': {one_line(error, 200)}") from None
        for name in ("joint_names", "object_names", "labels"):
            arrays[name] = tuple(str(text) for text in arrays[name])
        arrays["pairs"] = tuple((str(a), str(b)) for a, b in arrays["pairs"].reshape(-1, 2))
        return cls(**arrays)


_SAMPLED = ("time", "joints", "commands", "beyond", "poses", "depths", "label")
_SHORT = ("limits", "joints", "commands", "beyond", "poses", "depths")


def _check(arrays: dict[str, Any]) -> None:
    """Raise `ValueError` for arrays that do not fit together."""
    n, m, k, p = (len(arrays[name]) for name in ("time", "joint_names", "object_names", "pairs"))
    shapes = {"limits": (m, 2), "poses": (n, k, 7), "depths": (n, p), "label": (n,), "time": (n,)}
    shapes |= dict.fromkeys(("joints", "commands", "beyond"), (n, m))
    for name, shape in shapes.items():
        if arrays[name].shape != shape and arrays[name].size + np.prod(shape) > 0:
            raise ValueError(f"{name} has the shape {arrays[name].shape}, not {shape}")
    if not set(arrays["label"].tolist()) <= set(range(len(arrays["labels"]))):
        raise ValueError("it has samples without label")
