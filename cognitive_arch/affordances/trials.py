"""Tables of trials: what was done with what, where the thing stood, and how far it went (thesis 5.4.1).

One row is one trial (or one pair of views of it). Files are CSV, Parquet or npz, with these columns:

| column | unit | meaning |
|---|---|---|
| `trial` | - | whole number; rows with the same number are views of one trial (without it every row is one) |
| `manipulator`, `object` | - | names, for reports and for leaving one out (optional) |
| `kind` | - | `hand` or `tool`: what the manipulator is (optional) |
| `action` | - | one of `ACTIONS` |
| `m_*` | - | descriptors of the manipulator's effector half, such as `m_convexity` (thesis Table 2) |
| `h_*` | - | the same of its other half, the handle (optional) |
| `o_*` | - | descriptors of the whole acted object |
| `x0`, `y0`, `x1`, `y1` | m | where the object stood before and after, in the robot's root frame |
| `effect_x`, `effect_y` | m | how far it went; instead of the four above where positions are not known |

The robot looks along -x, and its left is y < 0, so `effect_x` above zero means closer to the robot.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.errors import AffordanceError, one_line, unknown

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Names = NDArray[np.str_]

ACTIONS = ("tapFromRight", "tapFromLeft", "pull", "push")
ALIASES: Mapping[str, str] = {"draw": "pull"}
"""Names that published files use."""
EDGES = (-0.06, -0.025, 0.025, 0.06)
"""Between the five bins of an effect, metres (thesis Tables 5 and 7)."""
BINS = ("VN", "LN", "NM", "LP", "VP")
"""Very negative, low negative, no movement, low positive, very positive (thesis Sec. 3.2)."""
N_BINS = len(BINS)
PREFIXES = {"m": "manipulator", "h": "manipulator's other half", "o": "object"}
KINDS = ("hand", "tool")


def effect_bins(effect: Floats) -> Ints:
    """The bin 0..4 of each effect in metres, any shape; an effect on an edge belongs to the upper bin."""
    return np.asarray(np.digitize(effect, EDGES), dtype=np.int64)


def action_index(name: str) -> int:
    """The place of an action in `ACTIONS`; raises `AffordanceError` for one there is not."""
    known = ALIASES.get(name.strip(), name.strip())
    if known not in ACTIONS:
        raise AffordanceError(unknown("action", name, ACTIONS))
    return ACTIONS.index(known)


@dataclass(frozen=True, eq=False)
class TrialTable:
    """Trials as arrays; n rows.

    `trial`, `action` are (n,) whole numbers, `manipulator`, `object`, `kind` (n,) names, `shape_m` (n, a),
    `shape_h` (n, b) and `shape_o` (n, c) descriptors with their names, `start` (n, 2) metres (NaN where not
    known), `effect` (n, 2) metres, x (longitudinal) first. `views_m` and `views_o` hold the descriptors of
    every view, (k, a) and (k, c), of the named things, where a published file gives them; the rows hold
    their mean then.
    """

    trial: Ints
    action: Ints
    manipulator: Names
    object: Names
    kind: Names
    shape_m: Floats
    shape_h: Floats
    shape_o: Floats
    names_m: tuple[str, ...]
    names_h: tuple[str, ...]
    names_o: tuple[str, ...]
    start: Floats
    effect: Floats
    views_m: Mapping[str, Floats] | None = None
    views_o: Mapping[str, Floats] | None = None
    source: str = "trials"

    def __len__(self) -> int:
        return len(self.action)

    @property
    def bins(self) -> Ints:
        """The bins of both effects, (n, 2)."""
        return effect_bins(self.effect)

    @property
    def has_start(self) -> bool:
        """Whether it is known of every trial where the object stood."""
        return bool(np.isfinite(self.start).all())

    def take(self, rows: NDArray[Any]) -> TrialTable:
        """The given rows (whole numbers or a mask)."""
        return replace(
            self,
            trial=self.trial[rows],
            action=self.action[rows],
            manipulator=self.manipulator[rows],
            object=self.object[rows],
            kind=self.kind[rows],
            shape_m=self.shape_m[rows],
            shape_h=self.shape_h[rows],
            shape_o=self.shape_o[rows],
            start=self.start[rows],
            effect=self.effect[rows],
        )

    def augmented(self) -> TrialTable:
        """Every pair of views as a row of its own, under its trial's number (thesis Sec. 5.4.2.1)."""
        if self.views_m is None or self.views_o is None:
            return self
        rows, shapes_m, shapes_o = [], [], []
        for row in range(len(self)):
            m, o = self.views_m[str(self.manipulator[row])], self.views_o[str(self.object[row])]
            rows.append(np.full(len(m) * len(o), row))
            shapes_m.append(np.repeat(m, len(o), axis=0))
            shapes_o.append(np.tile(o, (len(m), 1)))
        grown = self.take(np.concatenate(rows))
        return replace(grown, shape_m=np.concatenate(shapes_m), shape_o=np.concatenate(shapes_o))


