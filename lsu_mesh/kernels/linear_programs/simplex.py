"""A simplex method for small programs ``max d'x`` over ``{x : A x = b, |x| ≤ reach}`` that share one feasible set.

It keeps the full tableau ``T = B⁻¹ [A | I]``: the dimensions are small, a pivot is one rank-one update of contiguous
rows, and the right part is the inverse of the basis, from which multipliers are read. It starts from a canonical basis
(Gauss–Jordan with full pivoting), finds a feasible vertex once, and goes on from the last vertex for every further
objective. Nothing found here is believed: bounds come from
:func:`~lsu_mesh.kernels.linear_programs.dual_bound.dual_bound`.

Rows and columns are scaled to 1 (:func:`balanced`), so that a variable whose whole range moves no row by more than
rounding is not fought over: ``ξ_j = x_j / reach_j``. Basic variable ``basis[i]`` has the value ``level[i]``; −1 marks a
row that depends on the others. A nonbasic variable sits at the bound ``at[j] = ±reach[j]``, a basic one has
``at[j] = 0``.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array, Indices
from lsu_mesh.kernels.runtime.compile import inlined, inner
from lsu_mesh.kernels.runtime.rows import scale_row, subtract_from, subtract_row
from lsu_mesh.kernels.runtime.scaling import unit_factor

FEASIBLE = 1e-12
"""How far a basic variable may be beyond its reach, as a share of it; also the tolerance of Harris' ratio test."""
ROUNDING = 4e-15
"""What is added to that tolerance, as a share of the rows: levels are not known better."""
OPTIMAL = 1e-13
"""Reduced costs below this share of the largest entry of the objective count as zero."""
PIVOT = 1e-11
"""Entries of the entering column below this cannot become a pivot."""
MAX_SCALE = 2.0**200
"""Columns are lengthened no more than that, so that objectives stay finite."""
DEPENDENT = 1e-12
"""A row that the variables left can move no more than this depends on the others (rows are scaled to 1)."""


@inner
def balanced(A: Array, b: Array) -> tuple[Array, Array, Array]:
    """A (m, g), b (m,) with rows, then columns, brought into [½, 1) by powers of two, and the columns' reach (g,).

    ``A ξ = b, |ξ| ≤ 1`` is ``rows x = sides, |x| ≤ reach``, exactly; a column of zeros has reach 1.
    """
    m, g = A.shape
    rows = np.empty((m, g))
    sides = np.empty(m)
    reach = np.empty(g)
    for i in range(m):
        largest = 0.0
        for j in range(g):
            largest = max(largest, abs(A[i, j]))
        factor = unit_factor(largest)
        for j in range(g):
            rows[i, j] = A[i, j] * factor
        sides[i] = b[i] * factor
    for j in range(g):
        largest = 0.0
        for i in range(m):
            largest = max(largest, abs(rows[i, j]))
        factor = min(unit_factor(largest), MAX_SCALE)
        reach[j] = 1.0 / factor
        for i in range(m):
            rows[i, j] *= factor
    return rows, sides, reach


@inner
def canonical_tableau(A: Array, reach: Array) -> tuple[Array, Indices]:
    """``T = B⁻¹ [A | I]`` (m, g + m) and the basis (m,) by Gauss–Jordan elimination with full pivoting.

    Pivots are chosen by how much a variable can move its row: one that cannot leave its place is of no use in a basis.
    """
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
                for j in range(g):
                    if abs(T[i, j]) * reach[j] > best:
                        best, p, q = abs(T[i, j]) * reach[j], i, j
        if p < 0:
            break
        basis[p] = q
        pivot_rows(T, p, q)
    return T, basis


@inner
def refactor(A: Array, T: Array, basis: Indices) -> None:
    """Compute the tableau of this basis anew from A, the largest pivots first: what pivots have lost comes back."""
    m, g = A.shape
    columns = basis.copy()
    for i in range(m):
        basis[i] = -1
        for j in range(g):
            T[i, j] = A[i, j]
        for k in range(m):
            T[i, g + k] = 1.0 if i == k else 0.0
    for _ in range(m):
        best, p, z = DEPENDENT, -1, -1
        for i in range(m):
            if basis[i] < 0:
                for k in range(m):
                    if columns[k] >= 0 and abs(T[i, columns[k]]) > best:
                        best, p, z = abs(T[i, columns[k]]), i, k
        if p < 0:
            break
        basis[p] = columns[z]
        columns[z] = -1
        pivot_rows(T, p, basis[p])


@inner
def pivot_rows(T: Array, p: int, q: int) -> None:
    """Make column q the unit vector of row p."""
    scale_row(T, p, 1.0 / T[p, q])
    T[p, q] = 1.0
    for i in range(T.shape[0]):
        factor = T[i, q]
        if i != p and factor != 0.0:
            subtract_row(T, i, p, factor)
            T[i, q] = 0.0


@inner
def starting_bounds(T: Array, b: Array, basis: Indices, reach: Array, at: Array, level: Array) -> None:
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
        at[j] = reach[j] if slope > 0.0 else -reach[j]
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
        total = 0.0
        for k in range(m):
            total += T[i, g + k] * b[k]
        for j in range(g):
            total -= T[i, j] * at[j]
        level[i] = total


