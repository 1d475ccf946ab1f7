"""Kernels made of many others: how they are compiled without compiling everything below them again and again.

Numba optimises, with each function, all those that it calls. So a function in the middle is not compiled by itself: its
lines become lines of its one caller.
"""

from __future__ import annotations

from typing import cast

import numba

from lsu_mesh.kernels.runtime import compile as compiling


def entry(function: compiling.F) -> compiling.F:
    """As ``kernel``, for one that only calls others: these are optimised already."""
    return compiling._compiled(function, {}, optimisation=1)


def spliced(function: compiling.F) -> compiling.F:
    """A function whose lines become lines of each caller; it should have one."""
    return cast("compiling.F", numba.njit(inline="always", **compiling._OPTIONS)(function))
