"""Checks of the arrays that a set is made of."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Array
from lsu_mesh.errors import ModelError

MAX_EDGES = 16
"""A box with more edge directions has more than 65 536 corners: they are not enumerated."""


def are_finite(*arrays: Array) -> bool:
    """Whether no number has outgrown double precision."""
    return all(bool(np.isfinite(array).all()) for array in arrays)


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
    if array.shape != shape and not _fits(array.shape, shape):
        expected = " × ".join("any" if length is None else str(length) for length in shape)
        raise ModelError(f"{name} must have shape {expected}, it has shape {array.shape}")
    if np.count_nonzero(np.isfinite(array)) != array.size:
        raise ModelError(f"{name} must hold finite numbers only")
    array.setflags(write=False)
    return array


def _fits(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    if len(shape) != len(wanted):
        return False
    return all(want is None or got == want for got, want in zip(shape, wanted, strict=True))


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


def box_volume(lower: Array, upper: Array) -> float:
    """``Π (upper_i − lower_i)``; inf where it is too large for a double."""
    return float(math.prod((upper - lower).tolist()))


def corners_are_few(edges: int) -> None:
    """Raises ``ModelError`` where 2^edges corners are too many to be listed."""
    if edges > MAX_EDGES:
        raise ModelError(
            f"a set with {edges} edge directions has 2^{edges} corners, up to 2^{MAX_EDGES} are listed: "
            "project it first, as in support.linear_map([[1, 0, …], [0, 1, …]])"
        )
