"""Where the data lies: `domains/` and `grammar/`, in a checkout and in an installed wheel alike."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from cognitive_arch.errors import ConfigError


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


def grammar_text(name: str) -> str:
    """Text of `grammar/<name>.lark`."""
    return (data_root() / "grammar" / f"{name}.lark").read_text(encoding="utf-8")
