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
BODY = 3  # edges of the parallelotope that LSUO makes of its box
SQUARES = 4


class Scratch(NamedTuple):
    """vectors (VECTORS, n), squares (SQUARES, n, n); columns, candidates (n, n + q) and weights (n + q,) for a zonotope's
    columns; chosen, best (n,) their indices; state (n + 3, n) for a state on the way; no_columns (n, 0), no_weights
    (0,) stand for no noise.
    """

    vectors: NDArray[np.float64]
    squares: NDArray[np.float64]
    columns: NDArray[np.float64]
    candidates: NDArray[np.float64]
    weights: NDArray[np.float64]
    chosen: NDArray[np.int64]
    best: NDArray[np.int64]
    state: NDArray[np.float64]
    no_columns: NDArray[np.float64]
    no_weights: NDArray[np.float64]


def scratch(n: int, noise_columns: int) -> Scratch:
    """Scratch for n states and as many columns of the noise (inputs included)."""
    wide = n + noise_columns
    return Scratch(
        vectors=np.zeros((VECTORS, n)),
        squares=np.zeros((SQUARES, n, n)),
        columns=np.zeros((n, wide)),
        candidates=np.zeros((n, wide)),
        weights=np.zeros(wide),
        chosen=np.zeros(n, dtype=np.int64),
        best=np.zeros(n, dtype=np.int64),
        state=np.zeros((n + 3, n)),
        no_columns=np.zeros((n, 0)),
        no_weights=np.zeros(0),
    )
