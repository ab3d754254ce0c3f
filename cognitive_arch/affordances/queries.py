"""Questions to what was learned (thesis Sec. 2.1.5, 5.4.1.3): effects, actions, tools, properties.

All of them come down to p(EffectX, EffectY | A, M, O, start). What is left open is summed out over the things
known, each as likely; actions, too, are taken to be equally likely beforehand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from cognitive_arch.affordances.registry import Affordances
from cognitive_arch.affordances.trials import ACTIONS, BINS, N_BINS, Floats, TrialTable, action_index
from cognitive_arch.errors import AffordanceError, one_line, unknown

Place = tuple[float, float]
Mask = NDArray[np.bool_]

DIRECTIONS: Mapping[str, tuple[int, tuple[int, ...]]] = {
    "closer": (0, (3, 4)),
    "away": (0, (0, 1)),
    "left": (1, (0, 1)),
    "right": (1, (3, 4)),
}
"""Axis and bins of each direction; left and right are the robot's."""
MEANT: Mapping[str, str] = {
    "tapFromRight": "left", "tapFromLeft": "right", "pull": "closer", "push": "away"
}  # fmt: skip
"""What each action is for."""


def goal_mask(text: str) -> Mask:
    """The cells (5, 5) of x and y bins that a wish allows.

    `closer`, `away`, `left`, `right`, `still`, several joined by `+` (all of them at once), or bins such as
    `x=LP,VP;y=NM`. Raises `AffordanceError` for others.
    """
    mask = np.ones((N_BINS, N_BINS), dtype=bool)
    for part in text.replace(";", "+").split("+"):
        word = part.strip()
        if word == "still":
            mask &= _mask(0, (2,)) & _mask(1, (2,))
        elif word in DIRECTIONS:
            mask &= _mask(*DIRECTIONS[word])
        elif word[:2] in ("x=", "y="):
            names = [name.strip().upper() for name in word[2:].split(",")]
            for name in names:
                if name not in BINS:
                    raise AffordanceError(unknown("bin", name, BINS))
            mask &= _mask("xy".index(word[0]), tuple(BINS.index(name) for name in names))
        else:
            raise AffordanceError(unknown("effect", word, [*DIRECTIONS, "still", "x=BINS", "y=BINS"]))
    if not mask.any():
        raise AffordanceError(f"no effect is '{one_line(text)}': it contradicts itself")
    return mask


def _mask(axis: int, bins: Sequence[int]) -> Mask:
    line = np.isin(np.arange(N_BINS), bins)
    return np.broadcast_to(line[:, None] if axis == 0 else line[None, :], (N_BINS, N_BINS))


@dataclass(frozen=True, eq=False)
class Thing:
    """Something to ask about: its name (or a word for it) and its descriptors (d,)."""

    name: str
    shape: Floats


class Oracle:
    """Answers from what was learned."""

    def __init__(self, learned: Affordances) -> None:
        self.learned = learned

    def manipulator(self, text: str) -> Thing:
        """A posture or tool by its name, or by descriptors such as `convexity=0.8,eccentricity=0.3`."""
        return _thing(text, "manipulator", self.learned.things_m, self.learned.names_m)

    def object(self, text: str) -> Thing:
        """An acted object by its name or descriptors."""
        return _thing(text, "object", self.learned.things_o, self.learned.names_o)

    def effects(
        self, action: str, m: Sequence[Thing], o: Sequence[Thing], start: Place | None = None
    ) -> Floats:
        """p(EffectX, EffectY | action, m, o) for every pair, (len(m), len(o), 5, 5)."""
        pairs = list(product(m, o))
        table = question_table(
            self.learned,
            np.full(len(pairs), action_index(action)),
            np.array([a.shape for a, _ in pairs]),
            np.array([b.shape for _, b in pairs]),
            np.tile(np.array(start or (np.nan, np.nan)), (len(pairs), 1)),
        )
        return self.learned.model.joint(table).reshape(len(m), len(o), N_BINS, N_BINS)

    def predict(
        self,
        action: str | None = None,
        m: Thing | None = None,
        o: Thing | None = None,
        start: Place | None = None,
    ) -> Floats:
        """p(EffectX, EffectY | what is given), (5, 5); with less than everything these are the properties of
        an action, an object, or a tool."""
        actions = [action] if action else list(ACTIONS)
        each = [self.effects(a, self._or_all_m(m), self._or_all_o(o), start) for a in actions]
        averaged: Floats = np.mean(each, axis=(0, 1, 2))
        return averaged

    def select_action(
        self, goal: Mask, m: Thing | None, o: Thing | None, start: Place | None = None
    ) -> dict[str, tuple[float, float]]:
        """For each action p(goal | action, m, o) and p(action | goal, m, o), the best one first."""
        chances = {a: float(self.predict(a, m, o, start)[goal].sum()) for a in ACTIONS}
        return _ranked(chances)

    def select_tool(
        self, goal: Mask, action: str, tools: Sequence[Thing], o: Thing | None, start: Place | None = None
    ) -> dict[str, tuple[float, float]]:
        """For each tool p(goal | action, tool, o) and p(tool | goal, action, o), the best one first."""
        action_index(action)
        chances = {t.name: float(self.predict(action, t, o, start)[goal].sum()) for t in tools}
        return _ranked(chances)

    def _or_all_m(self, m: Thing | None) -> list[Thing]:
        return [m] if m else [Thing(n, s) for n, s in self.learned.things_m.items()]

    def _or_all_o(self, o: Thing | None) -> list[Thing]:
        return [o] if o else [Thing(n, s) for n, s in self.learned.things_o.items()]


