"""Elimination of constraints from a lifted constrained zonotope, the least harmful first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma, up
from lsu_mesh.kernels.runtime.rows import subtract_row
from lsu_mesh.kernels.zonotopes.lifted_zonotope import row_scales

MIN_PIVOT = 2.0**-10
"""Entries of a scaled constraint row below this are not used to eliminate a variable."""


@inner
def drop_constraint(n: int, L: Array, middle: Array, slack: Array) -> tuple[Array, Array, Array]:
    """Remove the constraint and the generator that are estimated to matter least; (N − 1, g − 1), (N − 1,), (N − 1,).

    Solving row i for ξ_j and substituting is exact but for the forgotten ``|ξ_j| ≤ 1``. The estimate of the harm is the
    length of the shortest move ``(d, G d)`` with ``A d = 0`` in which ξ_j goes as far beyond 1 as row i allows
    (Scott et al. 2016, §4.2). Constraint rows must be scaled.
    """
    N, g = L.shape
    row_of = np.empty(g, dtype=np.int64)
    beyond = np.empty(g)
    overruns(n, L, middle, row_of, beyond)
    freedom = movability(n, L)
    best, j_best = np.inf, -1
    for j in range(g):
        if row_of[j] < 0:
            continue
        harm = 0.0 if beyond[j] == 0.0 else beyond[j] * beyond[j] / max(freedom[j], 1e-14)
        if harm < best:
            best, j_best = harm, j
    if j_best < 0:  # rows of zeros: forgetting a constraint is an outer approximation too
        return _without(L, N - 1, -1), _shorter(middle, N - 1), _shorter(slack, N - 1)
    i_best = row_of[j_best]
    eliminate(L, middle, slack, i_best, j_best)
    return _without(L, i_best, j_best), _shorter(middle, i_best), _shorter(slack, i_best)


@inner
def overruns(n: int, L: Array, middle: Array, row_of: NDArray[np.int64], beyond: Array) -> None:
    """For each variable the constraint row that holds it best (−1: none) and how far beyond 1 that row lets it go."""
    N, g = L.shape
    for j in range(g):
        row_of[j] = -1
        beyond[j] = np.inf
    for i in range(n, N):
        total = abs(middle[i])
        for k in range(g):
            total += abs(L[i, k])
        for j in range(g):
            pivot = abs(L[i, j])
            if pivot >= MIN_PIVOT:
                over = max(0.0, (total - pivot) / pivot - 1.0)
                if over < beyond[j]:
                    row_of[j], beyond[j] = i, over


@inner
def movability(n: int, L: Array) -> Array:
    """``P_jj`` (g,): the square of the largest ξ_j among the moves d with ``A d = 0`` and ``|d|² + |G d|² = 1``.

    P is the top left block of the projector onto the null space of ``M = [A 0; G −I]``: ``P_jj = 1 − a_j'(M M')⁻¹ a_j``
    with ``a_j = (A_j, G_j)``. Rows of G are divided by their scale. Directions of M that depend on others are left out.
    """
    N, g = L.shape
    scale = row_scales(L)
    W = np.empty((N, g))
    for i in range(N):
        factor = 1.0 / scale[i] if i < n and scale[i] > 0.0 else 1.0
        for j in range(g):
            W[i, j] = L[i, j] * factor
    S = np.empty((N, N))
    for i in range(N):
        for k in range(i + 1):
            total = 1.0 if i == k and i < n else 0.0
            for j in range(g):
                total += W[i, j] * W[k, j]
            S[i, k] = total
    for i in range(N):  # Cholesky factor, with rows that vanish left at zero
        whole = S[i, i]
        for k in range(i + 1):
            total = S[i, k]
            for t in range(k):
                total -= S[i, t] * S[k, t]
            if k < i:
                S[i, k] = total / S[k, k] if S[k, k] > 0.0 else 0.0
            else:
                S[i, i] = np.sqrt(total) if total > 1e-12 * whole else 0.0
    freedom = np.ones(g)
    for i in range(N):  # forward substitution for all columns at once
        for k in range(i):
            factor = S[i, k]
            if factor != 0.0:
                subtract_row(W, i, k, factor)
        inverse = 1.0 / S[i, i] if S[i, i] > 0.0 else 0.0
        for j in range(g):
            W[i, j] *= inverse
            freedom[j] -= W[i, j] * W[i, j]
    return freedom


@inner
def eliminate(L: Array, middle: Array, slack: Array, i: int, j: int) -> None:
    """Clear column j in every row but the constraint i, by adding multiples of row i; slack takes the rounding.

    With ``f = fl(L_sj / L_ij)`` the exact new entry is ``L_sk − f L_ik`` (any f is admitted); two roundings cost at
    most ``u (|L_sk| + 2 |f L_ik|)`` to first order. The entry in column j is set to 0, which is off by ``u |L_sj|``.
    """
    N, g = L.shape
    pivot = L[i, j]
    for s in range(N):
        if s == i or L[s, j] == 0.0:
            continue
        factor = L[s, j] / pivot
        product = factor * middle[i]
        lost = abs(middle[s]) + 2.0 * abs(product)
        middle[s] -= product
        for k in range(g):
            product = factor * L[i, k]
            lost += abs(L[s, k]) + 2.0 * abs(product)
            L[s, k] -= product
        L[s, j] = 0.0
        slack[s] = up(up(slack[s] + up(abs(factor) * slack[i])) + up(lost * gamma(1) + UNDERFLOW))


@inner
def _without(L: Array, i: int, j: int) -> Array:
    """L without row i and column j; −1 keeps all columns."""
    N, g = L.shape
    left = np.empty((N - 1, g - 1 if j >= 0 else g))
    a = 0
    for s in range(N):
        if s == i:
            continue
        z = 0
        for k in range(g):
            if k != j:
                left[a, z] = L[s, k]
                z += 1
        a += 1
    return left


@inner
def _shorter(v: Array, i: int) -> Array:
    left = np.empty(v.size - 1)
    a = 0
    for s in range(v.size):
        if s != i:
            left[a] = v[s]
            a += 1
    return left
