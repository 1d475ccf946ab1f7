"""A way in from Python for kernels that only other kernels call."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numba

F = TypeVar("F", bound=Callable[..., object])


def from_python(inner: F) -> F:
    """The same kernel behind a compiled function that Python can call."""
    return numba.njit(error_model="numpy")(lambda *arguments: inner(*arguments))  # type: ignore[no-any-return]