@inner
def blocking_row(
    T: Array, q: int, sign: float, basis: Indices, reach: Array, level: Array, phase_one: bool, bland: bool
) -> tuple[int, float]:
    """Row that stops variable q on its way from one bound to the other, and the step; −1 when none does.

    Harris' ratio test: the largest pivot among the rows that block within the tolerance. In phase one a variable
    beyond a bound blocks where it comes back to it. Bland's rule takes the smallest index among the least steps.
    """
    m = T.shape[0]
    whole = 2.0 * reach[q]
    longest = whole
    for i in range(m):
        if basis[i] >= 0:
            bound = reach[basis[i]]
            step, pivot = _step_to_bound(T[i, q] * sign, level[i], bound, phase_one)
            if pivot > 0.0:
                longest = min(longest, step + (0.0 if bland else tolerance(bound) / pivot))
    row, step_taken, best = -1, whole, 0.0
    for i in range(m):
        if basis[i] < 0:
            continue
        step, pivot = _step_to_bound(T[i, q] * sign, level[i], reach[basis[i]], phase_one)
        if pivot == 0.0 or step > longest:
            continue
        if (bland and (row < 0 or basis[i] < basis[row])) or (not bland and pivot > best):
            row, step_taken, best = i, step, pivot
    return row, min(whole, max(0.0, step_taken))


@inlined
def tolerance(bound: float) -> float:
    """How far beyond its bound a basic variable may be."""
    return FEASIBLE * bound + ROUNDING


@inlined
def _step_to_bound(slope: float, level: float, bound: float, phase_one: bool) -> tuple[float, float]:
    """How far the entering variable may go until a basic one, falling with ``slope``, stops it; pivot 0: never."""
    if abs(slope) <= PIVOT:
        return 0.0, 0.0
    value = level if slope > 0.0 else -level
    pivot = abs(slope)
    if phase_one and value > bound + tolerance(bound):
        return (value - bound) / pivot, pivot
    if phase_one and value < -bound - tolerance(bound):
        return 0.0, 0.0
    return (value + bound) / pivot, pivot


@inner
def exchange(
    T: Array, basis: Indices, reach: Array, at: Array, level: Array, q: int, sign: float, row: int, step: float
) -> None:
    """Move variable q by ``sign · step``; it becomes basic in ``row``, or changes its bound where ``row`` is −1."""
    m = T.shape[0]
    moved = sign * step
    for i in range(m):
        level[i] -= T[i, q] * moved
    if row < 0:
        at[q] = sign * reach[q]
        return
    leaving = basis[row]
    at[leaving] = reach[leaving] if level[row] > 0.0 else -reach[leaving]
    level[row] = at[q] + moved
    basis[row] = q
    at[q] = 0.0
    pivot_rows(T, row, q)


@inner
def entering_variable(reduced: Array, at: Array, least: float, bland: bool) -> int:
    """A nonbasic variable whose change of bound would gain most, or by Bland's rule the first that gains; −1: none."""
    best, q = least, -1
    for j in range(at.size):
        gain = -reduced[j] * at[j]  # basic variables have at = 0
        if gain > best:
            q = j
            if bland:
                break
            best = gain
    return q


@inner
def find_vertex(T: Array, basis: Indices, reach: Array, at: Array, level: Array, sigma: Array) -> bool:
    """Phase one: minimise the sum of what the basic variables are beyond reach. ``False`` at the iteration limit.

    ``sigma`` (m,) is left as the signs of those that stay beyond: zero when a feasible vertex is found, else
    ``y = −σ'B⁻¹`` is a Farkas ray.
    """
    m = T.shape[0]
    g = at.size
    reduced = np.empty(g + m)
    idle = 0
    for _ in range(200 + 20 * (m + g)):
        beyond = False
        for j in range(g + m):
            reduced[j] = 0.0
        for i in range(m):
            sigma[i] = 0.0
            if basis[i] >= 0 and abs(level[i]) > reach[basis[i]] + tolerance(reach[basis[i]]):
                beyond = True
                sigma[i] = 1.0 if level[i] > 0.0 else -1.0
                subtract_from(reduced, T, i, -sigma[i])
        if not beyond:
            return True
        bland = idle > m + g
        q = entering_variable(reduced, at, ROUNDING, bland)
        if q < 0:
            return True
        sign = -1.0 if at[q] > 0.0 else 1.0
        row_out, step = blocking_row(T, q, sign, basis, reach, level, True, bland)
        idle = idle + 1 if step <= tolerance(reach[q]) else 0
        exchange(T, basis, reach, at, level, q, sign, row_out, step)
    return False


@inner
def climb(T: Array, basis: Indices, reach: Array, at: Array, level: Array, d: Array, reduced: Array, y: Array) -> bool:
    """Phase two: from a feasible vertex to one that maximises d; multipliers to y (m,). ``False`` at the limit.

    ``reduced`` (g + m,) is room for the reduced costs.
    """
    m = T.shape[0]
    g = at.size
    largest = 0.0
    for j in range(g):
        largest = max(largest, abs(d[j]) * reach[j])
        reduced[j] = d[j]
    for i in range(m):
        reduced[g + i] = 0.0
    for i in range(m):
        if basis[i] >= 0:
            cost = d[basis[i]]
            if cost != 0.0:
                subtract_from(reduced, T, i, cost)
    idle = 0
    optimal = False
    for _ in range(200 + 20 * (m + g)):
        bland = idle > m + g
        q = entering_variable(reduced, at, OPTIMAL * largest, bland)
        if q < 0:
            optimal = True
            break
        sign = -1.0 if at[q] > 0.0 else 1.0
        row_out, step = blocking_row(T, q, sign, basis, reach, level, False, bland)
        idle = idle + 1 if step <= tolerance(reach[q]) else 0
        exchange(T, basis, reach, at, level, q, sign, row_out, step)
        if row_out >= 0:
            subtract_from(reduced, T, row_out, reduced[q])
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
            for k in range(m):
                y[k] += T[i, g + k] * residual[i]
