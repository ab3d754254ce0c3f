"""Where the data lies: `domains/`, `grammar/`, the robot's trials; in a checkout and in a wheel alike."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from cognitive_arch.errors import CogArchError, ConfigError, one_line

MAX_BYTES = 1_000_000
"""Nothing that people write for us is larger; what is larger is not meant for us."""


@cache
def data_root() -> Path:
    """Folder that holds `domains/` and `grammar/`.

    A wheel carries them inside the package (`cognitive_arch/_data`), a checkout beside it.
    """
    package = Path(__file__).resolve().parent
    for root in (package / "_data", package.parent):
        if (root / "domains").is_dir() and (root / "grammar").is_dir():
            return root
    raise ConfigError(f"the installation is incomplete: no domains/ and grammar/ beside {package}")


def domains_dir() -> Path:
    """Folder with one sub-folder per domain."""
    return data_root() / "domains"


def learned_affordances() -> Path:
    """What comes with the project of what was learned about tools and hands."""
    return Path(__file__).resolve().parent / "affordances" / "data" / "learned.json.gz"


def trials_path() -> Path:
    """The robot's own trials of hands and tools; how they were made is told beside them."""
    return Path(__file__).resolve().parent / "affordances" / "data" / "explored.parquet"


def grammar_text(name: str) -> str:
    """Text of `grammar/<name>.lark`."""
    return (data_root() / "grammar" / f"{name}.lark").read_text(encoding="utf-8")


def read_text(path: Path, what: str, error: type[CogArchError], *, limit: int = MAX_BYTES) -> str:
    """Text of a file that a person named; raises `error` in one line if it cannot be one.

    Only plain files of at most `limit` bytes are opened: a pipe or a device might never end.
    """
    try:
        there = path.exists()
    except OSError as problem:  # a name that is too long, or a folder that may not be looked into
        raise error(f"cannot read the {what} '{one_line(path)}': {one_line(problem.strerror)}") from None
    if not there:
        raise error(f"no {what} at '{one_line(path)}'")
    if not path.is_file():
        raise error(f"'{one_line(path)}' is not a file; a {what} is needed")
    try:
        with path.open("rb") as file:
            data = file.read(limit + 1)
        if len(data) > limit:
            raise error(f"'{one_line(path)}' is too large for a {what}: at most {limit} bytes")
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        line = data.count(b"\n", 0, problem.start) + 1
        raise error(f"{one_line(path, 200)}, line {line}: cannot read the {what}: no UTF-8 text") from None
    except OSError as problem:
        raise error(f"cannot read the {what} '{one_line(path)}': {one_line(problem)}") from None
