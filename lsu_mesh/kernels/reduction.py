"""Outer approximation of a constrained zonotope by one with fewer constraints and generators.

Everything works on the *lifted* zonotope (P2023 (14)): rows 0 … n−1 are the state, rows n … n+m−1 the constraints,

    ``[x; 0] = [c; −b] + [G; A] ξ ⊕ box(slack)``.

Multiples of a constraint row may be added to any other row, since that row is zero for every point of the set; a column
may be replaced by columns that generate more. What floating point loses in doing so is added to ``slack`` (n + m,).
Source: Scott, Raimondo, Marseglia, Braatz 2016, §4; P2023 §3.1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.compile import kernel
from lsu_mesh.kernels.constrained import absorb_rows
from lsu_mesh.kernels.rounding import UNDERFLOW, gamma, up
from lsu_mesh.kernels.zonotope import absorb_box

Array = NDArray[np.float64]


@kernel
def lift(c: Array, G: Array, A: Array, b: Array) -> tuple[Array, Array]:
    """``[G; A]`` (n + m, g) and ``[c; −b]`` (n + m,)."""
    n, g = G.shape
    m = A.shape[0]
    L = np.empty((n + m, g))
    L[:n] = G
    L[n:] = A
    middle = np.empty(n + m)
    middle[:n] = c
    for i in range(m):
        middle[n + i] = -b[i]
    return L, middle


@kernel
def scale_rows(n: int, L: Array, middle: Array, slack: Array) -> None:
    """Multiply each constraint row by a power of two so that its largest entry lies in [½, 1); exact."""
    for i in range(n, L.shape[0]):
        largest = 0.0
        for j in range(L.shape[1]):
            largest = max(largest, abs(L[i, j]))
        if largest < 2.0**-900 or largest > 2.0**900:
            continue
        factor = 1.0
        while largest * factor >= 1.0:
            factor *= 0.5
        while largest * factor < 0.5:
            factor *= 2.0
        if factor != 1.0:
            for j in range(L.shape[1]):
                L[i, j] *= factor
            middle[i] *= factor
            slack[i] *= factor


@kernel
def overrun(n: int, L: Array, middle: Array, i: int, j: int) -> float:
    """How far beyond 1 the value of ξ_j can go when only row i of the constraints holds it; inf without a pivot."""
    pivot = abs(L[i, j])
    if pivot == 0.0:
        return np.inf
    rest = 0.0
    for k in range(L.shape[1]):
        if k != j:
            rest += abs(L[i, k])
    return max(0.0, (abs(middle[i]) + rest) / pivot - 1.0)


@kernel
def eliminate(L: Array, middle: Array, slack: Array, i: int, j: int) -> None:
    """Clear column j in every row but the constraint i, by adding multiples of row i; slack takes the rounding."""
    rows, g = L.shape
    pivot = L[i, j]
    for s in range(rows):
        if s == i or L[s, j] == 0.0:
            continue
        factor = L[s, j] / pivot
        lost = 0.0
        for k in range(g):
            product = factor * L[i, k]
            lost += abs(L[s, k]) + 2.0 * abs(product)
            L[s, k] -= product
        L[s, j] = 0.0
        product = factor * middle[i]
        lost += abs(middle[s]) + 2.0 * abs(product)
        middle[s] -= product
        slack[s] = up(up(slack[s] + up(abs(factor) * slack[i])) + up(lost * gamma(2) + UNDERFLOW))


@kernel
def drop_constraint(n: int, L: Array, middle: Array, slack: Array) -> tuple[Array, Array, Array]:
    """Remove the constraint and generator whose elimination is estimated to enlarge the set least; g and m fall by one.

    Eliminating ξ_j with row i is exact but for the forgotten ``|ξ_j| ≤ 1``; the estimate of the harm is how far ξ_j can
    run beyond 1 times the length of what is left of its column in the state rows.
    """
    rows, g = L.shape
    best_i, best_j, best = -1, -1, np.inf
    for j in range(g):
        weight = 0.0
        for s in range(n):
            weight += L[s, j] * L[s, j]
        weight = np.sqrt(weight)
        for i in range(n, rows):
            if abs(L[i, j]) < 2.0**-10:
                continue
            harm = overrun(n, L, middle, i, j)
            harm = harm * weight + 1e-9 * harm
            if harm < best:
                best_i, best_j, best = i, j, harm
    if best_i < 0:  # rows of zeros: forgetting a constraint is always an outer approximation
        return _without(L, rows - 1, -1), _shorter(middle, rows - 1), _shorter(slack, rows - 1)
    eliminate(L, middle, slack, best_i, best_j)
    return _without(L, best_i, best_j), _shorter(middle, best_i), _shorter(slack, best_i)


@kernel
def _without(L: Array, i: int, j: int) -> Array:
    """L without row i and column j; −1 keeps all."""
    rows, g = L.shape
    left = np.empty((rows - (i >= 0), g - (j >= 0)))
    a = 0
    for s in range(rows):
        if s == i:
            continue
        z = 0
        for k in range(g):
            if k != j:
                left[a, z] = L[s, k]
                z += 1
        a += 1
    return left


@kernel
def _shorter(v: Array, i: int) -> Array:
    left = np.empty(v.size - 1)
    a = 0
    for s in range(v.size):
        if s != i:
            left[a] = v[s]
            a += 1
    return left


@kernel
def reduce_generators(L: Array, slack: Array, limit: int) -> Array:
    """Columns (N, ≤ limit) that generate a zonotope which contains ``L ξ ⊕ box(slack)``; limit ≥ N.

    N columns D are chosen as a basis (greedy elimination); a further column ``v = D t`` is swallowed by lengthening
    ``D_i`` by ``|t_i|``, those with the least ``Π(1 + |t_i|) − 1 − Σ|t_i|`` first (Scott et al. 2016, §4.3). What ``v − D t``
    leaves goes to the slack, and the slack is swallowed last by :func:`swallow_box`, which proves that it may.
    Where it cannot, the smallest columns are boxed instead.
    """
    N, g = L.shape
    D, origin = _choose_basis(L)
    M = _inverse(D)
    taken = np.zeros(g, dtype=np.bool_)
    for k in range(N):
        if origin[k] >= 0:
            taken[origin[k]] = True
    free = np.flatnonzero(~taken)
    T = np.empty((free.size, N))
    for z in range(free.size):
        for i in range(N):
            total = 0.0
            for s in range(N):
                total += M[i, s] * L[s, free[z]]
            T[z, i] = total
    length = np.ones(N)
    loose = slack.copy()
    kept = np.ones(free.size, dtype=np.bool_)
    for _ in range(free.size + N - limit):
        z = _least_harm(T, length, kept)
        kept[z] = False
        _swallow(D, L, free[z], T[z], length, loose)
    columns = np.empty((N, N + np.sum(kept)))
    for k in range(N):
        for i in range(N):
            columns[i, k] = D[i, k] * length[k]
            M[k, i] /= length[k]
    if not (np.isfinite(columns[:, :N]).all() and swallow_box(columns, M, loose)):
        return box_smallest(L, slack, limit)
    place = N
    for z in range(free.size):
        if kept[z]:
            columns[:, place] = L[:, free[z]]
            place += 1
    return columns


@kernel
def _choose_basis(L: Array) -> tuple[Array, NDArray[np.int64]]:
    """N independent columns by elimination with full pivoting on scaled rows, and where each came from.

    Rows that the columns do not reach get a short unit vector, origin −1: a floor of 1e-13 of the row.
    """
    N, g = L.shape
    W = L.copy()
    scale = np.zeros(N)
    for i in range(N):
        for j in range(g):
            scale[i] += abs(L[i, j])
        if scale[i] > 0.0:
            for j in range(g):
                W[i, j] /= scale[i]
    D = np.zeros((N, N))
    origin = np.full(N, -1)
    open_rows = np.ones(N, dtype=np.bool_)
    for k in range(N):
        best, p, q = 1e-9, -1, -1
        for i in range(N):
            if open_rows[i]:
                for j in range(g):
                    if abs(W[i, j]) > best:
                        best, p, q = abs(W[i, j]), i, j
        if p < 0:
            break
        open_rows[p] = False
        origin[p] = q
        D[:, p] = L[:, q]
        for i in range(N):
            if open_rows[i] and W[i, q] != 0.0:
                factor = W[i, q] / W[p, q]
                for j in range(g):
                    W[i, j] -= factor * W[p, j]
                W[i, q] = 0.0
    for i in range(N):
        if origin[i] < 0:
            D[i, i] = max(1e-13 * scale[i], 2.0**-300)
    return D, origin


@kernel
def _inverse(D: Array) -> Array:
    """Approximate inverse by Gauss–Jordan elimination with row pivoting; not finite where D is singular."""
    N = D.shape[0]
    W = np.zeros((N, 2 * N))
    W[:, :N] = D
    for i in range(N):
        W[i, N + i] = 1.0
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
                for j in range(2 * N):
                    W[i, j] -= factor * W[k, j]
    return W[:, N:].copy()


@kernel
def _least_harm(T: Array, length: Array, kept: NDArray[np.bool_]) -> int:
    """The kept column whose swallowing adds least: ``Π(1 + s_i) − 1 − Σ s_i`` with ``s_i = |t_i| / length_i``."""
    best, chosen = np.inf, -1
    for z in range(T.shape[0]):
        if not kept[z]:
            continue
        product, total = 1.0, 0.0
        for i in range(T.shape[1]):
            share = abs(T[z, i]) / length[i]
            product *= 1.0 + share
            total += share
        harm = product - 1.0 - total
        if chosen < 0 or harm < best:
            best, chosen = harm, z
    return chosen


@kernel
def _swallow(D: Array, L: Array, j: int, t: Array, length: Array, slack: Array) -> None:
    """Lengthen the basis by |t| and add what ``L_j − D t`` leaves, rounded up, to the slack."""
    N = D.shape[0]
    for i in range(N):
        left = L[i, j]
        mass = abs(left)
        for k in range(N):
            product = D[i, k] * t[k]
            left -= product
            mass += abs(product)
        slack[i] = up(slack[i] + up(abs(left) + gamma(N + 2) * mass + UNDERFLOW))
    for k in range(N):
        length[k] = up(length[k] + abs(t[k]))


@kernel
def swallow_box(columns: Array, M: Array, slack: Array) -> bool:
    """Lengthen the first N columns C in place so that they generate ``C ξ ⊕ box(slack)``; ``False`` where that is not proved.

    M ≈ C⁻¹, (N, N). With ``s ≥ slack + |I − C M| s`` the series for the inverse gives ``|C⁻¹| slack ≤ |M| s =: τ``.
    The lengthened columns are rounded, ``C' = C diag(1 + τ) + Δ`` with ``|Δ| ≤ u |C'|``; ``C' box(1)`` holds ``C box(1 + q)`` as
    soon as ``q + |C⁻¹||Δ| 1 ≤ τ``. So the row sums of ``4 u |C|`` enter the slack beforehand (one part for C itself having been
    rounded, one for Δ, both doubled) and τ ≤ ½ is checked.
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
    trial = given.copy()
    for _ in range(4):
        trial = _plus_image(given, residual, trial, 1.25)
    image = _plus_image(given, residual, trial, 1.0)
    for i in range(N):
        if not image[i] <= trial[i]:
            return False
    longer = np.empty(N)
    for k in range(N):
        total = 0.0
        for i in range(N):
            total += abs(M[k, i]) * trial[i]
        longer[k] = up(1.0 + up(total * (1.0 + gamma(N + 2)) + UNDERFLOW))
        if not longer[k] <= 1.5:
            return False
    for i in range(N):
        for k in range(N):
            columns[i, k] *= longer[k]
    return True


