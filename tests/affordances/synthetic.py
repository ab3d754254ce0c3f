"""SYNTHETIC trials for tests: made up by a formula, measured on no robot, real or simulated."""

from __future__ import annotations

from typing import Any

import numpy as np

from cognitive_arch.affordances.trials import TrialTable, from_frame
from cognitive_arch.perception.descriptors import describe
from cognitive_arch.perception.top_view import silhouette
from cognitive_arch.shapes import Box, Cylinder, Sphere, ToolShape

DESCRIPTORS = ("convexity", "eccentricity", "compactness")
TOOLS = {"stick": (0.95, 0.10, 0.20), "hook": (0.70, 0.45, 0.25), "rake": (0.60, 0.60, 0.20)}
OBJECTS = {
    "ball": (0.99, 0.98, 0.95), "box": (0.97, 0.80, 0.75), "brick": (0.96, 0.50, 0.60),
    "pear": (0.92, 0.70, 0.80), "cup": (0.90, 0.85, 0.70), "can": (0.98, 0.60, 0.90),
}  # fmt: skip
ACTIONS = ("tapFromRight", "tapFromLeft", "pull", "push")


def synthetic_frame(count: int = 400, seed: int = 0, kind: str = "tool") -> Any:
    """A `DataFrame` of synthetic trials: pulling works with hooks and rakes, balls roll further."""
    import pandas as pd

    rng = np.random.default_rng(seed)
    rows = []
    for number in range(count):
        action = ACTIONS[number % 4]
        tool = str(rng.choice(list(TOOLS)))
        thing = str(rng.choice(list(OBJECTS)))
        far = 0.16 if thing == "ball" else 0.09
        x0, y0 = rng.uniform(-0.60, -0.35), rng.uniform(-0.2, 0.2)
        x, y = {
            "pull": (0.12 if tool != "stick" else 0.0, 0.0),
            "push": (-far, 0.0),
            "tapFromRight": (0.0, -far),
            "tapFromLeft": (0.0, far),
        }[action]
        if rng.random() < 0.1:
            x, y = 0.0, 0.0
        x, y = rng.normal(x, 0.02), rng.normal(y, 0.02)
        shapes = {f"m_{n}": v for n, v in zip(DESCRIPTORS, TOOLS[tool], strict=True)}
        shapes |= {f"o_{n}": v for n, v in zip(DESCRIPTORS, OBJECTS[thing], strict=True)}
        rows.append(
            {"trial": number, "manipulator": tool, "object": thing, "kind": kind, "action": action}
            | {name: value + rng.normal(0, 0.01) for name, value in shapes.items()}
            | {"x0": x0, "y0": y0, "x1": x0 + x, "y1": y0 + y}
        )
    return pd.DataFrame(rows)


def synthetic_trials(count: int = 400, seed: int = 0, kind: str = "tool") -> TrialTable:
    """The same as a table."""
    return from_frame(synthetic_frame(count, seed, kind), "synthetic trials")


SHAPES = {
    "box": Box(type="box", size=(0.05, 0.05, 0.04)), "slab": Box(type="box", size=(0.075, 0.055, 0.02)),
    "slice": Cylinder(type="cylinder", radius=0.03, height=0.02),
    "disc": Cylinder(type="cylinder", radius=0.04, height=0.03), "ball": Sphere(type="sphere", radius=0.032),
}  # fmt: skip
BARS = (0.0, 0.06, 0.10, 0.14, 0.18)
"""Metres: the bars of the tools in `seen_trials`."""
TELLING = ("area", "convexity", "eccentricity", "compactness", "circularity", "squareness")


def seen_frame(count: int = 480, seed: int = 0) -> Any:
    """A `DataFrame` of synthetic trials with things as they look from above: a bar that reaches behind an
    object pulls it, and everything pushes."""
    import pandas as pd

    rng = np.random.default_rng(seed)
    tools = {f"bar-{bar:.2f}": ToolShape(type="tool", length=0.34, width=0.018, bar=bar) for bar in BARS}
    looks = {name: describe(silhouette(shape)) for name, shape in {**tools, **SHAPES}.items()}
    rows = []
    for number in range(count):
        action, tool, thing = ACTIONS[number % 4], str(rng.choice(list(tools))), str(rng.choice(list(SHAPES)))
        short = SHAPES[thing].extent[0] / 4 + 0.009 - tools[tool].bar / 2  # m that the bar lacks
        works = rng.random() < 0.95 / (1 + np.exp(short / 0.005)) if action == "pull" else rng.random() < 0.9
        way = {"pull": (0.12, 0.0), "push": (-0.12, 0.0), "tapFromRight": (0.0, -0.12)}
        x, y = way.get(action, (0.0, 0.12))
        x, y = rng.normal(x * works, 0.01), rng.normal(y * works, 0.01)
        x0, y0 = rng.uniform(-0.72, -0.35), rng.uniform(-0.2, 0.2)
        rows.append(
            {"trial": number, "manipulator": tool, "object": thing, "kind": "tool", "action": action}
            | {f"m_{name}": looks[tool].top[name] * rng.normal(1, 0.02) for name in TELLING}
            | {f"o_{name}": looks[thing].whole[name] * rng.normal(1, 0.02) for name in TELLING}
            | {"x0": x0, "y0": y0, "x1": x0 + x, "y1": y0 + y}
        )
    return pd.DataFrame(rows)
