"""Errors that a person can act on: one base class, one subclass per stage.

A message is one line that names what is wrong and lists what would be valid. The command line prints
it and exits with code 2; it never shows a traceback for any of these.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class CogArchError(Exception):
    """Base of every error caused by what the user gave us (input, files, settings)."""


class ConfigError(CogArchError):
    """A setting, domain, scene or option is unusable."""


class InstructionError(CogArchError):
    """A sentence could not be understood, or speaks of what is not there."""


class RuleError(CogArchError):
    """A rules file is malformed; the message names file and line."""


class GroundingError(CogArchError):
    """Rules and entities do not fit together."""


class PlanningError(CogArchError):
    """A planning problem or a planner's settings are unusable."""


class BackendError(CogArchError):
    """An environment cannot be set up on this machine or for this scene."""


class StateError(CogArchError):
    """A saved state does not fit where it is to be restored."""


class PerceptionError(CogArchError):
    """An image, a camera or what was learned of objects cannot be used."""


class AffordanceError(CogArchError):
    """Trials, a network learned from them, or a question to it cannot be used."""


class StoreError(CogArchError):
    """The run store cannot be opened, read or written."""


class ExplorationError(CogArchError):
    """An exploration, or the file it is to be kept in, is unusable."""


class SweepError(CogArchError):
    """A sweep, or the folder it is to be kept in, is unusable."""


def one_line(text: object, limit: int = 80) -> str:
    """`text` in printable form on one line, its middle cut out beyond `limit` characters (for quoting bad
    input: of a path both ends tell something)."""
    flat = " ".join("".join(c if c.isprintable() else " " for c in str(text)).split())
    if len(flat) <= limit:
        return flat
    end = (limit - 3) // 2
    return f"{flat[: limit - 3 - end]}...{flat[len(flat) - end :]}"


def unknown(what: str, got: object, valid: Iterable[str]) -> str:
    """One line for an unknown name: what it was, the nearest known one, and all that are valid."""
    names = sorted(valid)
    near = difflib.get_close_matches(str(got)[:200].lower(), [n.lower() for n in names], n=1, cutoff=0.6)
    hint = ""
    if near:
        hint = f" (did you mean {next(n for n in names if n.lower() == near[0])}?)"
    return f"unknown {what} '{one_line(got, 60)}'{hint}; valid: {', '.join(names) or 'none'}"
