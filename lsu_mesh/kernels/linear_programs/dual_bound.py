"""Safe bounds of linear programs over ``{ξ : A ξ = b, |ξ|∞ ≤ 1}``: weak duality, rounded outward.

For *any* vector y, feasible ξ and objective d, ``d'ξ = y'b + (d − A'y)'ξ ≤ y'b + Σ_j |d_j − (A'y)_j|`` because
``A ξ = b`` and ``|ξ_j| ≤ 1``. A solver is needed only to find a good y, never to be believed. With d = 0 a bound below
zero is impossible for a feasible ξ: it proves that the set is empty (Farkas).

Source: Neumaier, Shcherbina, *Safe bounds in linear and mixed-integer linear programming*, 2004.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.runtime.rounding import gamma, up
from lsu_mesh.kernels.runtime.rows import subtract_from


@kernel
def absolute_row_sums(A: Array, reach: Array) -> Array:
    """``Σ_j |A_ij| reach_j`` of each row, (m,), rounded up: what :func:`dual_bound` needs to know its own rounding."""
    m, g = A.shape
    sums = np.empty(m)
    for i in range(m):
        total = 0.0
        for j in range(g):
            total += abs(A[i, j]) * reach[j]
        sums[i] = up(total * (1.0 + gamma(g)))
    return sums


@kernel
def dual_bound(d: Array, A: Array, b: Array, row_sums: Array, y: Array) -> float:
    """:func:`dual_bound_in` for ``|x| ≤ 1``, with room of its own."""
    return dual_bound_in(d, A, b, np.ones(d.size), row_sums, y, np.empty(d.size))


@inner
def dual_bound_in(d: Array, A: Array, b: Array, reach: Array, row_sums: Array, y: Array, reduced: Array) -> float:
    """Upper bound of ``max {d'x : A x = b, |x| ≤ reach}`` from the multipliers y (m,), rounded up.

    d (g,), A (m, g), b (m,); ``row_sums`` from :func:`absolute_row_sums`; ``reduced`` (≥ g,) is room.
    A y that is not finite counts as 0.

    Rounding. Each ``t_j = d_j − Σ_i A_ij y_i`` is off by at most ``γ_{m+1} (|d_j| + Σ_i |A_ij y_i|)``; summed over j
    that is ``γ_{m+1} (Σ|d_j| + Σ_i |y_i| row_sums_i)``. ``Σ b_i y_i`` is off by ``γ_m Σ|b_i y_i|`` and the final sum of
    g + 1 terms by ``γ_{g+1}`` times the sum of their moduli. The three are added with a few operations to spare.
    """
    m, g = A.shape
    finite = True
    for i in range(m):
        finite = finite and np.isfinite(y[i])
    mass = 0.0
    for j in range(g):
        reduced[j] = d[j]
        mass += abs(d[j]) * reach[j]
    level = 0.0
    for i in range(m):
        factor = y[i] if finite else 0.0
        if factor != 0.0:
            subtract_from(reduced, A, i, factor)
            level += b[i] * factor
            mass += abs(factor) * (row_sums[i] + abs(b[i]))
    spread = 0.0
    for j in range(g):
        spread += abs(reduced[j]) * reach[j]
    bound = level + spread
    lost = gamma(m + 4) * mass + gamma(g + 4) * (abs(level) + spread)
    return up(bound + up(lost * (1.0 + gamma(g + m + 8))))
