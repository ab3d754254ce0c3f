"""Planners, and the compiled inner loops they share."""

from __future__ import annotations

from pathlib import Path

from cognitive_arch.kernel_cache import kernels_kept

with kernels_kept(Path(__file__).parent):
    from cognitive_arch.planning import evaluation, guidance, sampling, sparse_sampling, uct  # noqa: F401
