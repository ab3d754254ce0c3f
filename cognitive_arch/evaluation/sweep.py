"""What a sweep consists of: the cross product of its settings, and the seed of each of its episodes."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from cognitive_arch.errors import SweepError, one_line, unknown
from cognitive_arch.execution.backends import BACKENDS
from cognitive_arch.execution.heuristics import Heuristics
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.planning.registry import DEFAULT_PLANNER, make_planner
from cognitive_arch.session import Setting

SANDWICH = "make a ham sandwich"
NOISE = (0.0, 0.25, 0.5, 0.75, 0.95)
PUBLISHED = ("none", "creativity", "adaptability", "adaptability+creativity")
CAPABILITIES = tuple(field.name for field in fields(NoiseLevels))
COINS: Mapping[str, str] = {
    "text": "all that an arm does is as noisy as that arm (Sec. 6.4.6.1)",
    "published": "put and drop never fail by noise, as in the published runs",
}
PLANNING_SEEDS = 5
"""So many seeds of planning calls are shared out among the episodes of a cell."""

MOST_EPISODES = 1_000_000
EPISODES_AT_ONCE: Mapping[str, int] = {"symbolic": 10, "drake": 1}
"""How many episodes one job is made of."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One configuration under one noise: the episodes in it differ in nothing but their seeds."""

    scene: str
    backend: str
    planner: str
    vary: str
    heuristics: str
    noise: float
    levels: NoiseLevels


@dataclass(frozen=True, slots=True)
class Job:
    """Some episodes of one cell, done at one go: those from `first` up to but without `end`."""

    cell: Cell
    first: int
    end: int


