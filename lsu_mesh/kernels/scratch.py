"""Scratch memory of the compiled steps, made once per filter, so that no step allocates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Rows of ``vectors``; a row belongs to the functions of the group that names it and to nobody else.
STRIP = 0  # 0, 1, 2: strip.cut
DELTA = 3  # what rounding has lost, while a set is being made
ENCLOSE = 4  # 4 … 10: enclosure
BOX = 11  # 11 … 14: box steps
BUNDLE = 15  # 15 … 18: bundle steps, and the box around a time update
VECTORS = 19

# Matrices (n, n) of ``squares``.
INVERSE = 0
FACTOR = 1
BASIS = 2
BODY = 3  # edges of the parallelotope that LSUO makes of its box; faces of the parallelotope of a bundle
IDENTITY = 4
SQUARES = 5

# Matrices (n, 2 n + q) of ``pages``, rows of ``picks``.
COLUMNS = 0
CANDIDATES = 1
CHOSEN = 0
BEST = 1


class Scratch(NamedTuple):
    """vectors (VECTORS, n), squares (SQUARES, n, n), state (n + 3, n) for a state on the way; for the columns of a
    zonotope pages (2, n, 2 n + q), weights (n + q,) and picks (2, n), indices of columns.
    """

    vectors: NDArray[np.float64]
    squares: NDArray[np.float64]
    state: NDArray[np.float64]
    pages: NDArray[np.float64]
    weights: NDArray[np.float64]
    picks: NDArray[np.int64]


def scratch(n: int, noise_columns: int) -> Scratch:
    """Scratch for n states and as many columns of the noise (inputs included)."""
    wide = n + noise_columns
    squares = np.zeros((SQUARES, n, n))
    squares[IDENTITY] = np.eye(n)
    return Scratch(
        vectors=np.zeros((VECTORS, n)),
        squares=squares,
        state=np.zeros((n + 3, n)),
        pages=np.zeros((2, n, n + wide)),
        weights=np.zeros(wide),
        picks=np.zeros((2, n), dtype=np.int64),
    )
