"""Where compiled kernels are kept: one folder per state of their sources.

numba itself looks only at the file a kernel stands in; it does not see that another one, which the kernel
calls, has changed since. And where it finds no folder to write to, it refuses to work at all.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

KEEP_DAYS = 14
"""Folders of other versions are deleted when they have not been used for so long."""


@contextmanager
def kernels_kept(package: Path) -> Iterator[None]:
    """Modules with kernels that are imported in here, those of `package`, have them kept in their folder.

    numba reads the setting when it meets a kernel; those of other packages keep their own places.
    """
    import numba

    elsewhere, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(kernel_folder(package))
    try:
        yield
    finally:
        numba.config.CACHE_DIR = elsewhere


def kernel_folder(package: Path) -> Path:
    """A folder for the kernels of the sources in the folder `package` as they are now, made if need be; a
    temporary one as a last resort."""
    sources = sorted(package.glob("*.py"))
    digest = hashlib.sha256(b"\0".join(source.read_bytes() for source in sources)).hexdigest()[:16]
    for root in _roots():
        folder = root / f"kernels-{digest}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            os.utime(folder)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError:
            continue
        _clean_up(root)
        return folder
    return Path(tempfile.mkdtemp(prefix="cogarch-kernels-"))


def _roots() -> list[Path]:
    """Where to look for a folder, the user's wish first."""
    wished = os.environ.get("NUMBA_CACHE_DIR")
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return [*([Path(wished)] if wished else []), Path(caches) / "cognitive_arch"]


def _clean_up(root: Path) -> None:
    """Delete what older versions have left behind."""
    long_ago = time.time() - KEEP_DAYS * 86_400
    for folder in root.glob("kernels-*"):
        try:
            if folder.stat().st_mtime < long_ago:
                shutil.rmtree(folder, ignore_errors=True)
        except OSError:
            continue  # another process was quicker
