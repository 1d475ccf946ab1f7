"""A simplex method for small programs ``max d'ξ`` over ``{ξ : A ξ = b, |ξ|∞ ≤ 1}`` that share one feasible set.

It keeps the full tableau ``T = B⁻¹ [A | I]``: the dimensions are small, a pivot is one rank-one update of contiguous
rows, and the right part is the inverse of the basis, from which multipliers are read. It starts from a canonical basis
(Gauss–Jordan with full pivoting), finds a feasible vertex once, and goes on from the last vertex for every further
objective. Nothing found here is believed: bounds come from :func:`~lsu_mesh.kernels.dual.dual_bound`.

Rows: basic variable ``basis[i]`` has the value ``level[i]``; −1 marks a row that depends on the others. A nonbasic
variable sits at the bound ``at[j] = ±1``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.compile import inlined, inner
from lsu_mesh.kernels.scaling import unit_factor

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FEASIBLE = 1e-12
"""How far a basic variable may be beyond ±1; also the tolerance of Harris' ratio test."""
OPTIMAL = 1e-13
"""Reduced costs below this share of the largest entry of the objective count as zero."""
PIVOT = 1e-9
"""Entries of the entering column below this cannot become a pivot."""
DEPENDENT = 1e-12
"""A row whose entries are all below this after elimination depends on the others (rows are scaled to 1)."""


@inner
def scaled_rows(A: Array, b: Array) -> tuple[Array, Array]:
    """A and b with each row multiplied by the power of two that brings its largest entry into [½, 1); exact."""
    m, g = A.shape
    rows = np.empty((m, g))
    sides = np.empty(m)
    for i in range(m):
        largest = 0.0
        for j in range(g):
            largest = max(largest, abs(A[i, j]))
        factor = unit_factor(largest)
        for j in range(g):
            rows[i, j] = A[i, j] * factor
        sides[i] = b[i] * factor
    return rows, sides


@inner
def canonical_tableau(A: Array) -> tuple[Array, Indices]:
    """``T = B⁻¹ [A | I]`` (m, g + m) and the basis (m,) by Gauss–Jordan elimination with full pivoting."""
    m, g = A.shape
    T = np.zeros((m, g + m))
    basis = np.empty(m, dtype=np.int64)
    for i in range(m):
        basis[i] = -1
        for j in range(g):
            T[i, j] = A[i, j]
        T[i, g + i] = 1.0
    for _ in range(m):
        best, p, q = DEPENDENT, -1, -1
        for i in range(m):
            if basis[i] < 0:
                row = T[i]
                for j in range(g):
                    if abs(row[j]) > best:
                        best, p, q = abs(row[j]), i, j
        if p < 0:
            break
        basis[p] = q
        pivot_rows(T, p, q)
    return T, basis


@inner
def pivot_rows(T: Array, p: int, q: int) -> None:
    """Make column q the unit vector of row p."""
    m, width = T.shape
    row = T[p]
    inverse = 1.0 / row[q]
    for j in range(width):
        row[j] *= inverse
    row[q] = 1.0
    for i in range(m):
        if i == p:
            continue
        other = T[i]
        factor = other[q]
        if factor != 0.0:
            for j in range(width):
                other[j] -= factor * row[j]
            other[q] = 0.0


@inner
def starting_bounds(T: Array, b: Array, basis: Indices, at: Array, level: Array) -> None:
    """Put each nonbasic variable at the bound that brings the basic ones nearer to 0."""
    m = T.shape[0]
    g = at.size
    for i in range(m):
        level[i] = 0.0
        for k in range(m):
            level[i] += T[i, g + k] * b[k]
    is_basic = np.zeros(g, dtype=np.bool_)
    for i in range(m):
        if basis[i] >= 0:
            is_basic[basis[i]] = True
    for j in range(g):
        at[j] = 0.0
        if is_basic[j]:
            continue
        slope = 0.0
        for i in range(m):
            if basis[i] >= 0:
                slope += T[i, j] * level[i]
        at[j] = 1.0 if slope > 0.0 else -1.0
        for i in range(m):
            level[i] -= T[i, j] * at[j]


@inner
def basic_levels(T: Array, b: Array, basis: Indices, at: Array, level: Array) -> None:
    """Values of the basic variables, ``B⁻¹ b − Σ T_j at_j``, free of what the updates have lost."""
    m = T.shape[0]
    g = at.size
    for i in range(m):
        if basis[i] >= 0:
            at[basis[i]] = 0.0
    for i in range(m):
        row = T[i]
        total = 0.0
        for k in range(m):
            total += row[g + k] * b[k]
        for j in range(g):
            total -= row[j] * at[j]
        level[i] = total


@inner
def blocking_row(
    T: Array, q: int, sign: float, basis: Indices, level: Array, phase_one: bool, bland: bool
) -> tuple[int, float]:
    """Row that stops variable q on its way from one bound to the other, and the step; −1 and 2 when none does.

    Harris' ratio test: the largest pivot among the rows that block within the tolerance. In phase one a variable
    beyond a bound blocks where it comes back to it. Bland's rule takes the smallest index among the least steps.
    """
    m = T.shape[0]
    longest = 2.0
    for i in range(m):
        step, pivot = _step_to_bound(T[i, q] * sign, level[i], phase_one)
        if basis[i] >= 0 and pivot > 0.0:
            longest = min(longest, step + (0.0 if bland else FEASIBLE / pivot))
    row, step_taken, best = -1, 2.0, 0.0
    for i in range(m):
        step, pivot = _step_to_bound(T[i, q] * sign, level[i], phase_one)
        if basis[i] < 0 or pivot == 0.0 or step > longest:
            continue
        if (bland and (row < 0 or basis[i] < basis[row])) or (not bland and pivot > best):
            row, step_taken, best = i, step, pivot
    return row, min(2.0, max(0.0, step_taken))


