"""How kernels are compiled: numba, cached, no fast-math, no BLAS.

Same bits everywhere: explicit loops in a fixed order, no contraction to fused multiply-add (LLVM contracts only when
fast-math allows it), no library calls but ``sqrt`` and ``abs``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": False}


def kernel(function: F) -> F:
    """Compile ``function`` on its first call and keep the machine code in numba's cache.

    The cache lies in ``NUMBA_CACHE_DIR``, else beside the source, else in the user's cache folder. Where none of
    these can be written the kernel is compiled anew in each process, which costs seconds and nothing else.
    """
    try:
        return cast(F, numba.njit(cache=True, **_OPTIONS)(function))
    except RuntimeError:  # numba: "cannot cache function: no locator available"
        return cast(F, numba.njit(**_OPTIONS)(function))
