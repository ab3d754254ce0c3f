"""Noise levels: the probability that a motor action fails, per capability (thesis Sec. 6.4.6.1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

from cognitive_arch.errors import ConfigError, one_line, unknown
from cognitive_arch.relational.symbols import GroundAction


@dataclass(frozen=True, slots=True)
class NoiseLevels:
    """One level in [0, 1] per capability; prints itself as the command line takes it."""

    left: float = 0.0
    right: float = 0.0
    pull: float = 0.0
    push: float = 0.0

    def __post_init__(self) -> None:
        for name, level in asdict(self).items():
            if not (math.isfinite(level) and 0 <= level <= 1):
                raise ConfigError(f"noise level {name}={level:g} is out of range; valid: 0 to 1")

    def __str__(self) -> str:
        return ",".join(f"{name}={_shortest(level)}" for name, level in asdict(self).items())

    def __bool__(self) -> bool:
        return any(asdict(self).values())

    @classmethod
    def parse(cls, text: str) -> NoiseLevels:
        """Read `0.25` (all capabilities) or `left=0.5,right=0.25`; what is not named is 0."""
        names = [f.name for f in fields(cls)]
        if "=" not in text:
            level = _level(text)
            return cls(**dict.fromkeys(names, level))
        levels: dict[str, float] = {}
        for part in text.split(","):
            name, _, value = part.partition("=")
            if name.strip() not in names:
                raise ConfigError(unknown("noise capability", name.strip(), names))
            if name.strip() in levels:
                raise ConfigError(f"noise capability {name.strip()} is given twice in '{one_line(text)}'")
            levels[name.strip()] = _level(value)
        return cls(**levels)

    def of(self, action: GroundAction, capabilities: Mapping[str, str]) -> float:
        """The level that applies to `action` (see `capability`)."""
        return float(asdict(self)[capability(action, capabilities)])


def capability(action: GroundAction, capabilities: Mapping[str, str]) -> str:
    """Whose level applies to `action`: `pull`, `push`, or that of the arm that does it, `left` or `right`.

    `capabilities` maps action names to `arm`, `pull` or `push` (from the domain file); actions that are not
    named there belong to the arm.
    """
    found = capabilities.get(action.name, "arm")
    if found == "arm":
        return "left" if "LeftHand" in action.args else "right"
    return found


def _shortest(level: float) -> str:
    """The number as people write it, and exactly."""
    return next(text for text in (f"{level:g}", repr(level)) if float(text) == level)


def _level(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ConfigError(
            f"'{one_line(text)}' is not a noise level; "
            "valid: a number from 0 to 1, or left=..,right=..,pull=..,push=.."
        ) from None