def _ranked(chances: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    total = sum(chances.values())
    order = sorted(chances, key=lambda name: -chances[name])
    return {name: (chances[name], chances[name] / total if total else 0.0) for name in order}


def _thing(text: str, what: str, things: Mapping[str, Floats], names: Sequence[str]) -> Thing:
    if text in things:
        return Thing(text, things[text])
    if "=" not in text:
        raise AffordanceError(f"{unknown(what, text, things)}; or its descriptors: {', '.join(names)}")
    values: dict[str, float] = {}
    for part in text.split(","):
        name, _, number = (p.strip() for p in part.partition("="))
        if name not in names:
            raise AffordanceError(unknown("descriptor", name, names))
        try:
            values[name] = float(number)
        except ValueError:
            values[name] = float("nan")
        if not np.isfinite(values[name]):
            raise AffordanceError(f"descriptor {name} is '{one_line(number, 30)}'; valid: a finite number")
    missing = [name for name in names if name not in values]
    if missing:
        raise AffordanceError(f"the {what} lacks the descriptors {', '.join(missing)}")
    return Thing("(as described)", np.array([values[name] for name in names]))


def question_table(
    learned: Affordances, action: NDArray[np.integer], m: Floats, o: Floats, start: Floats
) -> TrialTable:
    """Trials that were never made, to be predicted: actions (n,), descriptors (n, a) and (n, c), places
    (n, 2), NaN where not known."""
    n = len(action)
    return TrialTable(
        trial=np.arange(n),
        action=np.asarray(action, dtype=np.int64),
        manipulator=np.full(n, "?"),
        object=np.full(n, "?"),
        kind=np.full(n, ""),
        shape_m=m,
        shape_h=np.zeros((n, 0)),
        shape_o=o,
        names_m=learned.names_m,
        names_h=(),
        names_o=learned.names_o,
        start=start,
        effect=np.zeros((n, 2)),
        source="a question",
    )


@dataclass(frozen=True, eq=False)
class Lookup:
    """p(EffectX, EffectY | A, M, O, start) of known things, computed beforehand: a question is one look-up.

    `table` (actions, m, o, cells along x, along y, 5, 5); `low` and `step` (2,) metres lay out the cells.
    """

    manipulators: tuple[str, ...]
    objects: tuple[str, ...]
    table: Floats
    low: tuple[float, float]
    step: tuple[float, float]

    @classmethod
    def of(
        cls,
        learned: Affordances,
        m: Sequence[Thing],
        o: Sequence[Thing],
        area: tuple[Place, Place] | None = None,
        cells: int = 12,
    ) -> Lookup:
        """Compute the distributions of all pairs for places in the middles of `cells` x `cells` cells of an
        `area` (its lowest and highest x and y), or for a place that is not known."""
        side, low, step = 1, (0.0, 0.0), (np.inf, np.inf)
        places = np.full((1, 2), np.nan)
        if area is not None:
            side, low = cells, area[0]
            step = ((area[1][0] - area[0][0]) / cells, (area[1][1] - area[0][1]) / cells)
            if min(step) <= 0:
                raise AffordanceError("an area goes from its lowest to its highest x and y")
            middles = (np.arange(cells) + 0.5)[:, None] * np.array(step) + np.array(low)
            places = np.array(list(product(middles[:, 0], middles[:, 1])))
        sizes = (len(ACTIONS), len(m), len(o), len(places))
        action, which_m, which_o, place = np.indices(sizes).reshape(4, -1)
        table = question_table(
            learned,
            action,
            np.array([t.shape for t in m])[which_m],
            np.array([t.shape for t in o])[which_o],
            places[place],
        )
        joint = learned.model.joint(table).reshape(*sizes[:3], side, side, N_BINS, N_BINS)
        return cls(
            tuple(t.name for t in m),
            tuple(t.name for t in o),
            joint,
            low,
            step,
        )

    def __call__(self, action: int, m: int, o: int, place: Place = (0.0, 0.0)) -> Floats:
        """(5, 5) for numbers of an action and of things, in the order they were given; a place beyond the
        area counts as its border."""
        side = self.table.shape[3] - 1
        row = int((place[0] - self.low[0]) / self.step[0])
        column = int((place[1] - self.low[1]) / self.step[1])
        answer: Floats = self.table[action, m, o, min(max(row, 0), side), min(max(column, 0), side)]
        return answer


def matrix_text(joint: Floats) -> str:
    """The 5 x 5 matrix as (21) and (22) have it: rows from closer to away, columns from left to right."""
    lines = ["              left <- y -> right", "              " + "".join(f"{b:>8}" for b in BINS)]
    for row in reversed(range(N_BINS)):
        word = {4: "closer", 0: "away"}.get(row, "")
        lines.append(f"  {word:>7} {BINS[row]:>3} " + "".join(f"{p:8.4f}" for p in joint[row]))
    return "\n".join(lines)
