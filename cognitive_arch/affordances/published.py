"""Reads the published trials of hands and tools (CSV and text files of their authors) into `TrialTable`s.

The files are not part of the project; where they lie is given by the user. What each of them means is
known from their authors' programs: halves, formulas of descriptors, and the order of the actions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cognitive_arch.affordances.trials import Floats, TrialTable, checked, from_frame
from cognitive_arch.errors import AffordanceError, one_line, unknown

ITEMS_2017: Mapping[int, str] = {
    4: "pear", 5: "lemon", 6: "wball", 7: "ylego", 8: "rake", 9: "stick", 10: "hook"
}  # fmt: skip
"""What the numbers in tool_descriptors_12.txt stand for."""
COLUMNS_2017 = (
    "convexity", "eccentricity", "compactness", "circularity", "squareness",
    "nu20", "nu11", "nu02", "nu30", "nu21", "nu12", "nu03",
)  # fmt: skip
COLUMNS_2014 = ("area", "convexity", "eccentricity", "compactness", "circularity", "squareness")
ACTIONS_2016: Mapping[int, str] = {1: "draw", 2: "push", 3: "tapFromLeft", 4: "tapFromRight"}

Views = dict[str, Floats]


def read_published(folder: Path | str, name: str) -> TrialTable:
    """One of the published tables: hand, tool, icub_tools or tools_2016, from the folder they lie in."""
    if name not in READERS:
        raise AffordanceError(unknown("published table", name, READERS))
    base = affordance_folder(folder)
    return READERS[name](base)


def affordance_folder(folder: Path | str) -> Path:
    """Where the files lie: the folder itself or its `affordances`; raises `AffordanceError` if neither."""
    for candidate in (Path(folder), Path(folder) / "affordances"):
        if (candidate / "hand_trials.csv").is_file() or (candidate / "icub_tools_trials.csv").is_file():
            return candidate
    raise AffordanceError(
        f"there are no published trials in '{one_line(folder)}'; valid: a folder with hand_trials.csv, "
        "tool_trials.csv, icub_tools_trials.csv and their descriptors"
    )


def _csv(path: Path, **options: Any) -> Any:
    import pandas as pd

    if not path.is_file():
        raise AffordanceError(f"there is no file '{one_line(path)}'")
    try:
        return pd.read_csv(path, **options)
    except (OSError, ValueError) as error:
        raise AffordanceError(f"cannot read '{one_line(path.name)}': {one_line(error, 120)}") from None


def _views(frame: Any, name_column: Any, columns: list[Any]) -> Views:
    return {
        str(name): part[columns].to_numpy(dtype=np.float64)
        for name, part in frame.groupby(name_column, sort=True)
    }


def _views_hand(base: Path) -> Views:
    frame = _csv(base / "hand_and_object_descriptors.csv")
    return _views(frame, "postureName", list(COLUMNS_2017))


def _views_tool(base: Path) -> Views:
    frame = _csv(base / "tool_descriptors_12.txt", sep=r"\s+", header=None)
    return _views(frame.assign(item=frame[0].map(ITEMS_2017)), "item", list(range(1, 13)))


def _views_icub(base: Path) -> tuple[Views, Views, Views]:
    """Whole things, upper (effector) halves, lower halves."""
    frame = _csv(base / "icub_tools_descriptors.txt", sep=r"\s+", header=None)
    header = (base / "icub_tools_descriptors_header.txt").read_text(encoding="utf-8").split()
    frame.columns = [name.strip('"') for name in header][: frame.shape[1]]
    renamed = {"circularity": "circleness"}
    whole, top, bottom = (
        _views(frame, "objectName", [f"{part}.{renamed.get(c, c)}" for c in COLUMNS_2014])
        for part in ("objDesc", "objTopDesc", "objBottomDesc")
    )
    return whole, top, bottom


def _with_views(
    trials: Any, m: Views, o: Views, h: Views | None, columns: tuple[str, ...], kind: str, source: str
) -> TrialTable:
    """Trials beside the mean descriptors of what they name."""
    for column, views in (("manipulator", m), ("object", o)):
        for name in sorted(set(trials[column]) - set(views)):
            raise AffordanceError(f"{source}: {unknown(column, name, views)}")
    frame = trials.assign(kind=kind)
    parts = [("m", "manipulator", m), ("o", "object", o)] + ([("h", "manipulator", h)] if h else [])
    for prefix, column, views in parts:
        means = np.array([views[name].mean(axis=0) for name in trials[column]])
        frame = frame.assign(**{f"{prefix}_{name}": means[:, i] for i, name in enumerate(columns)})
    table = from_frame(frame, source)
    used_m, used_o = set(trials["manipulator"]), set(trials["object"])
    return checked(
        TrialTable(
            **{
                **{f: getattr(table, f) for f in table.__dataclass_fields__},
                "views_m": {n: v for n, v in m.items() if n in used_m},
                "views_o": {n: v for n, v in o.items() if n in used_o},
            }
        )
    )


def _read_hand(base: Path) -> TrialTable:
    views = _views_hand(base)
    trials = _csv(base / "hand_trials.csv")
    return _with_views(trials, views, views, None, COLUMNS_2017, "hand", "hand_trials.csv")


def _read_tool(base: Path) -> TrialTable:
    views = _views_tool(base)
    trials = _csv(base / "tool_trials.csv")
    return _with_views(trials, views, views, None, COLUMNS_2017, "tool", "tool_trials.csv")


def _read_icub(base: Path) -> TrialTable:
    whole, top, bottom = _views_icub(base)
    trials = _csv(base / "icub_tools_trials.csv")
    return _with_views(trials, top, whole, bottom, COLUMNS_2014, "tool", "icub_tools_trials.csv")


def _read_2016(base: Path) -> TrialTable:
    """Rows are pairs of views; a trial is told by its action and exact effect."""
    frame = _csv(base / "tools_2016.csv")
    for code in sorted(set(frame["action"]) - set(ACTIONS_2016)):
        raise AffordanceError(f"tools_2016.csv: {unknown('action', code, map(str, ACTIONS_2016))}")
    effects = list(zip(frame["action"], frame["effect_x"], frame["effect_y"], strict=True))
    number = {key: i for i, key in enumerate(dict.fromkeys(effects))}
    named = frame.assign(
        trial=[number[key] for key in effects],
        action=[ACTIONS_2016[code] for code in frame["action"]],
        kind="tool",
    )
    return from_frame(named, "tools_2016.csv")


READERS: Mapping[str, Callable[[Path], TrialTable]] = {
    "hand": _read_hand,
    "tool": _read_tool,
    "icub_tools": _read_icub,
    "tools_2016": _read_2016,
}
