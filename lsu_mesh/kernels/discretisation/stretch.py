"""One stretch of a continuous model ``ẋ = A x + B u + N w``, ``|w| ≤ rho``, as a discrete step."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.discretisation.interval_matrices import assign, outward, product, row_norm, scale
from lsu_mesh.kernels.discretisation.matrix_exponential import TIME_UNITS, exponential
from lsu_mesh.kernels.discretisation.noise import slices
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.runtime.rounding import gamma

MAX_SLICES = 8
MAX_HALVINGS = 40
NANOSECONDS = 1e9
USEFUL_NORM = 4.0
"""``‖A‖ h`` above which no number of slices up to ``MAX_SLICES`` is enough, so that none is tried."""


@kernel
def discretise(
    A: Matrix, B: Matrix, N: Matrix, rho: Vector, h_ns: float
) -> tuple[bool, Matrix, Matrix, Matrix, Matrix, Matrix, Vector, Vector]:
    """``A_h ± radius``, ``B_h ± radius``, and the noise as ``G w``, ``|w| ≤ widths``: the last n columns are a box.

    A (n, n), B (n, p) with every constant input as a column, N (n, q), rho (q,); h_ns: a whole number of nanoseconds.
    The first value is ``False`` where numbers overflow, the last one the share (n,) of the box in the noise's hull.
    """
    n, q, h = A.shape[0], N.shape[1], h_ns / NANOSECONDS
    work = np.empty((12, n, n))
    E, E_radius, F, F_radius = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, n))
    B_h, B_radius = np.empty(B.shape), np.empty(B.shape)
    finite = exponential(A, h, E, E_radius, F, F_radius, work)
    if finite:
        scale(F, F_radius, h, TIME_UNITS)
        product(F, F_radius, B, np.zeros(B.shape), B_h, B_radius)
    G, box = np.zeros((n, 0)), np.zeros(n)
    if finite and q > 0:
        G, box = _noise(A, N, rho, h, work)
    g = G.shape[1]
    columns, widths, share = np.zeros((n, g + n)), np.ones(g + n), np.zeros(n)
    for i in range(n):
        hull = box[i]
        for j in range(g):
            columns[i, j] = G[i, j]
            hull += abs(G[i, j])
        columns[i, g + i], widths[g + i] = 1.0, box[i]
        share[i] = 0.0 if hull == 0.0 else box[i] / hull
        finite = finite and math.isfinite(hull)
    finite = finite and math.isfinite(row_norm(B_h) + row_norm(B_radius))
    return finite, E, E_radius, B_h, B_radius, columns, widths, share


@inner
def _noise(A: Matrix, N: Matrix, rho: Vector, h: float, work: NDArray[np.float64]) -> tuple[Matrix, Vector]:
    """Generators and box of the noise over h: as few slices as are tight, else put together from halves."""
    n, q = N.shape
    E, E_radius, box = np.empty((n, n)), np.empty((n, n)), np.zeros(n)
    norm, halvings, m = row_norm(A) * h, 0, 1
    while norm <= USEFUL_NORM or m == 1:
        G = np.empty((n, q * (m + 1)))
        loose = slices(A, N, rho, h, G, box, E, E_radius, work)
        if loose <= 1.0:
            return G, box
        if m == MAX_SLICES:
            break
        m = max(m + 1, min(MAX_SLICES, int(0.9 * m * math.sqrt(min(loose, 100.0)))))
    G, loose = np.empty((n, q * (MAX_SLICES + 1))), math.inf
    while loose > 1.0 and halvings < MAX_HALVINGS:
        halvings += 1
        norm *= 0.5
        if norm <= USEFUL_NORM:
            loose = slices(A, N, rho, h * 0.5**halvings, G, box, E, E_radius, work)
    most = max(q * (MAX_SLICES + 1), 8 * n)
    for _ in range(halvings):
        G, box = _doubled(G, box, E, E_radius)
        G, box = _reduced(G, box, most)
        product(E, E_radius, E, E_radius, work[0], work[1])
        assign(E, E_radius, work[0], work[1])
    return G, box


@inner
def _doubled(G: Matrix, box: Vector, E: Matrix, E_radius: Matrix) -> tuple[Matrix, Vector]:
    """``W_{2a} = e^{Aa} W_a ⊕ W_a`` for ``W_a = G [−1, 1]^g ⊕ box`` and ``e^{Aa} ∈ E ± E_radius``."""
    n, g = G.shape
    longer, wider = np.empty((n, 2 * g)), np.empty(n)
    for i in range(n):
        mass, spread = 0.0, box[i]
        for s in range(n):
            spread += (abs(E[i, s]) + E_radius[i, s]) * box[s]
        for j in range(g):
            entry = 0.0
            for s in range(n):
                entry += E[i, s] * G[s, j]
                mass += abs(E[i, s] * G[s, j])
                spread += E_radius[i, s] * abs(G[s, j])
            longer[i, j], longer[i, g + j] = entry, G[i, j]
        lost = spread + gamma(n + 2) * mass
        wider[i] = 0.0 if lost == 0.0 else outward(lost, n * (g + 1))
    return longer, wider


@inner
def _reduced(G: Matrix, box: Vector, most: int) -> tuple[Matrix, Vector]:
    """At most so many generators; those that are nearest to an axis, or smallest, in units of the hull join the box."""
    n, g = G.shape
    if g <= most:
        return G, box
    hull, weight = box.copy(), np.zeros(g)
    for i in range(n):
        for j in range(g):
            hull[i] += abs(G[i, j])
    for j in range(g):
        largest = 0.0
        for i in range(n):
            share = 0.0 if hull[i] == 0.0 else abs(G[i, j]) / hull[i]
            weight[j] += share
            largest = max(largest, share)
        weight[j] -= largest
    kept, wider, place = np.empty((n, most)), box.copy(), 0
    for j in range(g):  # the rank of a generator; the earlier one of equals goes first
        rank = 0
        for k in range(g):
            if weight[k] < weight[j] or (weight[k] == weight[j] and k < j):
                rank += 1
        for i in range(n):
            if rank >= g - most:
                kept[i, place] = G[i, j]
            elif G[i, j] != 0.0:
                wider[i] = outward(wider[i] + abs(G[i, j]), 1)
        place += rank >= g - most
    return kept, wider