def joined(tables: Sequence[TrialTable]) -> TrialTable:
    """Several tables with the same descriptors as one; trials of different tables stay different.

    Raises `AffordanceError` when the descriptors differ. Halves that only some know are left out.
    """
    first = tables[0]
    for other in tables[1:]:
        if (other.names_m, other.names_o) != (first.names_m, first.names_o):
            raise AffordanceError(
                f"the descriptors of {first.source} and {other.source} differ: "
                f"{_listed(first)} against {_listed(other)}"
            )
    halves = first.names_h if all(t.names_h == first.names_h for t in tables) else ()
    offset, numbers = 0, []
    for table in tables:
        numbers.append(table.trial + offset)
        offset += int(table.trial.max()) + 1
    return replace(
        first,
        trial=np.concatenate(numbers),
        action=np.concatenate([t.action for t in tables]),
        manipulator=np.concatenate([t.manipulator for t in tables]),
        object=np.concatenate([t.object for t in tables]),
        kind=np.concatenate([t.kind for t in tables]),
        shape_m=np.concatenate([t.shape_m for t in tables]),
        shape_h=np.concatenate([t.shape_h[:, : len(halves)] for t in tables]),
        shape_o=np.concatenate([t.shape_o for t in tables]),
        names_h=halves,
        start=np.concatenate([t.start for t in tables]),
        effect=np.concatenate([t.effect for t in tables]),
        views_m=_merged([t.views_m for t in tables]),
        views_o=_merged([t.views_o for t in tables]),
        source=" + ".join(t.source for t in tables),
    )


def _merged(views: Sequence[Mapping[str, Floats] | None]) -> Mapping[str, Floats] | None:
    known = [v for v in views if v is not None]
    return {name: shape for v in known for name, shape in v.items()} if len(known) == len(views) else None


def _listed(table: TrialTable) -> str:
    return ", ".join([*(f"m_{n}" for n in table.names_m), *(f"o_{n}" for n in table.names_o)])


