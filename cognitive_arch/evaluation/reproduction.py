"""What of the published tables and figures can be recomputed: a registry, and the form of the answer."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from cognitive_arch.errors import ConfigError, unknown


@dataclass(frozen=True, slots=True)
class Options:
    """What a reproduction may use: `out` is a folder for its files, `data` one with data sets.

    `episodes` (or splits) is None for as many as published; `jobs` processes may share the work. `trials` is
    a file of affordance trials, `protocol` how they are split (see `affordances.evaluation`). Raises
    `ConfigError` for a seed or a number of processes there cannot be.
    """

    out: Path
    data: Path | None = None
    episodes: int | None = None
    seed: int = 0
    jobs: int = 1
    trials: Path | None = None
    protocol: str = "trial"
    on_progress: Callable[[int, int], None] = lambda done, total: None
    on_notice: Callable[[str], None] = lambda text: None

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ConfigError(f"seed {self.seed}; valid: 0 or more")
        if not 1 <= self.jobs <= 1024:
            raise ConfigError(f"{self.jobs} jobs; valid: 1 to 1024")


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was published, what we got, and whether that agrees.

    `what` says what is compared, `published` quotes or gives the figure, `ours` gives ours. `bound` is told
    where something is missed that nobody can reach: what the best possible is, and that ours comes close.
    """

    what: str
    published: str
    ours: str
    holds: bool
    bound: str = ""

    @property
    def verdict(self) -> str:
        """In one word."""
        return "agrees" if self.holds else "bound" if self.bound else "differs"


@dataclass(frozen=True, slots=True)
class Reproduced:
    """The answer: checks, the numbers behind them (plain data), and the files that were written."""

    checks: tuple[Check, ...]
    numbers: Mapping[str, Any] = field(default_factory=dict)
    files: tuple[Path, ...] = ()


Recompute: TypeAlias = Callable[[Options], Reproduced]


@dataclass(frozen=True, slots=True)
class Reproduction:
    """What is recomputed, where it was published, and by which `module:function` (a `Recompute`)."""

    title: str
    source: str
    function: str

    def load(self) -> Recompute:
        """The function; its module is imported only now."""
        module, _, name = self.function.partition(":")
        recompute: Recompute = getattr(importlib.import_module(module), name)
        return recompute


_SWEEPS = "cognitive_arch.evaluation.published_sweeps"
_AFFORDANCES = "cognitive_arch.evaluation.published_affordances"

REPRODUCTIONS: Mapping[str, Reproduction] = {
    "table6": Reproduction("complexity of the networks", "thesis Table 6", f"{_AFFORDANCES}:table6"),
    "table8": Reproduction("networks on random splits", "thesis Table 8", f"{_AFFORDANCES}:table8"),
    "table9": Reproduction("networks on unseen objects", "thesis Table 9", f"{_AFFORDANCES}:table9"),
    "table10": Reproduction("simulation to reality", "thesis Table 10", f"{_AFFORDANCES}:table10"),
    "table11": Reproduction("accuracy from hands to tools", "thesis Table 11", f"{_AFFORDANCES}:table11"),
    "table12": Reproduction("tools chosen by who knows hands", "thesis Table 12", f"{_AFFORDANCES}:table12"),
    "fig46": Reproduction("effects of pulling, on the table", "thesis Fig. 46", f"{_AFFORDANCES}:fig46"),
    "fig47": Reproduction("motions by hands and by tools", "thesis Fig. 47", f"{_AFFORDANCES}:fig47"),
    "fig58": Reproduction("simple scene, both arms equally noisy", "thesis Fig. 58", f"{_SWEEPS}:fig58"),
    "fig59": Reproduction("simple scene, left arm's noise varied", "thesis Fig. 59", f"{_SWEEPS}:fig59"),
    "fig60": Reproduction("complex scene, both arms equally noisy", "thesis Fig. 60", f"{_SWEEPS}:fig60"),
    "fig61": Reproduction("complex scene, left arm's noise varied", "thesis Fig. 61", f"{_SWEEPS}:fig61"),
    "reliability": Reproduction(
        "the heuristic set of our own against the published four",
        "Figs. 58 to 61",
        "cognitive_arch.evaluation.reliability_study:reliability",
    ),
}
"""All that `cogarch reproduce` knows, by name."""


def reproduce(name: str, options: Options) -> dict[str, Any]:
    """Recompute `name`; returns the fields of `reproduce --json`. Raises `ConfigError` for an unknown one."""
    if name not in REPRODUCTIONS:
        raise ConfigError(unknown("table or figure", name, REPRODUCTIONS))
    entry = REPRODUCTIONS[name]
    with_trials = [key for key, one in REPRODUCTIONS.items() if one.function.startswith(_AFFORDANCES)]
    if options.trials is not None and name not in with_trials:
        raise ConfigError(f"{name} uses no affordance trials; --trials is for {', '.join(with_trials)}")
    started = time.perf_counter()
    found = entry.load()(options)
    notes = list(found.numbers.get("notes", ()))
    if options.episodes is not None:
        notes.append(f"with {options.episodes} episodes a point (or splits), not as many as published")
    return {
        "name": name,
        "title": entry.title,
        "source": entry.source,
        "success": all(check.verdict != "differs" for check in found.checks),
        "checks": [
            # numpy's comparisons are no truth values of JSON
            {"what": c.what, "published": c.published, "ours": c.ours, "holds": bool(c.holds)}
            | ({"bound": c.bound} if c.verdict == "bound" else {})
            for c in found.checks
        ],
        **found.numbers,
        **({"notes": notes} if notes else {}),
        "seed": options.seed,
        "files": [str(path) for path in found.files],
        "wall_s": round(time.perf_counter() - started, 3),
    }


def listing() -> dict[str, Any]:
    """All names with what they stand for."""
    return {name: {"title": entry.title, "source": entry.source} for name, entry in REPRODUCTIONS.items()}


def listing_text() -> str:
    """The same for a terminal."""
    width = max(map(len, REPRODUCTIONS))
    return "\n".join(f"{name:<{width}}  {e.source}: {e.title}" for name, e in REPRODUCTIONS.items())


def answer_text(answer: Mapping[str, Any]) -> str:
    """The answer of `reproduce` for a terminal: every check with ours beside the published."""
    lines = [f"{answer['source']}: {answer['title']}"]
    for check in answer["checks"]:
        word = "agrees " if check["holds"] else "BOUND  " if "bound" in check else "DIFFERS"
        lines.append(f"{word}  {check['what']}")
        lines.append(f"           published  {check['published']}")
        lines.append(f"           ours       {check['ours']}")
        if "bound" in check:
            lines.append(f"           bound      {check['bound']}")
    agreeing = sum(check["holds"] for check in answer["checks"])
    bounded = sum("bound" in check for check in answer["checks"])
    lines.extend(f"note     {note}" for note in answer.get("notes", ()))
    beyond = f", {bounded} cannot be had by anyone" if bounded else ""
    lines.append(f"{agreeing} of {len(answer['checks'])} agree{beyond}; {answer['wall_s']:.1f} s")
    lines.extend(f"wrote {path}" for path in answer["files"] if not path.endswith(".svg"))
    return "\n".join(lines)
