"""The set of ``∫₀ʰ e^{As} N w(s) ds`` for every measurable ``|w| ≤ rho``: a zonotope and a box.

In a direction d its support is ``∫ |d' e^{As} N| rho ds``. With m slices of length ``δ = h/m``, ends ``s_0 … s_m`` and
weights ``c = δ/2`` at both ends, ``δ`` inside, the trapezoid rule gives the generators ``c_i e^{A s_i} N diag(rho)``,
and its error on each slice is at most ``δ³/12`` times the largest second derivative: the box
``(δ³/12) Σ_{i<m} |e^{A s_i}| |A²| e^{|A|δ} |N| rho``. (The size of a chord is convex: the trapezoid rule does not
fall short of its integral.)
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.discretisation.interval_matrices import assign, outward, product, row_norm
from lsu_mesh.kernels.discretisation.matrix_exponential import exponential
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.rounding import gamma

MAX_EXCESS = 0.0195
"""By so much of it the hull of the zonotope and its box may exceed what is surely reached, in each coordinate."""
MAX_BOX_SHARE = 0.01
NO_NOISE = 2.0**-40
"""A coordinate with less of the noise than this share of the largest one has none but rounding."""
MAX_GROWTH = 20.0
"""``‖A‖ δ`` above which a slice is too long for any use."""


@inner
def slices(
    A: Matrix, N: Matrix, rho: Vector, h: float,
    G: Matrix, box: Vector, E: Matrix, E_radius: Matrix, work: NDArray[np.float64],
) -> float:  # fmt: skip
    """Fills the generators G (n, q (m + 1)), whose width says m, the box (n,) and ``E ± E_radius ⊇ e^{Ah}``.

    A (n, n), N (n, q), rho (q,), work (12, n, n). Returns the looseness, see :func:`looseness`; infinite, and nothing
    is filled, where ``A δ`` is too large.
    """
    n, q = N.shape
    m = G.shape[1] // q - 1
    step, step_radius, now, now_radius = work[6], work[7], work[8], work[9]
    delta = h / m
    reached, most = np.zeros(n), np.zeros(n)
    if not _second_derivative(A, N, rho, delta, most):
        return math.inf
    if not exponential(A, delta, step, step_radius, work[10], work[11], work):
        return math.inf
    for i in range(n):
        for j in range(n):
            E[i, j], E_radius[i, j] = (1.0 if i == j else 0.0), 0.0
        box[i] = 0.0
    for k in range(m + 1):
        weight = delta if 0 < k < m else 0.5 * delta
        for i in range(n):
            mass, spread, bend = 0.0, 0.0, 0.0
            for s in range(n):
                bend += (abs(E[i, s]) + E_radius[i, s]) * most[s]
            for j in range(q):
                entry = 0.0
                for s in range(n):
                    entry += E[i, s] * (N[s, j] * rho[j])
                    mass += abs(E[i, s] * (N[s, j] * rho[j]))
                    spread += E_radius[i, s] * abs(N[s, j] * rho[j])
                G[i, k * q + j] = weight * entry
                if k > 0:
                    reached[i] += 0.5 * delta * _between(G[i, (k - 1) * q + j], G[i, k * q + j], k, m, delta)
            lost = weight * (spread + gamma(n + 12) * mass)
            if k < m:
                lost += delta * delta * delta / 12.0 * bend
            box[i] = box[i] if lost == 0.0 else outward(box[i] + lost, n + q)
        if k < m:
            product(step, step_radius, E, E_radius, now, now_radius)
            assign(E, E_radius, now, now_radius)
    return looseness(G, box, reached)


@inner
def _between(first: float, second: float, k: int, m: int, delta: float) -> float:
    """``(2/δ) ∫ |chord|`` over a slice, from the weighted entries at its ends."""
    a = first / (0.5 * delta if k == 1 else delta)
    b = second / (0.5 * delta if k == m else delta)
    total = abs(a) + abs(b)
    return total if a * b >= 0.0 else (a * a + b * b) / total


@inner
def looseness(G: Matrix, box: Vector, reached: Vector) -> float:
    """How loose ``G [−1, 1]^g ⊕ box`` is, at most 1 where the set is tight.

    Tight: in each coordinate the box is at most 1 % of the set, and the set's hull exceeds ``reached − box``, which is
    surely part of it, by less than 2 %.
    """
    n = box.size
    hull = np.zeros(n)
    largest, worst = 0.0, 0.0
    for i in range(n):
        for j in range(G.shape[1]):
            hull[i] += abs(G[i, j])
        largest = max(largest, hull[i])
    for i in range(n):
        if hull[i] + box[i] > NO_NOISE * largest:
            sure = reached[i] - box[i]
            if not (hull[i] > 0.0 and sure > 0.0):
                return math.inf
            worst = max(worst, box[i] / hull[i] / MAX_BOX_SHARE, ((hull[i] + box[i]) / sure - 1.0) / MAX_EXCESS)
    return worst


@inner
def _second_derivative(A: Matrix, N: Matrix, rho: Vector, delta: float, bend: Vector) -> bool:
    """Fills ``|A²| e^{|A|δ} |N| rho`` (n,), rounded up; ``False`` where the slice is too long for that."""
    n = A.shape[0]
    total, term = np.zeros(n), np.zeros(n)
    curved = False
    for i in range(n):
        bend[i] = 0.0
        for j in range(n):
            for s in range(n):
                curved = curved or A[i, s] * A[s, j] != 0.0
    if not curved:
        return True
    for i in range(n):
        for j in range(rho.size):
            term[i] += abs(N[i, j]) * rho[j]
        term[i] = outward(term[i], rho.size) if term[i] > 0.0 else 0.0
        total[i] = term[i]
    growth = outward(row_norm(A) * delta, 2)
    if not growth <= MAX_GROWTH:
        return False
    power, largest, whole = 0, 1.0, 1.0
    while largest > 0.0 and (power < 2.0 * growth or largest > 2.0**-57 * whole):
        power += 1
        largest, whole = 0.0, 0.0
        for i in range(n):
            bend[i] = 0.0
            for j in range(n):
                bend[i] += abs(A[i, j]) * term[j]
            bend[i] = outward(bend[i] * delta / power, n + 4) if bend[i] > 0.0 else 0.0
            largest = max(largest, bend[i])
        for i in range(n):
            term[i] = bend[i]
            total[i] = total[i] if term[i] == 0.0 else outward(total[i] + term[i], 2)
            whole = max(whole, total[i])
    rest = outward(2.0 * largest * growth / (power + 1.0), 2) if largest > 0.0 else 0.0
    for i in range(n):
        bend[i] = 0.0
        for j in range(n):
            square, mass = 0.0, 0.0
            for s in range(n):
                square += A[i, s] * A[s, j]
                mass += abs(A[i, s] * A[s, j])
            bend[i] += (abs(square) + gamma(n + 1) * mass) * (total[j] + rest)
        bend[i] = outward(bend[i], 2 * n) if bend[i] > 0.0 else 0.0
    return True
