"""Small dense linear algebra in explicit loops: approximate inverse, orthogonal basis, determinant.

Nothing here is a bound by itself: the caller verifies an inverse or a basis
(``kernels/parallelotopes/enclosure.py``).
"""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix
from lsu_mesh.kernels.runtime.compile import inner, kernel

RANK_TOLERANCE = 1e-14
"""Columns whose residual falls below this share of the longest one take no direction of their own."""


@inner
def invert(T: Matrix, inverse: Matrix, factor: Matrix) -> bool:
    """Gauss–Jordan with row-scaled partial pivoting: ``inverse ≈ T⁻¹``; ``factor`` is scratch, all (n, n).

    Returns ``False`` where a pivot is zero or not finite. The result is an approximation without any promise.
    """
    n = T.shape[0]
    for i in range(n):
        for j in range(n):
            factor[i, j] = T[i, j]
            inverse[i, j] = 1.0 if i == j else 0.0
    for k in range(n):
        row, best = k, -1.0
        for i in range(k, n):
            scale = 0.0
            for j in range(n):
                scale = max(scale, abs(T[i, j]))
            if abs(factor[i, k]) > 0.0 and abs(factor[i, k]) / scale > best:
                row, best = i, abs(factor[i, k]) / scale
        if best <= 0.0:
            return False
        if row != k:
            for j in range(n):
                factor[k, j], factor[row, j] = factor[row, j], factor[k, j]
                inverse[k, j], inverse[row, j] = inverse[row, j], inverse[k, j]
        pivot = 1.0 / factor[k, k]
        if not math.isfinite(pivot):
            return False
        for j in range(n):
            factor[k, j] *= pivot
            inverse[k, j] *= pivot
        for i in range(n):
            multiple = factor[i, k]
            if i != k and multiple != 0.0:
                for j in range(n):
                    factor[i, j] -= multiple * factor[k, j]
                    inverse[i, j] -= multiple * inverse[k, j]
    return True


@inner
def orthogonal_basis(columns: Matrix, count: int, basis: Matrix) -> None:
    """Nearly orthonormal ``basis`` (n, n) along the longest of the first columns, completed by coordinate axes.

    Pivoted modified Gram–Schmidt, each new direction orthogonalised twice. ``columns`` is overwritten.
    """
    n = columns.shape[0]
    longest = 0.0
    for d in range(n):
        best, square = -1, 0.0
        for j in range(count):
            length = 0.0
            for i in range(n):
                length += columns[i, j] * columns[i, j]
            if length > square:
                best, square = j, length
        longest = max(longest, square)
        if best >= 0 and square > longest * RANK_TOLERANCE * RANK_TOLERANCE:
            for i in range(n):
                basis[i, d] = columns[i, best]
            _orthonormalise(basis, d)
        else:
            _complete(basis, d)
        for j in range(count):
            along = 0.0
            for i in range(n):
                along += basis[i, d] * columns[i, j]
            for i in range(n):
                columns[i, j] -= along * basis[i, d]


@inner
def _orthonormalise(basis: Matrix, d: int) -> None:
    n = basis.shape[0]
    for _ in range(2):
        for e in range(d):
            along = 0.0
            for i in range(n):
                along += basis[i, e] * basis[i, d]
            for i in range(n):
                basis[i, d] -= along * basis[i, e]
        length = 0.0
        for i in range(n):
            length += basis[i, d] * basis[i, d]
        length = math.sqrt(length)
        for i in range(n):
            basis[i, d] /= length


@inner
def _complete(basis: Matrix, d: int) -> None:
    """Direction d is the coordinate axis that the first d directions span least."""
    n = basis.shape[0]
    axis, least = 0, 2.0
    for i in range(n):
        spanned = 0.0
        for e in range(d):
            spanned += basis[i, e] * basis[i, e]
        if spanned < least:
            axis, least = i, spanned
    for i in range(n):
        basis[i, d] = 1.0 if i == axis else 0.0
    _orthonormalise(basis, d)


@kernel
def log_abs_determinant(T: Matrix, factor: Matrix) -> float:
    """``ln |det T|`` by elimination with partial pivoting; ``-inf`` where a pivot vanishes. ``factor`` is scratch."""
    n = T.shape[0]
    for i in range(n):
        for j in range(n):
            factor[i, j] = T[i, j]
    logarithm = 0.0
    for k in range(n):
        row = k
        for i in range(k + 1, n):
            if abs(factor[i, k]) > abs(factor[row, k]):
                row = i
        if factor[row, k] == 0.0:
            return -math.inf
        if row != k:
            for j in range(k, n):
                factor[k, j], factor[row, j] = factor[row, j], factor[k, j]
        logarithm += math.log(abs(factor[k, k]))
        for i in range(k + 1, n):
            multiple = factor[i, k] / factor[k, k]
            for j in range(k, n):
                factor[i, j] -= multiple * factor[k, j]
    return logarithm
