"""Kernels made of many others: how they are compiled without compiling everything below them again and again.

Numba optimises, with each function, all those that it calls. So a function in the middle is not compiled by itself: its
lines become lines of its one caller.
"""

from __future__ import annotations

import functools
from typing import Any, cast

from lsu_mesh.kernels.runtime import compile as compiling


class Spliced(compiling.Kernel):
    """A function whose lines numba takes into each kernel that calls it; it has no machine code of its own."""

    @functools.cached_property
    def dispatcher(self) -> Any:
        """What numba knows the function by; imports numba when it is first asked for."""
        import numba

        return numba.njit(inline="always", **compiling._OPTIONS)(self.py_func)


def entry(function: compiling.F) -> compiling.F:
    """As ``kernel``, for one that only calls others: these are optimised already."""
    return cast("compiling.F", compiling.Kernel(function, {}, optimisation=1))


def spliced(function: compiling.F) -> compiling.F:
    """A function whose lines become lines of each caller; it should have one."""
    return cast("compiling.F", Spliced(function, {}, optimisation=1))


class Vectorised(compiling.Kernel):
    """A kernel in which the compiler may turn loops into operations on vectors."""

    @functools.cached_property
    def dispatcher(self) -> Any:
        """As of every kernel."""
        from numba.core import config as numba_config

        config: Any = numba_config
        made = compiling._compiled(self.py_func, compiling._NO_WRAPPERS, optimisation=3)
        compile_signature = type(made).compile.__get__(made)

        def compile_long_loops(signature: Any) -> Any:
            compiling._load_registries_without_scipy()
            before = config.OPT, config.LOOP_VECTORIZE
            config.OPT, config.LOOP_VECTORIZE = type(config.OPT)(3), 1
            try:
                return compile_signature(signature)
            finally:
                config.OPT, config.LOOP_VECTORIZE = before

        made.compile = compile_long_loops
        return made


def vectorised(function: compiling.F) -> compiling.F:
    """As ``inner``, for a loop over many entries, elementwise: vectors of them give the bits of one after the other."""
    return cast("compiling.F", Vectorised(function, {}, optimisation=3))
