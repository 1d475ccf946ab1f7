"""The zonotopic Kalman filter on plain arrays (Combastel 2015)."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma, up
from lsu_mesh.kernels.zonotopes.generator_reduction import approximate_inverse


@kernel
def kalman_gain(H: Array, C: Array, r: Array) -> Array:
    """``K = P C' (C P C' + R)⁻¹`` (n, m) with ``P = H H'``, ``R = diag(r²)``; zeros where the inverse does not exist.

    It minimises the sum of squares of all generators after the update. Any K gives a true set, so K is not bounded.
    """
    n, g = H.shape
    m = C.shape[0]
    W = np.zeros((m, g))
    for i in range(m):
        for s in range(n):
            if C[i, s] != 0.0:
                for j in range(g):
                    W[i, j] += C[i, s] * H[s, j]
    S = np.empty((m, m))
    for i in range(m):
        for k in range(m):
            total = r[i] * r[i] if i == k else 0.0
            for j in range(g):
                total += W[i, j] * W[k, j]
            S[i, k] = total
    inverse = approximate_inverse(S)
    K = np.zeros((n, m))
    for s in range(n):
        for i in range(m):
            total = 0.0
            for k in range(m):
                cross = 0.0
                for j in range(g):
                    cross += H[s, j] * W[k, j]
                total += cross * inverse[k, i]
            if not np.isfinite(total):
                return np.zeros((n, m))
            K[s, i] = total
    return K


@kernel
def corrected(c: Array, H: Array, C: Array, y: Array, r: Array, K: Array) -> tuple[Array, Array, Array]:
    """``c + K (y − C c)`` (n,), ``[(I − K C) H, K diag(r)]`` (n, g + m), and the slack (n,) of their rounding.

    For every x of the set with ``y = C x + v``, ``|v| ≤ r``, and any K: ``x = x + K (y − C x − v)``. The innovation and
    ``C H`` are rounded first, by ``γ_{n+1}`` of their terms, then multiplied by K and added, by ``γ_{m+1}``; together
    at most ``γ_{n+m+3}`` of ``|c| + |K| (|y| + |C| |c|)``, and likewise for the generators.
    """
    n, g = H.shape
    m = C.shape[0]
    centre = np.empty(n)
    generators = np.zeros((n, g + m))
    slack = np.empty(n)
    moved = np.zeros((m, g + 1))
    mass = np.zeros(m)
    for i in range(m):
        moved[i, g] = y[i]
        mass[i] = abs(y[i])
        for s in range(n):
            moved[i, g] -= C[i, s] * c[s]
            mass[i] += abs(C[i, s] * c[s])
            for j in range(g):
                moved[i, j] -= C[i, s] * H[s, j]
                mass[i] += abs(C[i, s] * H[s, j])
    for s in range(n):
        centre[s] = c[s]
        lost = abs(c[s])
        for j in range(g):
            generators[s, j] = H[s, j]
            lost += abs(H[s, j])
        for i in range(m):
            centre[s] += K[s, i] * moved[i, g]
            for j in range(g):
                generators[s, j] += K[s, i] * moved[i, j]
            generators[s, g + i] = K[s, i] * r[i]
            lost += abs(K[s, i]) * (mass[i] + r[i])
        slack[s] = 0.0 if m == 0 else up(gamma(n + m + 5) * lost + UNDERFLOW)
    return centre, generators, slack


@kernel
def box_shortest(H: Array, order: int) -> Array:
    """At most ``order ≥ n`` columns: the longest ones, and n axes that hold the box of all others (Combastel 2015)."""
    n, g = H.shape
    if g <= order:
        return H
    length = np.zeros(g)
    for j in range(g):
        for i in range(n):
            length[j] += H[i, j] * H[i, j]
    whole = order - n
    columns = np.zeros((n, order))
    boxed = np.ones(g, dtype=np.bool_)
    for z in range(whole):
        best = -1
        for j in range(g):
            if boxed[j] and (best < 0 or length[j] > length[best]):
                best = j
        boxed[best] = False
        for i in range(n):
            columns[i, z] = H[i, best]
    for i in range(n):
        total = 0.0
        for j in range(g):
            if boxed[j]:
                total += abs(H[i, j])
        columns[i, whole + i] = 0.0 if total == 0.0 else up(total * (1.0 + gamma(g)))
    return columns
