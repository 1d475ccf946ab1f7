"""Order reduction of zonotopes: fewer columns that generate more, with the slack enclosed on the way."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Array, Indices
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma, up
from lsu_mesh.kernels.runtime.rows import add_row_of, subtract_row
from lsu_mesh.kernels.runtime.scaling import unit_factor
from lsu_mesh.kernels.zonotopes.lifted_zonotope import row_scales

MIN_PIVOT = 1e-9
"""A row whose scaled entries are all below this after elimination is not reached by the columns."""
FLOOR = 1e-13
"""Length, as a share of the row, of the axis that is added for such a row."""
SHORTEST = 2.0**-300


@inner
def reduce_columns(L: Array, slack: Array, limit: int) -> Array:
    """Columns (N, ≤ limit) that generate a zonotope which contains ``L ξ ⊕ box(slack)``; limit ≥ N.

    N columns D are chosen as a basis by greedy elimination. A further column ``v = D t`` is swallowed by lengthening
    ``D_i`` by ``|t_i|``, those with the least ``Π(1 + |t_i|) − 1 − Σ|t_i|`` first (Scott et al. 2016, §4.3). What ``v −
    D t`` leaves goes to the slack, and the slack is swallowed last by :func:`swallow_box`, which proves that it may.
    Where it cannot, the smallest columns are boxed instead.
    """
    N, g = L.shape
    D, origin = independent_columns(L)
    M = approximate_inverse(D)
    kept = np.ones(g, dtype=np.bool_)
    rest = g
    for k in range(N):
        if origin[k] >= 0:
            kept[origin[k]] = False
            rest -= 1
    T = _coordinates(M, L)
    length = np.ones(N)
    loose = slack.copy()
    while rest + N > limit and rest > 0:
        j = _least_harm(T, length, kept)
        kept[j] = False
        rest -= 1
        swallow_column(D, L, j, T, length, loose)
    columns = np.empty((N, N + rest))
    finite = True
    for k in range(N):
        for i in range(N):
            columns[i, k] = D[i, k] * length[k]
            M[k, i] /= length[k]
            finite = finite and np.isfinite(columns[i, k]) and np.isfinite(M[k, i])
    if not (finite and swallow_box(columns, M, loose)):
        return box_smallest(L, slack, limit)
    place = N
    for j in range(g):
        if kept[j]:
            for i in range(N):
                columns[i, place] = L[i, j]
            place += 1
    return columns


@inner
def independent_columns(L: Array) -> tuple[Array, Indices]:
    """N independent columns (N, N) by elimination with full pivoting on scaled rows, and where each came from.

    A row that the columns do not reach gets a short unit vector, origin −1.
    """
    N, g = L.shape
    scale = row_scales(L)
    W = np.empty((N, g))
    D = np.zeros((N, N))
    origin = np.empty(N, dtype=np.int64)
    for i in range(N):
        origin[i] = -1
        for j in range(g):
            W[i, j] = L[i, j] / scale[i] if scale[i] > 0.0 else 0.0
    for _ in range(N):
        best, p, q = MIN_PIVOT, -1, -1
        for i in range(N):
            if origin[i] < 0:
                for j in range(g):
                    if abs(W[i, j]) > best:
                        best, p, q = abs(W[i, j]), i, j
        if p < 0:
            break
        origin[p] = q
        for i in range(N):
            D[i, p] = L[i, q]
            if origin[i] < 0 and W[i, q] != 0.0:
                subtract_row(W, i, p, W[i, q] / W[p, q])
                W[i, q] = 0.0
    for i in range(N):
        if origin[i] < 0:
            D[i, i] = max(FLOOR * scale[i], SHORTEST)
    return D, origin


@inner
def approximate_inverse(D: Array) -> Array:
    """``M ≈ D⁻¹`` (N, N) by Gauss–Jordan elimination with pivoting of scaled rows; not finite for singular D."""
    N = D.shape[0]
    W = np.zeros((N, 2 * N))
    for i in range(N):
        largest = 0.0
        for j in range(N):
            largest = max(largest, abs(D[i, j]))
        factor = unit_factor(largest)
        for j in range(N):
            W[i, j] = D[i, j] * factor
        W[i, N + i] = factor
    for k in range(N):
        p = k
        for i in range(k + 1, N):
            if abs(W[i, k]) > abs(W[p, k]):
                p = i
        if p != k:
            for j in range(2 * N):
                W[p, j], W[k, j] = W[k, j], W[p, j]
        pivot = W[k, k]
        for j in range(2 * N):
            W[k, j] /= pivot
        for i in range(N):
            factor = W[i, k]
            if i != k and factor != 0.0:
                subtract_row(W, i, k, factor)
    M = np.empty((N, N))
    for i in range(N):
        for j in range(N):
            M[i, j] = W[i, N + j]
    return M


@inner
def _coordinates(M: Array, L: Array) -> Array:
    """``M L``, (N, g)."""
    N, g = L.shape
    T = np.zeros((N, g))
    for i in range(N):
        for s in range(N):
            factor = M[i, s]
            if factor != 0.0:
                add_row_of(T, i, L, s, factor)
    return T


@inner
def _least_harm(T: Array, length: Array, kept: NDArray[np.bool_]) -> int:
    """The kept column whose swallowing adds least: ``Π(1 + s_i) − 1 − Σ s_i`` with ``s_i = |t_i| / length_i``."""
    best, chosen = np.inf, -1
    for j in range(T.shape[1]):
        if not kept[j]:
            continue
        product, total = 1.0, 0.0
        for i in range(T.shape[0]):
            share = abs(T[i, j]) / length[i]
            product *= 1.0 + share
            total += share
        harm = product - 1.0 - total
        if chosen < 0 or harm < best:
            best, chosen = harm, j
    return chosen


@inner
def swallow_column(D: Array, L: Array, j: int, T: Array, length: Array, slack: Array) -> None:
    """Lengthen the basis by |t| and add what ``L_j − D t`` leaves, rounded up, to the slack."""
    N = D.shape[0]
    for i in range(N):
        left = L[i, j]
        mass = abs(left)
        for k in range(N):
            product = D[i, k] * T[k, j]
            left -= product
            mass += abs(product)
        slack[i] = up(slack[i] + up(abs(left) + gamma(N + 2) * mass + UNDERFLOW))
    for k in range(N):
        length[k] = up(length[k] + abs(T[k, j]))


@inner
def swallow_box(columns: Array, M: Array, slack: Array) -> bool:
    """Lengthen the first N columns C in place until they generate ``C ξ ⊕ box(slack)``; ``False`` without a proof.

    M ≈ C⁻¹, (N, N). With ``s ≥ slack + |I − C M| s`` the series for the inverse gives ``|C⁻¹| slack ≤ |M| s =: τ``. The
    lengthened columns are rounded, ``C' = C diag(1 + τ) + Δ`` with ``|Δ| ≤ u |C'|``; ``C' box(1)`` holds ``C box(1 +
    q)`` as soon as ``q + |C⁻¹||Δ| 1 ≤ τ``. So ``8 u`` times the row sums of |C| enter the slack beforehand (C itself
    was rounded once, C' is at most 1.5 times as long, and both are doubled), and ``τ ≤ ½`` is checked.
    """
    N = columns.shape[0]
    given = np.empty(N)
    residual = np.empty((N, N))
    for i in range(N):
        total = 0.0
        for k in range(N):
            total += abs(columns[i, k])
        given[i] = up(up(slack[i] + 2.0**-50 * total) + UNDERFLOW)
        for k in range(N):
            left = 1.0 if i == k else 0.0
            mass = left
            for s in range(N):
                product = columns[i, s] * M[s, k]
                left -= product
                mass += abs(product)
            residual[i, k] = up(abs(left) + gamma(N + 2) * mass + UNDERFLOW)
    trial = given
    for _ in range(4):
        trial = _plus_image(given, residual, trial, 1.25)
    image = _plus_image(given, residual, trial, 1.0)
    longer = np.empty(N)
    for k in range(N):
        total = 0.0
        for i in range(N):
            total += abs(M[k, i]) * trial[i]
        longer[k] = up(1.0 + up(total * (1.0 + gamma(N + 2)) + UNDERFLOW))
    for i in range(N):
        if not (image[i] <= trial[i] and longer[i] <= 1.5):
            return False
    for i in range(N):
        for k in range(N):
            columns[i, k] *= longer[k]
    return True


@inner
def _plus_image(given: Array, residual: Array, trial: Array, factor: float) -> Array:
    """``given + factor · residual · trial``, rounded up."""
    N = given.size
    image = np.empty(N)
    for i in range(N):
        total = 0.0
        for k in range(N):
            total += residual[i, k] * trial[k]
        image[i] = up(given[i] + up(factor * total * (1.0 + gamma(N + 2)) + UNDERFLOW))
    return image


@inner
def box_smallest(L: Array, slack: Array, limit: int) -> Array:
    """Columns (N, ≤ limit): N axes that hold box(slack) and the smallest columns of L, beside the largest ones.

    The size of a column is its 1-norm less its ∞-norm, on scaled rows (Combastel 2015; Girard 2005).
    """
    N, g = L.shape
    scale = row_scales(L)
    size = np.zeros(g)
    for j in range(g):
        largest = 0.0
        for i in range(N):
            if scale[i] > 0.0:
                share = abs(L[i, j]) / scale[i]
                size[j] += share
                largest = max(largest, share)
        size[j] -= largest
    whole = max(0, min(g, limit - N))
    columns = np.zeros((N, whole + N))
    boxed = np.ones(g, dtype=np.bool_)
    for z in range(whole):
        best = -1
        for j in range(g):
            if boxed[j] and (best < 0 or size[j] > size[best]):
                best = j
        boxed[best] = False
        for i in range(N):
            columns[i, z] = L[i, best]
    for i in range(N):
        total = 0.0
        for j in range(g):
            if boxed[j]:
                total += abs(L[i, j])
        columns[i, whole + i] = up(up(total * (1.0 + gamma(g))) + slack[i])
    return columns