@inlined
def _step_to_bound(slope: float, level: float, phase_one: bool) -> tuple[float, float]:
    """How far the entering variable may go until a basic one, falling with ``slope``, stops it; pivot 0: never."""
    if abs(slope) <= PIVOT:
        return 2.0, 0.0
    value = level if slope > 0.0 else -level
    pivot = abs(slope)
    if phase_one and value > 1.0 + FEASIBLE:
        return (value - 1.0) / pivot, pivot
    if phase_one and value < -1.0 - FEASIBLE:
        return 2.0, 0.0
    return (value + 1.0) / pivot, pivot


@inner
def exchange(T: Array, basis: Indices, at: Array, level: Array, q: int, sign: float, row: int, step: float) -> None:
    """Move variable q by ``sign · step``; it becomes basic in ``row``, or has changed its bound when ``row`` is −1."""
    m = T.shape[0]
    moved = sign * step
    for i in range(m):
        level[i] -= T[i, q] * moved
    if row < 0:
        at[q] = sign
        return
    leaving = basis[row]
    at[leaving] = 1.0 if level[row] > 0.0 else -1.0
    level[row] = at[q] + moved
    basis[row] = q
    at[q] = 0.0
    pivot_rows(T, row, q)


@inner
def entering_variable(reduced: Array, at: Array, tolerance: float, bland: bool) -> int:
    """A nonbasic variable that improves the objective: steepest, or by Bland's rule the first; −1 at an optimum."""
    best, q = tolerance, -1
    for j in range(at.size):
        gain = -reduced[j] * at[j]  # basic variables have at = 0
        if gain > best:
            q = j
            if bland:
                break
            best = gain
    return q


@inner
def find_vertex(T: Array, basis: Indices, at: Array, level: Array, sigma: Array) -> bool:
    """Phase one: minimise the sum of what the basic variables are beyond ±1. ``False`` at the iteration limit.

    ``sigma`` (m,) is left as the signs of those that stay beyond: zero when a feasible vertex is found, else
    ``y = −σ'B⁻¹`` is a Farkas ray.
    """
    m = T.shape[0]
    g = at.size
    reduced = np.empty(g)
    idle = 0
    for _ in range(200 + 20 * (m + g)):
        beyond = False
        for j in range(g):
            reduced[j] = 0.0
        for i in range(m):
            sigma[i] = 0.0
            if basis[i] >= 0 and abs(level[i]) > 1.0 + FEASIBLE:
                beyond = True
                sigma[i] = 1.0 if level[i] > 0.0 else -1.0
                row = T[i]
                for j in range(g):
                    reduced[j] += sigma[i] * row[j]
        if not beyond:
            return True
        bland = idle > m + g
        q = entering_variable(reduced, at, OPTIMAL, bland)
        if q < 0:
            return True
        sign = -at[q]
        row_out, step = blocking_row(T, q, sign, basis, level, True, bland)
        idle = idle + 1 if step <= FEASIBLE else 0
        exchange(T, basis, at, level, q, sign, row_out, step)
    return False


@inner
def climb(T: Array, basis: Indices, at: Array, level: Array, d: Array, reduced: Array, y: Array) -> bool:
    """Phase two: from a feasible vertex to one that maximises d; multipliers to y (m,). ``False`` at the limit.

    ``reduced`` (g + m,) is room for the reduced costs.
    """
    m = T.shape[0]
    g = at.size
    largest = 0.0
    for j in range(g):
        largest = max(largest, abs(d[j]))
        reduced[j] = d[j]
    for i in range(m):
        reduced[g + i] = 0.0
    for i in range(m):
        if basis[i] >= 0:
            cost = d[basis[i]]
            if cost != 0.0:
                row = T[i]
                for j in range(g + m):
                    reduced[j] -= cost * row[j]
    idle = 0
    optimal = False
    for _ in range(200 + 20 * (m + g)):
        bland = idle > m + g
        q = entering_variable(reduced, at, OPTIMAL * largest, bland)
        if q < 0:
            optimal = True
            break
        sign = -at[q]
        row_out, step = blocking_row(T, q, sign, basis, level, False, bland)
        idle = idle + 1 if step <= FEASIBLE else 0
        exchange(T, basis, at, level, q, sign, row_out, step)
        if row_out >= 0:
            factor = reduced[q]
            row = T[row_out]
            for j in range(g + m):
                reduced[j] -= factor * row[j]
            reduced[q] = 0.0
    for i in range(m):
        y[i] = -reduced[g + i]
    return optimal


@inner
def refine_multipliers(A: Array, T: Array, basis: Indices, d: Array, y: Array) -> None:
    """One step of iterative refinement: ``y += B⁻ᵀ (d_B − B'y)``, with A itself instead of the tableau."""
    m, g = A.shape
    residual = np.empty(m)
    for i in range(m):
        residual[i] = 0.0
        if basis[i] >= 0:
            left = d[basis[i]]
            for k in range(m):
                left -= A[k, basis[i]] * y[k]
            residual[i] = left
    for i in range(m):
        if residual[i] != 0.0:
            row = T[i]
            for k in range(m):
                y[k] += row[g + k] * residual[i]
