"""Models by their names; saved and loaded as JSON."""

from __future__ import annotations

import gzip
import json
import os
import shutil
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cognitive_arch.affordances.baselines import ForestModel, LogisticModel, MajorityModel
from cognitive_arch.affordances.mixture import MixtureModel
from cognitive_arch.affordances.model import EffectModel
from cognitive_arch.affordances.networks import METHODS, network_class
from cognitive_arch.affordances.trials import ACTIONS, Floats, Names, TrialTable, checked
from cognitive_arch.errors import AffordanceError, one_line, unknown

DEFAULT = "default"
MODELS: Mapping[str, type[Any]] = {
    DEFAULT: MixtureModel,
    **{method: network_class(method) for method in METHODS},
    "majority": MajorityModel,
    "forest": ForestModel,
    "logistic": LogisticModel,
}
BASELINES = ("majority", "forest", "logistic")
FORMAT = "cogarch-affordances-1"


@dataclass(eq=False)
class Affordances:
    """A model, what it is called, and what it was learned from: the things it knows by name.

    `things_m` and `things_o` are mean descriptors by name; `trials` says how many there were, `tried` with
    which actions.
    """

    name: str
    model: EffectModel
    names_m: tuple[str, ...]
    names_o: tuple[str, ...]
    things_m: Mapping[str, Floats]
    things_o: Mapping[str, Floats]
    trials: int
    source: str
    tried: tuple[str, ...] = ACTIONS

    @classmethod
    def learn(cls, table: TrialTable, name: str, rng: np.random.Generator) -> Affordances:
        """Learn the model `name` from trials. Raises `AffordanceError` for names there are not."""
        checked(table)
        model = model_class(name).fit(table, rng)
        return cls(
            name,
            model,
            table.names_m,
            table.names_o,
            _means(table.manipulator, table.shape_m),
            _means(table.object, table.shape_o),
            len(np.unique(table.trial)),
            table.source,
            tuple(name for number, name in enumerate(ACTIONS) if (table.action == number).any()),
        )

    def save(self, path: Path | str) -> None:
        """Write everything as JSON; packed, if the name ends in .gz."""
        data = {
            "format": FORMAT,
            "model": self.name,
            "names_m": list(self.names_m),
            "names_o": list(self.names_o),
            "things_m": {n: _plain(v) for n, v in self.things_m.items()},
            "things_o": {n: _plain(v) for n, v in self.things_o.items()},
            "trials": self.trials,
            "source": self.source,
            "tried": list(self.tried),
            "parameters": self.model.to_json(),
        }
        text = (json.dumps(data) + "\n").encode()
        # Without a time in it the same is packed to the same.
        _write(Path(path), gzip.compress(text, mtime=0) if str(path).endswith(".gz") else text)

    @classmethod
    def load(cls, path: Path | str) -> Affordances:
        """Read what `save` wrote; raises `AffordanceError` for anything else."""
        path = Path(path)
        data = _kept(path)
        try:
            return cls(
                data["model"],
                model_class(data["model"]).from_json(data["parameters"]),
                tuple(data["names_m"]),
                tuple(data["names_o"]),
                {n: np.array(v, np.float64) for n, v in data["things_m"].items()},
                {n: np.array(v, np.float64) for n, v in data["things_o"].items()},
                int(data["trials"]),
                str(data["source"]),
                tuple(str(name) for name in data.get("tried", ACTIONS)),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise AffordanceError(
                f"'{one_line(path.name)}' is incomplete, or of another version ({one_line(error)}); "
                "learn it again: cogarch learn networks"
            ) from None


def _write(path: Path, content: bytes) -> None:
    """Whole or not at all: the file may be in use, and the process may be killed at any moment.

    A link stays one; devices and pipes are written to.
    """
    target = path.resolve()
    if path.absolute().parts[1] in ("dev", "proc") or (target.exists() and not target.is_file()):
        path.write_bytes(content)
        return
    draft = target.with_name(f".{os.getpid()}.part")
    try:
        draft.write_bytes(content)
        if target.exists():
            shutil.copymode(target, draft)
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)


def _kept(path: Path) -> dict[str, Any]:
    """What is in a file of a learned model, of whatever version; raises `AffordanceError` for other files."""
    try:
        kept = path.read_bytes()
    except OSError:
        raise AffordanceError(f"there is no learned model at '{one_line(path)}'") from None
    try:
        data = json.loads(gzip.decompress(kept) if path.suffix == ".gz" else kept)
    except (ValueError, OSError, EOFError, RecursionError, zlib.error) as error:
        raise AffordanceError(f"'{one_line(path.name)}' is no learned model: {one_line(error)}") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise AffordanceError(
            f"'{one_line(path.name)}' is no learned model; valid: a file of `cogarch learn networks`"
        )
    return data


def check_place(path: Path) -> None:
    """Raises `AffordanceError` where a model must not be kept, as something else is there."""
    if not path.is_file() or not path.stat().st_size:
        return  # devices, too, may be written to
    try:
        _kept(path)
    except AffordanceError:
        raise AffordanceError(
            f"'{one_line(path)}' holds something else than a learned model; take another --out"
        ) from None


def _plain(shape: Floats) -> list[float | None]:
    """JSON knows no NaN."""
    return [None if np.isnan(value) else value for value in shape.tolist()]


def _means(names: Names, shapes: Floats) -> dict[str, Floats]:
    return {str(name): shapes[names == name].mean(axis=0) for name in np.unique(names)}


def model_class(name: str) -> type[Any]:
    """The class of a model; raises `AffordanceError` for a name there is not."""
    if name not in MODELS:
        raise AffordanceError(unknown("model", name, MODELS))
    return MODELS[name]
