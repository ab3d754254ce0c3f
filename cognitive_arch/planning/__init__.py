"""Planners, and the compiled inner loops they share."""

from __future__ import annotations

import numba

from cognitive_arch.planning.kernel_cache import kernel_folder

# numba reads the setting when it meets a kernel, so the modules that hold kernels are imported right here,
# and other packages' kernels keep their own places.
_elsewhere, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(kernel_folder())
try:
    from cognitive_arch.planning import evaluation, guidance, sampling, sparse_sampling, uct  # noqa: F401
finally:
    numba.config.CACHE_DIR = _elsewhere
