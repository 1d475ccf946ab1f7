"""``e^X`` and ``φ(X) = Σ Xᵏ/(k+1)!`` with proved radii, by scaling, Taylor's series and doubling.

With X = t A these give the whole of ``exp(t M)``, ``M = [[A, B, a], [0, 0, 0], [0, 0, 0]]``: its blocks are ``e^{tA}``,
``t φ(tA) B`` and ``t φ(tA) a``. The series ends at a power p; with ``Q = |X^{p+1}|/(p+2)!`` and ``Θ = |X|/(p+3)`` the
rest is at most ``Q (I + Θ + Θ² + …) ≤ Q (I + Θ + θ²/(1 − θ) 𝟙𝟙')``, ``θ = ‖Θ‖∞ ≤ ½``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix
from lsu_mesh.kernels.discretisation.interval_matrices import (
    add,
    add_identity,
    assign,
    outward,
    product,
    row_norm,
    scale,
)
from lsu_mesh.kernels.runtime.compile import inner

MAX_NORM = 0.5
"""``‖X‖∞`` after scaling."""
MAX_POWER = 24
MAX_DOUBLINGS = 60
NEGLIGIBLE = 2.0**-57
TIME_UNITS = 4.0
"""A time in seconds, divided once more, is known to this many units of 2⁻⁵³."""


@inner
def exponential(
    A: Matrix, t: float, E: Matrix, E_radius: Matrix, F: Matrix, F_radius: Matrix, work: NDArray[np.float64]
) -> bool:
    """Fills ``E ± E_radius ⊇ e^{tA}`` and ``F ± F_radius ⊇ φ(tA)``; A, E, F (n, n), work (6, n, n).

    The exact time is t to within ``TIME_UNITS`` · 2⁻⁵³ of it. ``False`` where ``‖A‖ t`` or the result is too large.
    """
    n = A.shape[0]
    X, X_radius, T, T_radius, S, S_radius = work[0], work[1], work[2], work[3], work[4], work[5]
    norm = row_norm(A) * t
    doublings = 0
    while norm > MAX_NORM and doublings <= MAX_DOUBLINGS:
        norm *= 0.5
        doublings += 1
    if not norm <= MAX_NORM:
        return False
    for i in range(n):
        for j in range(n):
            X[i, j], X_radius[i, j] = A[i, j], 0.0
            T[i, j], T_radius[i, j] = (1.0 if i == j else 0.0), 0.0
            F[i, j], F_radius[i, j] = T[i, j], 0.0
    scale(X, X_radius, t * 0.5**doublings, TIME_UNITS)
    power = 0
    while power < MAX_POWER and (power == 0 or not _is_negligible(T, F)):
        power += 1
        product(T, T_radius, X, X_radius, S, S_radius)
        assign(T, T_radius, S, S_radius)
        scale(T, T_radius, 1.0 / (power + 1.0), 1.0)
        add(F, F_radius, T, T_radius)
    _add_rest(T, T_radius, X, X_radius, power, F_radius)
    product(X, X_radius, F, F_radius, E, E_radius)
    add_identity(E, E_radius)
    for _ in range(doublings):  # φ(2X) = φ(X)(I + e^X)/2, e^{2X} = e^X e^X
        assign(T, T_radius, E, E_radius)
        add_identity(T, T_radius)
        product(F, F_radius, T, T_radius, S, S_radius)
        assign(F, F_radius, S, S_radius)
        scale(F, F_radius, 0.5, 0.0)
        product(E, E_radius, E, E_radius, S, S_radius)
        assign(E, E_radius, S, S_radius)
    return math.isfinite(row_norm(E) + row_norm(E_radius) + row_norm(F) + row_norm(F_radius))


@inner
def _is_negligible(T: Matrix, F: Matrix) -> bool:
    """Whether the term T of the series adds nothing to any digit of the sum F."""
    for i in range(T.shape[0]):
        for j in range(T.shape[1]):
            if abs(T[i, j]) > NEGLIGIBLE * abs(F[i, j]):
                return False
    return True


@inner
def _add_rest(T: Matrix, T_radius: Matrix, X: Matrix, X_radius: Matrix, power: int, F_radius: Matrix) -> None:
    """Add what the series leaves out after the term T of this power to the radius of the sum."""
    n = T.shape[0]
    theta = outward((row_norm(X) + row_norm(X_radius)) / (power + 3.0), 1)
    tail = outward(theta * theta / (1.0 - theta), 1)
    Q = np.zeros(n)
    for i in range(n):
        total = 0.0
        for j in range(n):
            Q[j] = 0.0
            for s in range(n):
                Q[j] += (abs(T[i, s]) + T_radius[i, s]) * (abs(X[s, j]) + X_radius[s, j])
            Q[j] = outward(Q[j] / (power + 2.0), n) if Q[j] > 0.0 else 0.0
            total += Q[j]
        if total == 0.0:
            continue
        for j in range(n):
            more = Q[j] + total * tail
            for s in range(n):
                more += Q[s] * (abs(X[s, j]) + X_radius[s, j]) / (power + 3.0)
            F_radius[i, j] = outward(F_radius[i, j] + more, 2 * n + 4)
