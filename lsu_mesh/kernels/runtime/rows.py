"""Row operations of small dense matrices, vectorised: elementwise, so that the bits are those of a plain loop.

Rows are told by their number: a view of a row costs two atomic operations, more than the arithmetic on it.
"""

from __future__ import annotations

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.splicing import vectorised


@vectorised
def subtract_row(T: Array, i: int, p: int, factor: float) -> None:
    """``T_i ← T_i − factor · T_p``, two different rows."""
    for j in range(T.shape[1]):
        T[i, j] -= factor * T[p, j]


@vectorised
def subtract_from(v: Array, T: Array, p: int, factor: float) -> None:
    """``v ← v − factor · T_p``, as far as the row goes."""
    for j in range(T.shape[1]):
        v[j] -= factor * T[p, j]


@vectorised
def add_row_of(T: Array, i: int, S: Array, p: int, factor: float) -> None:
    """``T_i ← T_i + factor · S_p``, of another matrix."""
    for j in range(T.shape[1]):
        T[i, j] += factor * S[p, j]


@vectorised
def scale_row(T: Array, p: int, factor: float) -> None:
    """``T_p ← factor · T_p``"""
    for j in range(T.shape[1]):
        T[p, j] *= factor
