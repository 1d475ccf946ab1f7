"""Checks of the arrays that a set is made of."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.errors import ModelError

Array = NDArray[np.float64]


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """A read-only, contiguous float64 copy of ``value``; ``None`` in ``shape`` leaves that length open.

    Raises ``ModelError`` that names the array, its shape and the expected one, or that it holds inf or NaN.
    """
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise ModelError(f"{name} must hold numbers: {error}") from error
    if array.size == 0 and array.ndim < len(shape):
        array = np.zeros(tuple(0 if length is None else length for length in shape))
    fits = array.ndim == len(shape) and all(
        want is None or got == want for got, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        expected = " × ".join("any" if length is None else str(length) for length in shape)
        raise ModelError(f"{name} must have shape {expected}, it has shape {array.shape}")
    if not np.isfinite(array).all():
        raise ModelError(f"{name} must hold finite numbers only")
    return frozen(array)


def frozen(array: Array) -> Array:
    """The same array, contiguous and read-only."""
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array


def map_arguments(R: ArrayLike, shift: ArrayLike | None, n: int) -> tuple[Array, Array]:
    """Writable copies of R (k, n) and shift (k,), zeros for ``None``; raises ``ModelError``."""
    matrix = np.array(finite_array("R", R, (None, n)))
    k = matrix.shape[0]
    return matrix, np.zeros(k) if shift is None else np.array(finite_array("shift", shift, (k,)))
