"""Pictures: effects on the table (Fig. 46), networks as graphs, reliability, curves, motions (Fig. 47)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from cognitive_arch.affordances.metrics import Reliability
from cognitive_arch.affordances.structures import ACTION, EFFECTS, Structure
from cognitive_arch.affordances.trials import ACTIONS, BINS, EDGES, N_BINS, Floats, TrialTable, named
from cognitive_arch.errors import AffordanceError, one_line

PICTURES = (".png", ".svg")
ABREAST = 4  # panels in a row
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


def _figure(width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _save(figure: Figure, path: Path | str) -> Path:
    path = Path(path)
    if path.suffix not in PICTURES:
        raise AffordanceError(f"'{one_line(path.name)}' is no picture; valid: {', '.join(PICTURES)}")
    path.parent.mkdir(parents=True, exist_ok=True)
    # No date: the same numbers give the same file.
    figure.savefig(
        path, dpi=110, bbox_inches="tight", metadata={"Date": None} if path.suffix == ".svg" else None
    )
    return path


def effects_picture(joints: Mapping[str, Floats], path: Path | str) -> Path:
    """Where a thing may go, for each of several cases (title -> (5, 5)), as seen from above behind the robot.

    Cells are bins, drawn equally large; the robot is the red dot below, the thing starts in the middle.
    """
    figure = _figure(3.4 * len(joints) + 0.9, 3.9)
    axes = np.atleast_1d(figure.subplots(1, len(joints)))
    top = max(float(joint.max()) for joint in joints.values())
    shown: AxesImage | None = None
    for axis, (title, joint) in zip(axes, joints.items(), strict=True):
        # x grows towards the robot, which is at the bottom: the row of bin 0 (away) is on top.
        shown = axis.imshow(joint, cmap="YlGnBu", vmin=0, vmax=top, origin="upper")
        for row in range(N_BINS):
            for column in range(N_BINS):
                p = joint[row, column]
                colour = "white" if p > 0.6 * top else "black"
                axis.text(column, row, f"{p:.2f}", ha="center", va="center", fontsize=8, color=colour)
        axis.plot([2], [5.0], "o", color="red", markersize=11, clip_on=False)
        axis.text(2.35, 5.05, "robot", color="red", va="center", fontsize=9)
        axis.plot([2], [2], "s", color="none", markeredgecolor="black", markersize=26)
        axis.set_title(title, fontsize=10)
        axis.set_xticks(range(N_BINS), BINS)
        axis.set_yticks(range(N_BINS), BINS)
        axis.xaxis.tick_top()
        axis.set_ylim(5.35, -0.5)
        for spine in axis.spines.values():
            spine.set_visible(False)
    axes[0].set_ylabel("closer  <-  effect along x  ->  away")
    for axis in axes:
        axis.set_xlabel("left  <-  effect along y  ->  right")
    if shown is not None:
        figure.colorbar(shown, ax=list(axes), label="probability", shrink=0.75)
    return _save(figure, path)


def dot(structure: Structure) -> str:
    """The graph in the language of Graphviz."""
    lines = ["digraph affordances {", "  rankdir=TB;", "  node [shape=ellipse];"]
    for node, states in structure.states.items():
        look = ' style=filled fillcolor="#fde0b0"' if node in EFFECTS else ""
        look = ' style=filled fillcolor="#cfe8ff"' if node == ACTION else look
        lines.append(f'  "{node}" [label="{node} ({states})"{look}];')
    lines += [f'  "{parent}" -> "{child}";' for parent, child in structure.edges]
    return "\n".join([*lines, "}", ""])


def graph_picture(structure: Structure, path: Path | str, title: str = "") -> Path:
    """A network as a graph (.png, .svg, or .dot): causes above, effects below."""
    path = Path(path)
    if path.suffix == ".dot":
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(dot(structure), encoding="utf-8")
        return path
    places = _places(structure)
    width = 1 + max(x for x, _ in places.values()) - min(x for x, _ in places.values())
    figure = _figure(max(5.0, 1.3 * width), 1.2 + 1.3 * len({y for _, y in places.values()}))
    axis = figure.subplots()
    for parent, child in structure.edges:
        axis.annotate(
            "",
            places[child],
            places[parent],
            arrowprops={
                "arrowstyle": "-|>", "color": "#555555", "shrinkA": 14, "shrinkB": 14,
                "connectionstyle": "arc3,rad=0.12",
            },
        )  # fmt: skip
    for node, (x, y) in places.items():
        colour = "#fde0b0" if node in EFFECTS else "#cfe8ff" if node == ACTION else "white"
        label = f"{node}\n{structure.states[node]} states"
        box = {"boxstyle": "round", "facecolor": colour, "edgecolor": "black"}
        axis.text(x, y, label, ha="center", va="center", fontsize=8, bbox=box)
    axis.set_xlim(min(x for x, _ in places.values()) - 0.7, max(x for x, _ in places.values()) + 0.7)
    axis.set_ylim(min(y for _, y in places.values()) - 0.6, max(y for _, y in places.values()) + 0.6)
    axis.axis("off")
    axis.set_title(title)
    return _save(figure, path)


def _places(structure: Structure) -> dict[str, tuple[float, float]]:
    """A place for each node: below its parents, at most eight side by side."""
    level: dict[str, int] = {}
    for node in structure.order():
        level[node] = max((level[p] + 1 for p in structure.of(node)), default=0)
    rows: list[list[str]] = []
    for depth in range(max(level.values()) + 1):
        row = [n for n in structure.states if level[n] == depth]
        rows += [row[i : i + 8] for i in range(0, len(row), 8)]
    return {
        node: (i - (len(row) - 1) / 2 + 0.12 * (depth % 2), -float(depth))
        for depth, row in enumerate(rows)
        for i, node in enumerate(row)
    }


def reliability_picture(diagrams: Mapping[str, Reliability], path: Path | str) -> Path:
    """Predicted against observed frequencies; the area of a dot tells how many predictions it stands for."""
    figure = _figure(4.6, 4.4)
    axis = figure.subplots()
    axis.plot([0, 1], [0, 1], color="#999999", linewidth=1)
    for colour, (name, diagram) in zip(COLOURS, diagrams.items(), strict=False):
        size = 10 + 250 * diagram.count / max(1, diagram.count.sum())
        axis.plot(diagram.predicted, diagram.observed, color=colour, linewidth=1)
        label = f"{name} (error {diagram.error:.3f})"
        axis.scatter(diagram.predicted, diagram.observed, size, color=colour, alpha=0.7, label=label)
    axis.set_xlabel("predicted probability")
    axis.set_ylabel("observed frequency")
    axis.set_xlim(0, 1)
    axis.set_ylim(0, 1)
    axis.legend(loc="upper left", fontsize=8)
    return _save(figure, path)


def curve_picture(
    counts: Sequence[int],
    curves: Mapping[str, Floats],
    path: Path | str,
    levels: Mapping[str, float] | None = None,
) -> Path:
    """Accuracy against the number of tool trials: name -> (counts, repetitions), with bands from the 5th to
    the 95th percentile; `levels` are drawn as dashed lines."""
    figure = _figure(5.8, 4.0)
    axis = figure.subplots()
    for colour, (name, values) in zip(COLOURS, curves.items(), strict=False):
        known = ~np.isnan(values).all(axis=1)  # nothing is learned from no trials
        where = np.asarray(counts)[known]
        low, high = np.nanpercentile(values[known], [5, 95], axis=1)
        axis.plot(where, np.nanmean(values[known], axis=1), color=colour, marker="o", label=name)
        axis.fill_between(where, low, high, color=colour, alpha=0.15, linewidth=0)
    for name, value in (levels or {}).items():
        axis.axhline(value, color="#777777", linestyle="--", linewidth=1)
        axis.text(counts[-1], value, name, ha="right", va="bottom", fontsize=8)
    axis.set_xlabel("trials with tools")
    axis.set_ylabel("accuracy per axis")
    axis.legend(fontsize=8, loc="lower right")
    return _save(figure, path)


def motion_picture(tables: Mapping[str, TrialTable], path: Path | str, limit: float = 0.25) -> Path:
    """Displacements by manipulator and action, a panel each, those of a table in rows of their own (Fig. 47).
    The robot is below."""
    panels = {title: named(table.manipulator) for title, table in tables.items()}
    columns = min(ABREAST, max(map(len, panels.values())))
    rows = [
        (title, names[start : start + columns])
        for title, names in panels.items()
        for start in range(0, len(names), columns)
    ]
    figure = _figure(2.6 * columns + 0.6, 2.8 * len(rows) + 0.4)
    grid: Any = figure.subplots(len(rows), columns, squeeze=False)
    for axes, (title, names) in zip(grid, rows, strict=True):
        for axis in axes[len(names) :]:
            axis.set_visible(False)
        for axis, name in zip(axes, names, strict=False):
            _motions(axis, tables[title].take(tables[title].manipulator == name), limit)
            axis.set_title(f"{title}: {name}", fontsize=9)
    grid[0][0].legend(fontsize=7, loc="upper left")
    return _save(figure, path)


def _motions(axis: Axes, table: TrialTable, limit: float) -> None:
    for edge in EDGES:
        axis.axhline(-edge, color="#dddddd", linewidth=0.8)
        axis.axvline(edge, color="#dddddd", linewidth=0.8)
    effect = np.clip(table.effect, -limit, limit)
    for action, name in enumerate(ACTIONS):
        rows = table.action == action
        axis.scatter(
            effect[rows, 1], -effect[rows, 0], 12, marker="v^so"[action], color=COLOURS[action], label=name,
            alpha=0.75, linewidth=0,
        )  # fmt: skip
    axis.set_xlim(-limit * 1.05, limit * 1.05)
    axis.set_ylim(-limit * 1.05, limit * 1.05)
    axis.set_xlabel("y, to the right (m)", fontsize=8)
    axis.set_ylabel("away from the robot (m)", fontsize=8)
    axis.tick_params(labelsize=7)
    axis.set_aspect("equal")
