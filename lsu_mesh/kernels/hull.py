"""Safe maxima of many objectives over one set ``{ξ : A ξ = b, |ξ|∞ ≤ 1}``, and proofs that it is empty."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.compile import inner, kernel
from lsu_mesh.kernels.dual import absolute_row_sums, dual_bound_in
from lsu_mesh.kernels.simplex import (
    basic_levels,
    canonical_tableau,
    climb,
    find_vertex,
    refine_multipliers,
    scaled_rows,
    starting_bounds,
)

Array = NDArray[np.float64]

TIGHT = 0
"""Every bound is reached, to rounding, by a feasible point."""
EMPTY = 1
"""The set is proved to be empty."""
LOOSE = 2
"""Some bound is true but not reached: the simplex was stopped by its limit or by rounding."""

GAP = 1e-9
"""Distance between a bound and the best point found, relative to ``Σ|d_j|``, above which the bound is called loose."""


class Program(NamedTuple):
    """A feasible set with a vertex of it: scaled rows (m, g), their sides (m,) and absolute sums (m,), the tableau
    (m, g + m), basis (m,), nonbasic bounds (g,), basic levels (m,), and room for multipliers (m,), costs (g + m,)."""

    rows: Array
    sides: Array
    sums: Array
    tableau: Array
    basis: NDArray[np.int64]
    at: Array
    level: Array
    multipliers: Array
    costs: Array


@kernel
def open_program(A: Array, b: Array) -> tuple[int, Program]:
    """Find a first vertex, from a canonical basis; status ``TIGHT``, ``LOOSE`` where none was found, or ``EMPTY``."""
    m, g = A.shape
    rows, sides = scaled_rows(A, b)
    sums = absolute_row_sums(rows)
    tableau, basis = canonical_tableau(rows)
    program = Program(rows, sides, sums, tableau, basis, np.empty(g), np.empty(m), np.zeros(m), np.empty(g + m))
    starting_bounds(tableau, sides, basis, program.at, program.level)
    if _contradicts(program):
        return EMPTY, program
    found = find_vertex(tableau, basis, program.at, program.level, program.multipliers)
    if _farkas(program, program.multipliers):
        return EMPTY, program
    return (TIGHT if found else LOOSE), program


@inner
def maximise(program: Program, d: Array, point: Array) -> tuple[float, bool]:
    """Safe upper bound of ``max d'ξ`` and whether ``point`` (g,), which is written, attains it to rounding.

    Starts from the vertex where the program stands and leaves it at the new one.
    """
    m, g = program.rows.shape
    basic_levels(program.tableau, program.sides, program.basis, program.at, program.level)
    done = climb(program.tableau, program.basis, program.at, program.level, d, program.costs, program.multipliers)
    refine_multipliers(program.rows, program.tableau, program.basis, d, program.multipliers)
    value = dual_bound_in(d, program.rows, program.sides, program.sums, program.multipliers, program.costs)
    for j in range(g):
        point[j] = program.at[j]
    for i in range(m):
        if program.basis[i] >= 0:
            point[program.basis[i]] = program.level[i]
    reached = 0.0
    size = 0.0
    for j in range(g):
        reached += d[j] * point[j]
        size += abs(d[j])
    return value, done and value - reached <= GAP * size + 1e-290


@kernel
def maxima(program: Program, D: Array) -> tuple[int, Array, Array]:
    """Safe upper bounds (k,) of the objectives in the rows of D (k, g), and points (k, g) that attain them to rounding.

    The bounds are true whatever the status, ``TIGHT`` or ``LOOSE``. Objectives are solved in order, each from the last
    vertex, so that a program just opened and the same D give the same bits.
    """
    k, g = D.shape
    values = np.empty(k)
    points = np.empty((k, g))
    status = TIGHT
    for t in range(k):
        values[t], tight = maximise(program, D[t], points[t])
        if not tight:
            status = LOOSE
    return status, values, points


@kernel
def variable_ranges(program: Program, points: Array) -> tuple[Array, Array]:
    """Ranges low, high (g,) of the ξ_j over the set, rounded outward and within [−1, 1].

    A feasible point with ξ_j = ±1 shows that this side cannot be tightened: ``points`` (k, g), and the vertices met on
    the way, save most of the 2g programs.
    """
    g = points.shape[1]
    low = np.empty(g)
    high = np.empty(g)
    for j in range(g):
        low[j], high[j] = 1.0, -1.0
        for t in range(points.shape[0]):
            low[j] = min(low[j], points[t, j])
            high[j] = max(high[j], points[t, j])
    d = np.zeros(g)
    vertex = np.empty(g)
    touching = 1.0 - 1e-9
    for t in range(2 * g):
        j = t // 2
        sign = 1.0 if t % 2 == 0 else -1.0
        if (sign > 0.0 and high[j] >= touching) or (sign < 0.0 and low[j] <= -touching):
            continue
        d[j] = sign
        value, _ = maximise(program, d, vertex)
        d[j] = 0.0
        for k in range(g):
            low[k] = min(low[k], vertex[k])
            high[k] = max(high[k], vertex[k])
        if sign > 0.0:
            high[j] = max(high[j], min(1.0, value))
        else:
            low[j] = min(low[j], max(-1.0, -value))
    for j in range(g):
        if high[j] >= touching:
            high[j] = 1.0
        if low[j] <= -touching:
            low[j] = -1.0
    return low, high


@inner
def _contradicts(program: Program) -> bool:
    """Whether a row that depends on the others proves emptiness: its left side vanishes and its right side does not."""
    m, g = program.rows.shape
    y = np.empty(m)
    for i in range(m):
        if program.basis[i] < 0 and program.level[i] != 0.0:
            sign = -1.0 if program.level[i] > 0.0 else 1.0
            for k in range(m):
                y[k] = sign * program.tableau[i, g + k]
            if dual_bound_in(np.zeros(g), program.rows, program.sides, program.sums, y, program.costs) < 0.0:
                return True
    return False


@inner
def _farkas(program: Program, sigma: Array) -> bool:
    """Whether the ray ``y = −σ'B⁻¹`` of phase one proves emptiness."""
    m, g = program.rows.shape
    y = np.zeros(m)
    some = False
    for i in range(m):
        if sigma[i] != 0.0:
            some = True
            for k in range(m):
                y[k] -= sigma[i] * program.tableau[i, g + k]
    return some and dual_bound_in(np.zeros(g), program.rows, program.sides, program.sums, y, program.costs) < 0.0
