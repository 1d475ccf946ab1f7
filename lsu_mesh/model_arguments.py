"""Checks of a model's arguments: each problem is named, all of them together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Array
from lsu_mesh.errors import ModelError

if TYPE_CHECKING:
    from lsu_mesh.supports.orthotope import Orthotope


def matrix_argument(name: str, value: ArrayLike, problems: list[str], columns: int = 0) -> Array:
    """A matrix of finite numbers, read-only; an empty list has no rows and so many columns."""
    try:
        matrix = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        problems.append(f"{name} must be a matrix of numbers: {error}")
        return read_only(np.zeros((1, 1)))
    if matrix.size == 0 and matrix.ndim < 2:
        matrix = matrix.reshape(0, columns)
    if matrix.ndim != 2:
        problems.append(f"{name} must be a matrix (a list of rows), it has {matrix.ndim} dimension(s)")
        matrix = np.atleast_2d(matrix.ravel())
    if not np.isfinite(matrix).all():
        problems.append(f"{name} must hold finite numbers only")
    return read_only(np.ascontiguousarray(matrix))


def half_widths_argument(name: str, value: ArrayLike, size: int, of: str, problems: list[str]) -> Array:
    """Finite numbers ≥ 0 (size,), read-only; a scalar stands for all entries."""
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        problems.append(f"{name} must be a list of numbers: {error}")
        return read_only(np.zeros(size))
    if vector.ndim == 0:
        vector = np.full(size, float(vector))
    if vector.shape != (size,):
        problems.append(f"{name} must have {size} entries, one per {of}, it has shape {vector.shape}")
    elif not np.isfinite(vector).all() or (vector < 0).any():
        problems.append(f"{name} must be finite and not negative, it is {vector.tolist()}")
    return read_only(vector)


def offset_argument(name: str, value: ArrayLike | None, size: int, of: str, problems: list[str]) -> Array | None:
    """Finite numbers (size,), read-only; a scalar stands for all entries; ``None`` where all are 0."""
    if value is None:
        return None
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        problems.append(f"{name} must be a list of numbers: {error}")
        return None
    if vector.ndim == 0:
        vector = np.full(size, float(vector))
    if vector.shape != (size,):
        problems.append(f"{name} must have {size} entries, one per {of}, it has shape {vector.shape}")
    elif not np.isfinite(vector).all():
        problems.append(f"{name} must be finite, it is {vector.tolist()}")
    return read_only(vector) if vector.any() else None


def period_argument(value: ArrayLike | Sequence[float | None] | None, size: int, problems: list[str]) -> Array | None:
    """Period of each output (size,), 0 where it has none; ``None`` where none has one."""
    if value is None:
        return None
    entries = [0.0 if entry is None else entry for entry in np.atleast_1d(np.array(value, dtype=object)).tolist()]
    entries = entries * size if np.ndim(np.array(value, dtype=object)) == 0 else entries
    periods = offset_argument("period", entries, size, of="output", problems=problems)
    if periods is not None and (periods < 0).any():
        problems.append(f"period must be above 0, or 0 (or None) where there is none, it is {periods.tolist()}")
    return periods


def feedthrough_argument(value: ArrayLike | None, m: int, p: int, problems: list[str]) -> Array | None:
    """D (m, p); ``None`` where it is 0."""
    if value is None:
        return None
    matrix = matrix_argument("D", value, problems, columns=p)
    if matrix.shape != (m, p):
        problems.append(f"D must have {m} rows, one per output, and {p} columns, one per input; it is {matrix.shape}")
    return matrix if matrix.any() else None


def domain_argument(
    domain: Orthotope | tuple[ArrayLike, ArrayLike] | None, n: int, problems: list[str]
) -> Orthotope | None:
    """A box with one coordinate per state, or ``None``."""
    if domain is None:
        return None
    from lsu_mesh.supports.orthotope import Orthotope

    try:
        box = domain if isinstance(domain, Orthotope) else Orthotope(*domain)
    except (ModelError, TypeError) as error:
        problems.append(f"domain must be a box (lower, upper): {error}")
        return None
    if box.dim != n:
        problems.append(f"domain must have {n} coordinates, one per state, it has {box.dim}")
    return box


def names_argument(
    name: str, value: Sequence[str] | None, size: int, default: str, problems: list[str]
) -> tuple[str, ...]:
    """Names (size,), made up where none are given."""
    if value is None:
        return tuple(f"{default}{i + 1}" if default else "" for i in range(size))
    if len(value) != size:
        problems.append(f"{name} must have {size} entries, it has {len(value)}: {list(value)}")
    return tuple(value)


def read_only(array: Array) -> Array:
    """The same array, read-only."""
    array.setflags(write=False)
    return array
