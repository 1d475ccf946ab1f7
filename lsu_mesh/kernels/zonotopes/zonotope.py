"""Arithmetic of zonotopes ``{c + G ξ : |ξ|∞ ≤ 1}`` on plain arrays, rounded outward.

A map or a sum computed in floating point moves the centre and the generators by a little. Each kernel returns, beside
the result, ``slack`` (n,): a box whose Minkowski sum with the computed set contains the exact one. :func:`absorb_box`
then makes that box part of the set.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma, size_of_product, up


@kernel
def zonotope_map(R: Array, c: Array, G: Array, shift: Array) -> tuple[Array, Array, Array]:
    """``R c + shift`` (k,), ``R G`` (k, g) and their slack (k,).

    ``slack_i ≥ γ_{n+1} ((|R||c|)_i + |shift_i|) + Σ_j γ_n (|R||G|)_ij``; exact zeros and ones in a row that selects one
    coordinate cost nothing.
    """
    k, n = R.shape
    g = G.shape[1]
    centre = np.empty(k)
    generators = np.empty((k, g))
    slack = np.empty(k)
    for i in range(k):
        terms = 0
        plain = True
        for s in range(n):
            if R[i, s] != 0.0:
                terms += 1
                plain = plain and abs(R[i, s]) == 1.0
        total = shift[i]
        mass = abs(shift[i])
        for s in range(n):
            total += R[i, s] * c[s]
            mass += size_of_product(R[i, s], c[s])
        centre[i] = total
        selected = plain and terms <= 1
        lost = 0.0 if selected and (terms == 0 or shift[i] == 0.0) else mass
        row_mass = 0.0
        for j in range(g):
            entry = 0.0
            for s in range(n):
                entry += R[i, s] * G[s, j]
                row_mass += size_of_product(R[i, s], G[s, j])
            generators[i, j] = entry
        if not selected:
            lost += row_mass
        slack[i] = 0.0 if lost == 0.0 else up(gamma(n + g + 4) * lost + UNDERFLOW)
    return centre, generators, slack


@inlined
def subtraction_error(x: float, y: float) -> float:
    """``(x − y) − fl(x − y)``, exact (Knuth's TwoSum)."""
    difference = x - y
    part = difference - x
    return (x - (difference - part)) + (-y - part)


@kernel
def add_centers(c: Array, c2: Array) -> tuple[Array, Array]:
    """``c + c₂`` (n,) and its slack (n,), 0 where the sum is exact."""
    n = c.size
    total = np.empty(n)
    slack = np.zeros(n)
    for i in range(n):
        total[i] = c[i] + c2[i]
        lost = subtraction_error(c[i], -c2[i])
        if lost != 0.0:
            slack[i] = up(abs(lost))
    return total, slack


@kernel
def zonotope_radius(G: Array) -> Array:
    """Half-widths ``Σ_j |G_ij|`` (n,) of the interval hull, rounded up."""
    n, g = G.shape
    radius = np.empty(n)
    for i in range(n):
        total = 0.0
        for j in range(g):
            total += abs(G[i, j])
        radius[i] = 0.0 if total == 0.0 else up(total * (1.0 + gamma(g)))
    return radius


@kernel
def zonotope_support(c: Array, G: Array, d: Array) -> float:
    """``d'c + Σ_j |d'G_j|``, rounded up."""
    n, g = G.shape
    level = 0.0
    mass = 0.0
    for i in range(n):
        level += d[i] * c[i]
        mass += abs(d[i] * c[i])
    spread = 0.0
    for j in range(g):
        entry = 0.0
        for i in range(n):
            entry += d[i] * G[i, j]
            mass += abs(d[i] * G[i, j])
        spread += abs(entry)
    return up(level + spread + up(gamma(n + 4) * mass + gamma(g + 4) * (abs(level) + spread) + UNDERFLOW))


@inner
def padded(M: Array, rows: int, columns: int) -> Array:
    """M in the top left corner of a matrix of zeros (rows, columns)."""
    larger = np.zeros((rows, columns))
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            larger[i, j] = M[i, j]
    return larger


@kernel
def absorb_box(G: Array, A: Array, slack: Array) -> tuple[Array, Array]:
    """Generators (n, g′) and constraint columns (m, g′) of the set ``⊕ box(slack)``.

    A coordinate with slack is added to a generator that is parallel to its axis and takes part in no constraint: its
    value ranges over [−|G_ij|, |G_ij|] whatever the others are, so ``|G_ij| + slack_i``, rounded up, holds the sum.
    Where there is none a generator is appended.
    """
    n, g = G.shape
    m = A.shape[0]
    host = np.empty(n, dtype=np.int64)
    missing = 0
    for i in range(n):
        host[i] = -1
        if slack[i] <= 0.0:
            continue
        for j in range(g):
            if G[i, j] == 0.0:
                continue
            free = True
            for s in range(n):
                free = free and (s == i or G[s, j] == 0.0)
            for s in range(m):
                free = free and A[s, j] == 0.0
            if free:
                host[i] = j
                break
        if host[i] < 0:
            missing += 1
    generators = padded(G, n, g + missing)
    columns = padded(A, m, g + missing)
    place = g
    for i in range(n):
        if slack[i] <= 0.0:
            continue
        if host[i] >= 0:
            generators[i, host[i]] = up(abs(G[i, host[i]]) + slack[i])
        else:
            generators[i, place] = slack[i]
            place += 1
    return generators, columns


@kernel
def parallelotope_volumes(G: Array) -> float:
    """Volume of a zonotope, ``2ⁿ Σ |det G_S|`` over all n-subsets S of the g columns (Shephard 1974); not rounded."""
    n, g = G.shape
    if g < n:
        return 0.0
    chosen = np.arange(n)
    M = np.empty((n, n))
    total = 0.0
    while True:
        for i in range(n):
            for j in range(n):
                M[i, j] = G[i, chosen[j]]
        total += abs(_determinant(M))
        k = n - 1
        while k >= 0 and chosen[k] == g - n + k:
            k -= 1
        if k < 0:
            return float(total * 2.0**n)
        chosen[k] += 1
        for j in range(k + 1, n):
            chosen[j] = chosen[j - 1] + 1


@inner
def _determinant(M: Array) -> float:
    """Determinant by elimination with row pivoting; M is overwritten."""
    n = M.shape[0]
    value = 1.0
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(M[i, k]) > abs(M[p, k]):
                p = i
        if M[p, k] == 0.0:
            return 0.0
        if p != k:
            value = -value
            for j in range(n):
                M[p, j], M[k, j] = M[k, j], M[p, j]
        value *= M[k, k]
        for i in range(k + 1, n):
            factor = M[i, k] / M[k, k]
            for j in range(k + 1, n):
                M[i, j] -= factor * M[k, j]
    return value