@kernel
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


@kernel
def box_smallest(L: Array, slack: Array, limit: int) -> Array:
    """Columns (N, limit): N axes that hold box(slack) and the smallest columns of L, beside the largest ones.

    Source: Combastel 2015; size is the 1-norm less the ∞-norm on scaled rows (Girard 2005).
    """
    N, g = L.shape
    scale = np.zeros(N)
    for i in range(N):
        for j in range(g):
            scale[i] += abs(L[i, j])
    size = np.zeros(g)
    for j in range(g):
        largest = 0.0
        for i in range(N):
            if scale[i] > 0.0:
                share = abs(L[i, j]) / scale[i]
                size[j] += share
                largest = max(largest, share)
        size[j] -= largest
    order = np.argsort(-size, kind="mergesort")
    whole = max(0, min(g, limit - N))
    columns = np.zeros((N, whole + N))
    for z in range(whole):
        columns[:, z] = L[:, order[z]]
    for i in range(N):
        total = 0.0
        for z in range(whole, g):
            total += abs(L[i, order[z]])
        columns[i, whole + i] = up(up(total * (1.0 + gamma(g))) + slack[i])
    return columns


@kernel
def reduce_complexity(
    c: Array, G: Array, A: Array, b: Array, max_generators: int, max_constraints: int
) -> tuple[Array, Array, Array, Array]:
    """A set with at most so many generators and constraints that contains ``(c, G, A, b)``; −1 is no limit.

    ``max_generators ≥ n``; constraints are given up where n + m would exceed it.
    """
    n, g = G.shape
    m = A.shape[0]
    wanted = m if max_constraints < 0 else min(m, max_constraints)
    if wanted == m and (max_generators < 0 or g <= max_generators):
        return c, G, A, b
    if max_generators >= 0:
        wanted = min(wanted, max_generators - n)
    L, middle = lift(c, G, A, b)
    slack = np.zeros(n + m)
    scale_rows(n, L, middle, slack)
    while L.shape[0] - n > wanted:
        L, middle, slack = drop_constraint(n, L, middle, slack)
    if max_generators >= 0 and L.shape[1] > max_generators:
        L = reduce_generators(L, slack, max_generators)
        slack[:] = 0.0
    return unlift(n, L, middle, slack, max_generators)


@kernel
def unlift(n: int, L: Array, middle: Array, slack: Array, max_generators: int) -> tuple[Array, Array, Array, Array]:
    """``(c, G, A, b)`` of a lifted zonotope; slack goes into columns that can take it, or new ones, within the limit."""
    sides = -middle[n:]
    generators, rows = absorb_rows(L[:n].copy(), L[n:].copy(), slack[n:].copy())
    generators, rows = absorb_box(generators, rows, slack[:n].copy())
    if 0 <= max_generators < generators.shape[1]:
        L = reduce_generators(L, slack, max_generators)
        generators, rows = L[:n].copy(), L[n:].copy()
    return middle[:n].copy(), generators, rows, sides
