"""Lines of a libPRADA file, and errors that name file and line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from cognitive_arch.errors import RuleError, one_line, unknown
from cognitive_arch.resources import read_text

MAX_BYTES = 64_000_000
"""Ground rules of some hundred entities fill tens of megabytes; nothing meant for us is larger."""

_LINE = re.compile(r"(?:\s++|#[^\n]*+)*+([^#\n]++)")
"""What a line says, after any number of blank lines and comments; these are passed over at once."""

_FEW = 12
_SHOWN = 10
_COMPARED = 5_000


class Line(NamedTuple):
    """A line that is neither blank nor a comment, without surrounding space."""

    number: int
    text: str


@dataclass(frozen=True)
class Source:
    """A file that has been read."""

    path: Path
    what: str
    text: str

    @classmethod
    def read(cls, path: Path, what: str) -> Source:
        """Raises `RuleError` if there is no such file, it is too large, or it is no text."""
        return cls(path, what, read_text(path, what, RuleError, limit=MAX_BYTES))

    def lines(self) -> Iterator[Line]:
        """Lines that say something; lazily, so that noise fails at its first line."""
        number, end = 1, 0
        while match := _LINE.match(self.text, end):
            start = match.start(1)
            number += self.text.count("\n", end, start)
            yield Line(number, match[1].rstrip())
            end = match.end()

    def fail(self, line: int, problem: str) -> RuleError:
        """The error for `problem` in `line`."""
        return RuleError(f"{one_line(self.path, 200)}, line {line}: {problem}")

    def empty(self, valid: str) -> RuleError:
        """The error for a file that says nothing."""
        return self.fail(1, f"there is nothing in this {self.what}; valid: {valid}")

    @property
    def last_line(self) -> int:
        """Number of the last line that says something; 1 if none does."""
        return self.text.count("\n", 0, len(self.text.rstrip())) + 1


def quote(text: str) -> str:
    """`text` quoted on one line, in printable form; a line of megabytes is cut before it is looked at."""
    return f"'{one_line(text[:200], 60) or 'unprintable characters'}'"


def unknown_name(what: str, got: str, valid: Collection[str]) -> str:
    """As `errors.unknown`, but readable with hundreds of valid names: the nearest, the first and how many."""
    if len(valid) <= _FEW:
        return unknown(what, got[:200], valid)
    # Comparing takes long with very many names; then the hint may be missing, but not the message.
    near = difflib.get_close_matches(got[:200], islice(valid, _COMPARED), n=1, cutoff=0.6)
    hint = f" (did you mean {near[0]}?)" if near else ""
    names = ", ".join(sorted(valid)[:_SHOWN])
    more = f"and {len(valid) - _SHOWN} more, {len(valid)} in all"
    return f"unknown {what} {quote(got)}{hint}; valid: {names} {more}"
