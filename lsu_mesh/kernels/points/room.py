"""Scratch memory of point estimates: one flat array, made once per filter, so that no step allocates.

It holds, for n states, ``ROWS`` vectors (n,), ``SQUARES`` matrices (n, n), and the tableau of the nearest point,
(5 n + 2, 2 n + 2), with the labels of its rows and columns.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.compile import inlined
from lsu_mesh.kernels.runtime.unowned_views import block, line

Room = Vector

SPREAD = 0  # gain of a data update; a mean on the way
RESIDUAL = 1  # what an inverse leaves, by row
TARGET = 2
HALF_WIDTHS = 3
MARGIN = 4
LOWER = 5  # 5, 6: a hull that is not kept
ROWS = 7

COVARIANCE = 0
INVERSE = 1
FACTOR = 2
EDGES = 3
SQUARES = 4


def room(n: int) -> Room:
    """Scratch for n states."""
    return np.zeros(ROWS * n + SQUARES * n * n + (5 * n + 2) * (2 * n + 2) + 7 * n + 1)


@inlined
def row_of(work: Room, n: int, k: int) -> Vector:
    """Vector k, (n,)."""
    return line(work, k * n, n)


@inlined
def square_of(work: Room, n: int, k: int) -> Matrix:
    """Matrix k, (n, n)."""
    return block(work, ROWS * n + k * n * n, n, n)


@inlined
def tableau_of(work: Room, n: int) -> Matrix:
    """The tableau, (5 n + 2, 2 n + 2)."""
    return block(work, ROWS * n + SQUARES * n * n, 5 * n + 2, 2 * n + 2)


@inlined
def labels_of(work: Room, n: int) -> Vector:
    """Labels of the tableau's rows (5 n,), then of its columns (2 n + 1,)."""
    return line(work, ROWS * n + SQUARES * n * n + (5 * n + 2) * (2 * n + 2), 7 * n + 1)
