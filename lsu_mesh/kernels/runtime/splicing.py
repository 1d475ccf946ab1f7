"""Kernels made of many others: how they are compiled without compiling everything below them again and again.

Numba optimises, with each function, all those that it calls. So a function in the middle is not compiled by itself: its
lines become lines of its one caller.
"""

from __future__ import annotations

from typing import Any, cast

import numba

from lsu_mesh.kernels.runtime import compile as compiling


def entry(function: compiling.F) -> compiling.F:
    """As ``kernel``, for one that only calls others: these are optimised already."""
    return compiling._compiled(function, {}, optimisation=1)


def spliced(function: compiling.F) -> compiling.F:
    """A function whose lines become lines of each caller; it should have one."""
    return cast("compiling.F", numba.njit(inline="always", **compiling._OPTIONS)(function))


def vectorised(function: compiling.F) -> compiling.F:
    """As ``inner``, for a loop over many entries, elementwise: vectors of them give the bits of one after the other."""
    made: Any = compiling._compiled(function, compiling._NO_WRAPPERS, optimisation=3)
    compile_signature = type(made).compile.__get__(made)
    config = compiling.config

    def compile_long_loops(signature: Any) -> Any:
        compiling._load_registries_without_scipy()
        before = config.OPT, config.LOOP_VECTORIZE
        config.OPT, config.LOOP_VECTORIZE = type(config.OPT)(3), 1
        try:
            return compile_signature(signature)
        finally:
            config.OPT, config.LOOP_VECTORIZE = before

    made.compile = compile_long_loops
    return cast("compiling.F", made)