@dataclass(frozen=True)
class SweepConfig:
    """What is swept. Everything that decides what the rows say is in here, and nothing else.

    `vary` lists groups of capabilities, joined by `+`, whose level is swept; the others stay at `fixed`.
    `both` are both arms and what they do with tools: all four, as in the published "equal arms".
    Raises `SweepError`, or what else is wrong with a setting, saying what would be valid.
    """

    scenes: tuple[str, ...] = ("simple",)
    backends: tuple[str, ...] = ("symbolic",)
    planners: tuple[str, ...] = (DEFAULT_PLANNER,)
    vary: tuple[str, ...] = ("both",)
    heuristics: tuple[str, ...] = PUBLISHED
    noise: tuple[float, ...] = NOISE
    fixed: float = 0.25
    episodes: int = 100
    seed: int = 0
    sentence: str = SANDWICH
    coin: str = "text"
    jitter: float = 0.0

    def __post_init__(self) -> None:
        for name in ("scenes", "backends", "planners", "vary", "heuristics", "noise"):
            values = getattr(self, name)
            what = name.removesuffix("s") if name != "heuristics" else "set of heuristics"
            if not values:
                raise SweepError(f"a sweep needs at least one {what}")
            twice = sorted({str(value) for value in values if values.count(value) > 1})
            if twice:
                raise SweepError(f"{what} {one_line(twice[0])} is given twice")
        if not 1 <= self.episodes <= MOST_EPISODES:
            raise SweepError(f"{self.episodes} episodes; valid: 1 to {MOST_EPISODES}")
        if not 0 <= self.seed < 2**63:
            raise SweepError(f"seed {one_line(self.seed, 30)} is out of range; valid: 0 to {2**63 - 1}")
        for level in (*self.noise, self.fixed):
            if not (math.isfinite(level) and 0 <= level <= 1):
                raise SweepError(f"noise level {level:g} is out of range; valid: 0 to 1")
        for backend in self.backends:
            if backend not in BACKENDS:
                raise SweepError(unknown("backend", backend, BACKENDS))
        if self.coin not in COINS:
            raise SweepError(unknown("coin", self.coin, COINS))
        if not 0 <= self.jitter <= 0.05:
            raise SweepError(f"jitter {self.jitter:g} m is out of range; valid: 0 to 0.05")
        for group in self.vary:
            _capabilities(group)
        for planner in self.planners:
            make_planner(planner)
        for text in self.heuristics:
            Heuristics.parse(text)
        names = [self._check_scene(scene) for scene in self.scenes]
        if len(set(names)) < len(names):
            raise SweepError(f"two of these scenes have the same name: {', '.join(names)}")
        # Files are found again wherever a worker runs.
        found = tuple(str(Path(s).absolute()) if Path(s).is_file() else s for s in self.scenes)
        object.__setattr__(self, "scenes", found)

    def _check_scene(self, scene: str) -> str:
        setting = Setting.load(scene)
        setting.understand(self.sentence)
        return setting.scene.name

    @property
    def total(self) -> int:
        """How many episodes there are in all."""
        return len(tuple(self.cells())) * self.episodes

    def cells(self) -> Iterator[Cell]:
        """All cells, in the order of the rows."""
        for scene, backend, planner, vary, heuristics, noise in itertools.product(
            self.scenes, self.backends, self.planners, self.vary, self.heuristics, self.noise
        ):
            swept = _capabilities(vary)
            levels = {name: noise if name in swept else self.fixed for name in CAPABILITIES}
            yield Cell(scene, backend, planner, vary, heuristics, noise, NoiseLevels(**levels))

    def jobs(self, done: int = 0) -> Iterator[Job]:
        """All episodes, without the first `done`, cut into jobs; in the order of the rows."""
        for n, cell in enumerate(self.cells()):
            first = max(done - n * self.episodes, 0)
            size = EPISODES_AT_ONCE[cell.backend]
            for start in range(first, self.episodes, size):
                yield Job(cell, start, min(start + size, self.episodes))

    def episode_seed(self, episode: int) -> int:
        """The seed of episode number `episode` (from 0), the same in every cell: so they compare in pairs.

        Counting in `SeedSequence` keeps the seeds apart however many there are and whoever asks first.
        """
        return int(
            np.random.SeedSequence([self.seed, episode]).generate_state(1, np.uint64)[0] >> np.uint64(1)
        )

    def planning_seed(self, episode: int) -> int:
        """The seed of every planning call of an episode (see `planning.memory`).

        One of a few, so that plans can be remembered and yet no result hangs on one lucky seed.
        """
        return int(np.random.SeedSequence([self.seed, episode % PLANNING_SEEDS, 1]).generate_state(1)[0])

    def to_json(self) -> dict[str, Any]:
        """Plain data for the manifest; `from_json` reads it back."""
        return {key: list(v) if isinstance(v, tuple) else v for key, v in asdict(self).items()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> SweepConfig:
        """The inverse of `to_json`; raises `SweepError` for what another version has written."""
        try:
            values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in data.items()}
            return cls(**values)
        except TypeError as error:
            raise SweepError(f"this sweep's configuration cannot be read: {one_line(error)}") from None

    def fingerprint(self) -> str:
        """Changes with anything in the scenes, domains or rules that means something."""
        parts = [Setting.load(scene).fingerprint() for scene in self.scenes]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def _capabilities(group: str) -> tuple[str, ...]:
    """The capabilities behind one group of `vary`."""
    if group == "both":
        return CAPABILITIES
    names = tuple(group.split("+"))
    for name in names:
        if name not in CAPABILITIES:
            raise SweepError(unknown("capability to vary", name, ["both", *CAPABILITIES]))
    if len(set(names)) < len(names):
        raise SweepError(f"capability to vary '{group}' names one twice")
    return names


def parse_levels(text: str) -> tuple[float, ...]:
    """Read `0,0.25,0.5`; raises `SweepError`."""
    levels = []
    for part in split(text):
        try:
            levels.append(float(part))
        except ValueError:
            raise SweepError(
                f"'{one_line(part)}' is not a noise level; valid: numbers from 0 to 1, such as 0,0.25,0.5"
            ) from None
    return tuple(levels)


def split(text: str) -> tuple[str, ...]:
    """The parts of a list with commas."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def parse_heuristics(text: str) -> tuple[str, ...]:
    """Read `none,adaptability+creativity`: sets separated by commas, each joined by `+`, in one spelling."""
    return tuple(str(Heuristics.parse(part)).replace(",", "+") for part in split(text))


def published_order(names: Sequence[str]) -> list[str]:
    """Sets of heuristics as the figures list them: the published four first."""
    return sorted(set(names), key=lambda name: (PUBLISHED.index(name) if name in PUBLISHED else 99, name))