def from_frame(frame: Any, source: str, allow_missing: bool = False) -> TrialTable:
    """The table in a pandas `DataFrame` with the columns above.

    With `allow_missing` descriptors may be NaN (networks learn from those by EM). Raises `AffordanceError`
    for missing columns, cells that are no numbers, unknown actions, no rows, or effects all in one bin.
    """
    columns = [str(c) for c in frame.columns]
    _check_columns(columns, source)
    if not len(frame):
        raise AffordanceError(f"{source} holds no trials")
    shapes = {p: [c for c in columns if c.startswith(p + "_")] for p in PREFIXES}
    position = "x0" in columns
    measures = ["x0", "y0", "x1", "y1"] if position else ["effect_x", "effect_y"]
    numbers = {c: _numbers(frame[c], c, source, False) for c in measures}
    descriptors = {
        p: np.column_stack([_numbers(frame[c], c, source, allow_missing) for c in names])
        if names
        else np.zeros((len(frame), 0))
        for p, names in shapes.items()
    }
    if position:
        start = np.column_stack([numbers["x0"], numbers["y0"]])
        effect = np.column_stack([numbers["x1"], numbers["y1"]]) - start
    else:
        start = np.full((len(frame), 2), np.nan)
        effect = np.column_stack([numbers["effect_x"], numbers["effect_y"]])
    table = TrialTable(
        trial=_trial_numbers(frame, columns, source),
        action=_actions(frame["action"], source),
        manipulator=_texts(frame, "manipulator"),
        object=_texts(frame, "object"),
        kind=_kinds(frame, source),
        shape_m=descriptors["m"],
        shape_h=descriptors["h"],
        shape_o=descriptors["o"],
        names_m=tuple(c[2:] for c in shapes["m"]),
        names_h=tuple(c[2:] for c in shapes["h"]),
        names_o=tuple(c[2:] for c in shapes["o"]),
        start=start,
        effect=effect,
        source=source,
    )
    return checked(table)


def checked(table: TrialTable) -> TrialTable:
    """The table itself, if there is something to learn from it; raises `AffordanceError` otherwise."""
    if not len(table):
        raise AffordanceError(f"{table.source} holds no trials")
    if len(np.unique(table.bins, axis=0)) == 1:
        x, y = (BINS[b] for b in table.bins[0])
        raise AffordanceError(
            f"{table.source}: all {len(table)} trials have the same effect ({x} along x, {y} along y), "
            "so there is nothing to learn; valid: trials with at least two different effects"
        )
    return table


def _check_columns(columns: Sequence[str], source: str) -> None:
    missing = [c for c in ("action",) if c not in columns]
    four = ["x0", "y0", "x1", "y1"]
    if not set(four) & set(columns):
        missing += [c for c in ("effect_x", "effect_y") if c not in columns]
    else:
        missing += [c for c in four if c not in columns]
    missing += [f"{p}_* (descriptors)" for p in ("m", "o") if not any(c.startswith(p + "_") for c in columns)]
    if missing:
        raise AffordanceError(
            f"{source} lacks the columns {', '.join(missing)}; valid: action, m_*, o_* and x0, y0, x1, y1 "
            f"(or effect_x, effect_y); it has: {one_line(', '.join(columns), 160) or 'none'}"
        )
    twice = sorted({c for c in columns if columns.count(c) > 1})
    if twice:
        raise AffordanceError(f"{source} has the column {twice[0]} twice")


def _numbers(column: Any, name: str, source: str, allow_missing: bool) -> Floats:
    try:
        values = np.asarray(column, dtype=np.float64)
    except (TypeError, ValueError):
        bad = next(v for v in column if not _is_number(v))
        raise AffordanceError(
            f"{source}: column {name} holds '{one_line(bad, 40)}', which is no number"
        ) from None
    wrong = np.isinf(values) if allow_missing else ~np.isfinite(values)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise AffordanceError(
            f"{source}: column {name} has no finite number in {int(wrong.sum())} rows (row {row + 1}, ...); "
            "valid: finite numbers only"
        )
    return values


def _is_number(value: object) -> bool:
    try:
        float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False
    return True


def _actions(column: Any, source: str) -> Ints:
    try:
        return np.array([action_index(str(name)) for name in column], dtype=np.int64)
    except AffordanceError as error:
        raise AffordanceError(f"{source}: {error}") from None


def _trial_numbers(frame: Any, columns: Sequence[str], source: str) -> Ints:
    if "trial" not in columns:
        return np.arange(len(frame), dtype=np.int64)
    values = _numbers(frame["trial"], "trial", source, False)
    if (values != np.floor(values)).any() or (values < 0).any():
        raise AffordanceError(f"{source}: column trial holds other than whole numbers from 0 on")
    return values.astype(np.int64)


