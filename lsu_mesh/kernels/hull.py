"""Safe maxima of many objectives over one set ``{ξ : A ξ = b, |ξ|∞ ≤ 1}``, and proofs that it is empty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.compile import kernel
from lsu_mesh.kernels.dual import absolute_row_sums, dual_bound
from lsu_mesh.kernels.simplex import (
    basic_levels,
    canonical_tableau,
    climb,
    find_vertex,
    refine_multipliers,
    scaled_rows,
    starting_bounds,
)

Array = NDArray[np.float64]

TIGHT = 0
"""Every bound is reached, to rounding, by a feasible point."""
EMPTY = 1
"""The set is proved to be empty."""
LOOSE = 2
"""Some bound is true but not reached: the simplex was stopped by its limit or by rounding."""

GAP = 1e-9
"""Distance between a bound and the best point found, relative to ``Σ|d_j|``, above which the bound is called loose."""


@kernel
def safe_maxima(D: Array, A: Array, b: Array) -> tuple[int, Array, Array]:
    """Upper bounds of ``max {d'ξ : A ξ = b, |ξ|∞ ≤ 1}`` for the rows d of D (k, g).

    Returns the status, the bounds (k,), rounded up, and points (k, g) that attain them in floating point. The bounds
    are true whatever the status; on ``EMPTY`` they mean nothing. Objectives are solved in order, each from the last vertex,
    the first from a canonical one, so that the same arrays give the same bits.
    """
    k, g = D.shape
    m = A.shape[0]
    values = np.empty(k)
    points = np.empty((k, g))
    rows, sides = scaled_rows(A, b)
    sums = absolute_row_sums(rows)
    T, basis = canonical_tableau(rows)
    at = np.empty(g)
    level = np.empty(m)
    y = np.zeros(m)
    starting_bounds(T, sides, basis, at, level)
    if _contradicts(rows, sides, sums, T, basis, level, y):
        return EMPTY, values, points
    found = find_vertex(T, basis, at, level, y)
    if _farkas(rows, sides, sums, T, y):
        return EMPTY, values, points
    status = TIGHT if found else LOOSE
    for t in range(k):
        d = D[t]
        basic_levels(T, sides, basis, at, level)
        done = climb(T, basis, at, level, d, y)
        refine_multipliers(rows, T, basis, d, y)
        values[t] = dual_bound(d, rows, sides, sums, y)
        reached = 0.0
        size = 0.0
        for j in range(g):
            points[t, j] = at[j]
            size += abs(d[j])
        for i in range(m):
            if basis[i] >= 0:
                points[t, basis[i]] = level[i]
        for j in range(g):
            reached += d[j] * points[t, j]
        if not done or not values[t] - reached <= GAP * size:
            status = LOOSE
    return status, values, points


@kernel
def proves_empty(A: Array, b: Array) -> tuple[bool, bool]:
    """Whether ``{ξ : A ξ = b, |ξ|∞ ≤ 1}`` is proved empty, and whether the simplex came to its end."""
    m, g = A.shape
    rows, sides = scaled_rows(A, b)
    sums = absolute_row_sums(rows)
    T, basis = canonical_tableau(rows)
    at = np.empty(g)
    level = np.empty(m)
    y = np.zeros(m)
    starting_bounds(T, sides, basis, at, level)
    if _contradicts(rows, sides, sums, T, basis, level, y):
        return True, True
    found = find_vertex(T, basis, at, level, y)
    return _farkas(rows, sides, sums, T, y), found


@kernel
def _contradicts(
    rows: Array, sides: Array, sums: Array, T: Array, basis: NDArray[np.int64], level: Array, y: Array
) -> bool:
    """Whether a row that depends on the others proves emptiness: its left side vanishes and its right side does not."""
    m, g = rows.shape
    for i in range(m):
        if basis[i] < 0 and level[i] != 0.0:
            for k in range(m):
                y[k] = -T[i, g + k] if level[i] > 0.0 else T[i, g + k]
            if dual_bound(np.zeros(g), rows, sides, sums, y) < 0.0:
                return True
    return False


@kernel
def _farkas(rows: Array, sides: Array, sums: Array, T: Array, sigma: Array) -> bool:
    """Whether the ray ``y = −σ'B⁻¹`` of phase one proves emptiness."""
    m, g = rows.shape
    y = np.zeros(m)
    some = False
    for i in range(m):
        if sigma[i] != 0.0:
            some = True
            for k in range(m):
                y[k] -= sigma[i] * T[i, g + k]
    return some and dual_bound(np.zeros(g), rows, sides, sums, y) < 0.0
