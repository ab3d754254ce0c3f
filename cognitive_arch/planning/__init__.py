"""Planners, and the compiled inner loops they share."""

from __future__ import annotations

from pathlib import Path


def _drop_stale_kernels() -> None:
    """Delete compiled kernels that are older than any source beside them.

    numba looks only at the file a kernel stands in; it does not see that another one, which the kernel
    calls, has changed since.
    """
    here = Path(__file__).parent
    changed = max(source.stat().st_mtime for source in here.glob("*.py"))
    for index in (here / "__pycache__").glob("*.nbi"):
        try:
            if index.stat().st_mtime < changed:
                index.unlink()
        except OSError:
            continue  # another process was quicker, or it is not ours to delete


_drop_stale_kernels()