def _texts(frame: Any, name: str, default: str = "unnamed") -> Names:
    if name not in frame.columns:
        return np.full(len(frame), default)
    return np.array([str(v) for v in frame[name]])


def _kinds(frame: Any, source: str) -> Names:
    kinds = _texts(frame, "kind", "")
    for kind in sorted({str(k) for k in kinds} - {*KINDS, ""}):
        raise AffordanceError(f"{source}: {unknown('kind', kind, KINDS)}")
    return kinds


def to_frame(table: TrialTable) -> Any:
    """The table as a pandas `DataFrame` with the columns above."""
    import pandas as pd

    columns: dict[str, Any] = {"trial": table.trial}
    columns |= {"manipulator": table.manipulator, "object": table.object}
    if (table.kind != "").any():
        columns["kind"] = table.kind
    columns["action"] = [ACTIONS[a] for a in table.action]
    for prefix, names, shapes in (
        ("m", table.names_m, table.shape_m),
        ("h", table.names_h, table.shape_h),
        ("o", table.names_o, table.shape_o),
    ):
        columns |= {f"{prefix}_{name}": shapes[:, i] for i, name in enumerate(names)}
    if table.has_start:
        end = table.start + table.effect
        columns |= {"x0": table.start[:, 0], "y0": table.start[:, 1], "x1": end[:, 0], "y1": end[:, 1]}
    else:
        columns |= {"effect_x": table.effect[:, 0], "effect_y": table.effect[:, 1]}
    return pd.DataFrame(columns)


def read_trials(path: Path | str, allow_missing: bool = False) -> TrialTable:
    """Read a file of trials (.csv, .parquet, .npz). Raises `AffordanceError` for anything unusable."""
    import pandas as pd

    path = Path(path)
    if not path.is_file():
        raise AffordanceError(f"there is no file of trials at '{one_line(path)}'")
    try:
        if path.suffix == ".csv":
            frame = pd.read_csv(path, skipinitialspace=True)
        elif path.suffix == ".parquet":
            frame = pd.read_parquet(path)
        elif path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as arrays:
                frame = pd.DataFrame({name: arrays[name] for name in arrays.files})
        else:
            raise AffordanceError(
                f"'{one_line(path.name)}' is no file of trials; valid: .csv, .parquet, .npz"
            )
    except (OSError, ValueError, pd.errors.ParserError, pd.errors.EmptyDataError, KeyError) as error:
        raise AffordanceError(f"cannot read '{one_line(path.name)}': {one_line(error, 120)}") from None
    except Exception as error:  # pyarrow and zipfile have errors of their own
        if isinstance(error, AffordanceError):
            raise
        raise AffordanceError(f"cannot read '{one_line(path.name)}': {one_line(error, 120)}") from None
    return from_frame(frame, path.name, allow_missing)


def write_trials(table: TrialTable, path: Path | str) -> None:
    """Write a table so that `read_trials` reads it; the suffix says how (.csv, .parquet, .npz)."""
    path = Path(path)
    frame = to_frame(table)
    if path.suffix == ".csv":
        frame.to_csv(path, index=False)
    elif path.suffix == ".parquet":
        frame.to_parquet(path, index=False)
    elif path.suffix == ".npz":
        arrays = {
            name: np.array(frame[name].tolist()) if frame[name].dtype.kind in "OU" else frame[name].to_numpy()
            for name in frame.columns
        }
        with path.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, **_plain(arrays))
    else:
        raise AffordanceError(f"'{one_line(path.name)}' cannot be written; valid: .csv, .parquet, .npz")


def _plain(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Text columns as fixed-width text, so that no pickle is needed."""
    return {n: a.astype(str) if a.dtype.kind not in "iufb" else a for n, a in arrays.items()}


def named(values: Iterable[str]) -> tuple[str, ...]:
    """Different values, sorted."""
    return tuple(sorted({str(v) for v in values}))
