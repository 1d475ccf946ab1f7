"""The lifted form of a constrained zonotope, in which it is reduced.

Rows 0 … n−1 are the state, rows n … n+m−1 the constraints (P2023 (14)):

    ``[x; 0] = middle + L ξ + s``,  ``L = [G; A]``,  ``middle = [c; −b]``,  ``|ξ|∞ ≤ 1``,  ``|s| ≤ slack``.

Every change made here is exact for some s within the slack: what floating point loses is added to ``slack`` (n + m,),
rounded up. A multiple of a constraint row may be added to any row, since that row is zero at every point of the set.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma, up
from lsu_mesh.kernels.runtime.scaling import unit_factor


@inner
def lift(c: Array, G: Array, A: Array, b: Array) -> tuple[Array, Array, Array]:
    """``L`` (n + m, g), ``middle`` (n + m,) and ``slack`` = 0."""
    n, g = G.shape
    m = A.shape[0]
    L = np.empty((n + m, g))
    middle = np.empty(n + m)
    for i in range(n):
        middle[i] = c[i]
        for j in range(g):
            L[i, j] = G[i, j]
    for i in range(m):
        middle[n + i] = -b[i]
        for j in range(g):
            L[n + i, j] = A[i, j]
    return L, middle, np.zeros(n + m)


@inner
def unlift(n: int, L: Array, middle: Array) -> tuple[Array, Array, Array, Array]:
    """``(c, G, A, b)`` of a lifted set without slack."""
    N, g = L.shape
    c = np.empty(n)
    b = np.empty(N - n)
    G = np.empty((n, g))
    A = np.empty((N - n, g))
    for i in range(N):
        if i < n:
            c[i] = middle[i]
        else:
            b[i - n] = -middle[i]
        for j in range(g):
            if i < n:
                G[i, j] = L[i, j]
            else:
                A[i - n, j] = L[i, j]
    return c, G, A, b


@inner
def scale_constraints(n: int, L: Array, middle: Array, slack: Array) -> None:
    """Multiply each constraint row by the power of two that brings its largest entry into [½, 1); exact."""
    N, g = L.shape
    for i in range(n, N):
        largest = 0.0
        for j in range(g):
            largest = max(largest, abs(L[i, j]))
        factor = unit_factor(largest)
        if factor != 1.0:
            for j in range(g):
                L[i, j] *= factor
            middle[i] *= factor
            slack[i] *= factor


@inner
def rescale_variables(L: Array, middle: Array, slack: Array, low: Array, high: Array) -> None:
    """``ξ_j = mid_j + rad_j ξ'_j`` for variables known to lie in [low_j, high_j] (Scott et al. 2016, §4.2)."""
    N, g = L.shape
    for j in range(g):
        if not low[j] <= high[j] or (low[j] <= -1.0 and high[j] >= 1.0):
            continue
        mid = 0.5 * (low[j] + high[j])
        rad = max(high[j] - mid, mid - low[j])
        rad = up(rad) if rad > 0.0 else 0.0
        for i in range(N):
            if L[i, j] == 0.0:
                continue
            moved = L[i, j] * mid
            total = middle[i] + moved
            shrunk = L[i, j] * rad
            lost = 2.0 * abs(moved) + abs(total) + abs(shrunk)
            slack[i] = up(slack[i] + up(gamma(2) * lost + UNDERFLOW))
            middle[i] = total
            L[i, j] = shrunk


@inner
def without_zero_columns(L: Array) -> Array:
    """L without the columns that are zero; exact."""
    N, g = L.shape
    used = np.zeros(g, dtype=np.bool_)
    count = 0
    for j in range(g):
        for i in range(N):
            if L[i, j] != 0.0:
                used[j] = True
        if used[j]:
            count += 1
    left = np.empty((N, count))
    z = 0
    for j in range(g):
        if used[j]:
            for i in range(N):
                left[i, z] = L[i, j]
            z += 1
    return left


@inner
def row_scales(L: Array) -> Array:
    """``Σ_j |L_ij|`` of each row, for comparisons that do not depend on units; not rounded."""
    N, g = L.shape
    scale = np.zeros(N)
    for i in range(N):
        for j in range(g):
            scale[i] += abs(L[i, j])
    return scale
