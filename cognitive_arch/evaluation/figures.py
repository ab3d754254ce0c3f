"""The figures of a sweep, as Figs. 58 to 61 of the thesis: speed, success, and one against the other."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cognitive_arch.evaluation.summary import HELP_COST, cost_by_help
from cognitive_arch.evaluation.sweep import published_order


class Look(NamedTuple):
    """How one line is told from the others, in colour, in grey and for those who see few colours.

    Lines that lie on each other must both be seen, so the one below is wider, and its marks are larger.
    """

    color: str
    line: str
    marker: str
    width: float
    size: float
    shift: float  # along the axis of noise

    @property
    def style(self) -> dict[str, Any]:
        """What matplotlib calls these."""
        return {
            "color": self.color,
            "linestyle": self.line,
            "linewidth": self.width,
            "marker": self.marker,
            "markersize": self.size,
            "markerfacecolor": "white",
            "markeredgewidth": 1.3,
        }


LOOKS: Mapping[str, Look] = {  # line styles as in the thesis, colours of Okabe and Ito (2008)
    "none": Look("#CC79A7", ":", "o", 3.6, 9.5, -0.012),
    "creativity": Look("#0072B2", "-.", "s", 2.0, 6.5, -0.004),
    "adaptability": Look("#D55E00", "--", "^", 1.8, 6.5, 0.004),
    "adaptability+creativity": Look("#009E73", "-", "D", 1.6, 4.5, 0.012),
    "reliability": Look("#000000", "-", "v", 1.4, 4.0, 0.0),
}
OTHERS = tuple(
    Look(color, line, marker, 1.5, 5.0, 0.0)
    for color, (line, marker) in itertools.product(
        ("#E69F00", "#56B4E9", "#666666"), (("-", "P"), ("--", "X"), ("-.", "*"), (":", "<"))
    )
)
SWEPT = {"both": "both arms", "left": "left arm", "right": "right arm"}
HELP_COSTS = tuple(range(5, 51, 5))
DPI = 150
ERROR_BARS: Mapping[str, Any] = {"elinewidth": 0.9, "capsize": 2}
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.35,
    "svg.hashsalt": "cogarch",
    "svg.fonttype": "none",
}


class Drawn(NamedTuple):
    """A figure, what to call its files, and what it shows in words."""

    name: str
    caption: str
    figure: Figure


def draw_all(rows: pd.DataFrame, summary: pd.DataFrame) -> Iterator[Drawn]:
    """One figure per scene and swept noise, the backends below each other, and one of what failing costs."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        for (scene, vary), part in summary.groupby(["scene", "vary"], sort=False):
            yield _response(str(scene), str(vary), part)
        if summary["heuristics"].nunique() > 1:
            yield _costs(rows)


def save(drawn: Drawn, folder: Path) -> list[Path]:
    """Write PNG and SVG; the same rows give the same bytes."""
    import matplotlib

    FigureCanvasAgg(drawn.figure)
    with matplotlib.rc_context(STYLE):
        paths = [folder / f"{drawn.name}.png", folder / f"{drawn.name}.svg"]
        drawn.figure.savefig(paths[0], dpi=DPI, metadata={"Software": None})
        drawn.figure.savefig(paths[1], metadata={"Date": None})
    return paths


def _response(scene: str, vary: str, summary: pd.DataFrame) -> Drawn:
    """Speed and success against noise, and the trade-off; one row of panels per backend."""
    backends = summary["backend"].unique().tolist()
    figure = Figure(figsize=(10.5, 0.7 + 3.0 * len(backends)), layout="constrained")
    grid = figure.subplots(len(backends), 3, squeeze=False)
    for axes, backend in zip(grid, backends, strict=True):
        part = summary[summary["backend"] == backend]
        for config, points in _lines(part):
            look = _look(config, part)
            _against_noise(axes[0], points, "speed", config, look)
            _against_noise(axes[1], points, "success", config, look)
            _trade_off(axes[2], points, look)
        _label(axes, SWEPT.get(vary, vary), backend if len(backends) > 1 else "")
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 5), frameon=False)
    n = int(summary["episodes"].min())
    caption = (
        f"The {scene} scene, noise of {SWEPT.get(vary, vary)} varied: (a) speed and (b) success against "
        f"noise, (c) one against the other. At least {n} episodes a point; bars are 95 % intervals (Wilson "
        "for success, bootstrap for speed)."
    )
    return Drawn(f"{scene}-{vary.replace('+', '-')}", caption, figure)


def _lines(summary: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Configurations by name, with their points in the order of noise."""
    planners = summary["planner"].unique().tolist()
    for name in published_order(summary["heuristics"].unique().tolist()):
        for planner in planners:
            points = summary[(summary["heuristics"] == name) & (summary["planner"] == planner)]
            if len(points):
                label = name if len(planners) == 1 else f"{name}, {planner}"
                yield label, points.sort_values("noise")


def _look(config: str, summary: pd.DataFrame) -> Look:
    if config in LOOKS:
        return LOOKS[config]
    others = [name for name, _ in _lines(summary) if name not in LOOKS]
    return OTHERS[others.index(config) % len(OTHERS)]


def _against_noise(axes: Axes, points: pd.DataFrame, what: str, label: str, look: Look) -> None:
    noise = points["noise"] + look.shift
    axes.errorbar(noise, points[what], yerr=_bars(points, what), label=label, **ERROR_BARS, **look.style)


def _trade_off(axes: Axes, points: pd.DataFrame, look: Look) -> None:
    bars: Mapping[str, Any] = {"xerr": _bars(points, "success"), "yerr": _bars(points, "speed")}
    axes.errorbar(points["success"], points["speed"], **bars, **ERROR_BARS, **look.style)


def _bars(points: pd.DataFrame, what: str) -> list[Sequence[float]]:
    """Distances below and above, never below 0 by rounding."""
    low = (points[what] - points[f"{what}_low"]).clip(lower=0).tolist()
    return [low, (points[f"{what}_high"] - points[what]).clip(lower=0).tolist()]


def _label(axes: Sequence[Axes], swept: str, backend: str) -> None:
    texts = (
        (f"noise level ({swept})", "average speed", "(a)"),
        (f"noise level ({swept})", "average success", "(b)"),
        ("average success", "average speed", "(c)"),
    )
    for panel, (x, y, letter) in zip(axes, texts, strict=True):
        panel.set(xlabel=x, ylabel=y, xlim=(-0.04, 1.04), ylim=(-0.04, 1.04))
        panel.set_title(f"{letter} {backend}".strip(), loc="left", fontsize=9)


def _costs(rows: pd.DataFrame) -> Drawn:
    """Mean cost of every configuration against the price of help."""
    figure = Figure(figsize=(5.2, 3.8), layout="constrained")
    axes = figure.subplots()
    table = cost_by_help(rows, HELP_COSTS)
    for n, name in enumerate(table.columns):
        look = LOOKS.get(name, OTHERS[n % len(OTHERS)])
        axes.plot(table.index, table[name], label=name, **look.style)
    axes.axvline(HELP_COST, color="0.6", linewidth=0.8)
    axes.set(
        xlabel="cost of a failed episode (actions)", ylabel="mean cost per episode (actions)", ylim=(0, None)
    )
    axes.legend(frameon=False, fontsize=8)
    caption = (
        "Mean cost over all conditions: actions attempted, and so many more for every failed episode as "
        f"help is worth. The summary counts {HELP_COST:g} (grey line)."
    )
    return Drawn("cost", caption, figure)
