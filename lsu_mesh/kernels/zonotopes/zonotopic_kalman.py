"""The zonotopic Kalman filter on plain arrays (Combastel 2015)."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.runtime.rounding import EPSILON, UNDERFLOW, gamma, up
from lsu_mesh.kernels.zonotopes.zonotope import padded


@kernel
def kalman_gain(H: Array, C: Array, r: Array) -> Array:
    """``K = P C' (C P C' + R)⁻¹`` (n, m) with ``P = H H'``, ``R = diag(r²)``, one row of C after the other.

    It minimises the sum of squares of all generators after the update, in any units of the states. Any K gives a true
    set, so K is not bounded. A row whose output the set and the rows before it tell already, up to rounding, as a
    second equal sensor with r = 0 does, has a column of zeros.
    """
    n, g = H.shape
    m = C.shape[0]
    F = padded(H, n, g + m)
    K = np.zeros((n, m))
    seen = np.empty(g + m)
    gain = np.empty(n)
    floor = ((n + m + 4) * EPSILON) ** 2
    for i in range(m):
        size = r[i]
        for s in range(n):
            for j in range(g):
                size += abs(C[i, s] * H[s, j])
        if size == 0.0:
            continue
        spread = (r[i] / size) ** 2
        for j in range(g + i):
            seen[j] = 0.0
            for s in range(n):
                seen[j] += C[i, s] * F[s, j]
            seen[j] /= size
            spread += seen[j] * seen[j]
        if not spread > floor:
            continue
        finite = True
        for s in range(n):
            total = 0.0
            for j in range(g + i):
                total += F[s, j] * seen[j]
            gain[s] = total / spread / size
            finite = finite and np.isfinite(gain[s])
        if finite:
            _take_row(F, K, C[i], gain, seen, size, r[i], g, i)
    return K


@inner
def _take_row(
    F: Array, K: Array, row: Array, gain: Array, seen: Array, size: float, r: float, g: int, i: int
) -> None:  # fmt: skip
    """``F ← [(I − k row) F, k r]``, ``K ← K + k (e_i − row K)`` with k the gain of row i."""
    n = F.shape[0]
    for k in range(i):
        passed = 0.0
        for s in range(n):
            passed += row[s] * K[s, k]
        for s in range(n):
            K[s, k] -= gain[s] * passed
    for s in range(n):
        K[s, i] = gain[s]
        for j in range(g + i):
            F[s, j] -= gain[s] * (seen[j] * size)
        F[s, g + i] = gain[s] * r


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
def box_shortest(H: Array, order: int, scaled: bool) -> Array:
    """At most ``order ≥ n`` columns: the longest ones, and n axes that hold the box of all others (Combastel 2015).

    ``scaled``: lengths are measured in units of the set's half-widths, so that they do not depend on the units of the
    states.
    """
    n, g = H.shape
    if g <= order:
        return H
    width = np.zeros(n)
    for i in range(n):
        for j in range(g):
            width[i] += abs(H[i, j])
        if not scaled and width[i] > 0.0:
            width[i] = 1.0
    length = np.zeros(g)
    for j in range(g):
        for i in range(n):
            if width[i] > 0.0:
                length[j] += (H[i, j] / width[i]) ** 2
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
