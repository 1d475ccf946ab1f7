"""Scratch memory of the compiled steps: one flat array, made once per filter, so that no step allocates.

It holds, for n states and q columns of the noise, ``ROWS`` vectors (n,), ``SQUARES`` matrices (n, n), a state on the
way (n + 3, n), and, for the columns of a zonotope, two matrices (n, 2 n + q) and weights (n + q,).
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.compile import inlined
from lsu_mesh.kernels.runtime.unowned_views import block, line

Scratch = Vector

# Vectors; each belongs to the functions of the group that names it and to nobody else.
STRIP = 0  # 0, 1, 2: strip.cut
DELTA = 3  # what rounding has lost, while a set is being made
ENCLOSE = 4  # 4 … 10: enclosure
BOX = 11  # 11, 12, 13: box steps
BUNDLE = 14  # 14, 15, 16: bundle steps, and the box around a time update
CHOSEN = 17  # indices of edges
BEST = 18
ROWS = 19

# Matrices.
INVERSE = 0
FACTOR = 1
BASIS = 2
BODY = 3  # edges of the parallelotope that LSUO makes of its box; faces of the parallelotope of a bundle
IDENTITY = 4
SQUARES = 5


def scratch(n: int, noise_columns: int) -> Scratch:
    """Scratch for n states and as many columns of the noise (inputs included)."""
    memory = np.zeros(ROWS * n + SQUARES * n * n + (n + 3) * n + 2 * n * (2 * n + noise_columns) + n + noise_columns)
    start = ROWS * n + IDENTITY * n * n
    memory[start : start + n * n] = np.eye(n).ravel()
    return memory


@inlined
def row(work: Scratch, n: int, k: int) -> Vector:
    """Vector k, (n,)."""
    return line(work, k * n, n)


@inlined
def square(work: Scratch, n: int, k: int) -> Matrix:
    """Matrix k, (n, n)."""
    return block(work, ROWS * n + k * n * n, n, n)


@inlined
def spare_state(work: Scratch, n: int, rows: int) -> Matrix:
    """Memory of a state, (rows, n)."""
    return block(work, ROWS * n + SQUARES * n * n, rows, n)


@inlined
def columns_of(work: Scratch, n: int, count: int) -> Matrix:
    """Copies of a zonotope's columns, (n, count), count ≤ 2 n + q."""
    return block(work, ROWS * n + SQUARES * n * n + (n + 3) * n, n, count)


@inlined
def candidates_of(work: Scratch, n: int, noise_columns: int) -> Matrix:
    """Edges to choose from, (n, n + noise_columns), noise_columns ≤ q."""
    start = ROWS * n + SQUARES * n * n + (n + 3) * n + n * (2 * n + noise_columns)
    return block(work, start, n, n + noise_columns)


@inlined
def weights_of(work: Scratch, n: int, noise_columns: int) -> Vector:
    """Their weights, (n + noise_columns,)."""
    start = ROWS * n + SQUARES * n * n + (n + 3) * n + 2 * n * (2 * n + noise_columns)
    return line(work, start, n + noise_columns)
