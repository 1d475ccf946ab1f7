"""Safe maxima of many objectives over one set ``{ξ : A ξ = b, |ξ|∞ ≤ 1}``, and proofs that it is empty."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.linear_programs.dual_bound import absolute_row_sums, dual_bound_in
from lsu_mesh.kernels.linear_programs.simplex import (
    balanced,
    basic_levels,
    canonical_tableau,
    climb,
    find_vertex,
    refactor,
    refine_multipliers,
    starting_bounds,
)
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.runtime.rounding import gamma, up

TIGHT = 0
"""Every bound is reached, to rounding, by a feasible point."""
EMPTY = 1
"""The set is proved to be empty."""
LOOSE = 2
"""Some bound is true but not reached: the simplex was stopped by its limit or by rounding."""

GAP = 1e-9
"""Distance between a bound and the best point found, relative to ``Σ|d_j|``, above which the bound is called loose."""


class Program(NamedTuple):
    """A feasible set, balanced (see ``simplex.py``), with a vertex of it and room to work in.

    rows (m, g), sides (m,), reach (g,), absolute row sums (m,); tableau (m, g + m), basis (m,), nonbasic bounds (g,),
    basic levels (m,); room for multipliers (m,), reduced costs (g + m,) and the scaled objective (g,).
    """

    rows: Array
    sides: Array
    reach: Array
    sums: Array
    tableau: Array
    basis: NDArray[np.int64]
    at: Array
    level: Array
    multipliers: Array
    costs: Array
    objective: Array


@kernel
def open_program(A: Array, b: Array) -> tuple[int, Program]:
    """Find a first vertex, from a canonical basis; status ``TIGHT``, ``LOOSE`` where none was found, or ``EMPTY``."""
    m, g = A.shape
    rows, sides, reach = balanced(A, b)
    tableau, basis = canonical_tableau(rows, reach)
    program = Program(
        rows, sides, reach, absolute_row_sums(rows, reach), tableau, basis,
        np.empty(g), np.empty(m), np.zeros(m), np.empty(g + m), np.empty(g),
    )  # fmt: skip
    starting_bounds(tableau, sides, basis, reach, program.at, program.level)
    if _contradicts(program):
        return EMPTY, program
    found = find_vertex(tableau, basis, reach, program.at, program.level, program.multipliers)
    if _farkas(program, program.multipliers):
        return EMPTY, program
    if not found:
        found = _start_again(program)
    return (TIGHT if found else LOOSE), program


@inner
def _start_again(program: Program) -> bool:
    """Factorise the basis anew and look for a feasible vertex from there."""
    refactor(program.rows, program.tableau, program.basis)
    basic_levels(program.tableau, program.sides, program.basis, program.at, program.level)
    return find_vertex(program.tableau, program.basis, program.reach, program.at, program.level, program.multipliers)


@inner
def maximise(program: Program, d: Array, point: Array) -> tuple[float, bool]:
    """Safe upper bound of ``max d'ξ`` and whether ``point`` (g,), which is written, attains it to rounding.

    Starts from the vertex where the program stands and leaves it at the new one. Where the bound is loose the basis is
    factorised anew and the rest of the way climbed once more.
    """
    for j in range(d.size):
        program.objective[j] = d[j] / program.reach[j]
    value, tight = _climb_to(program, d, point)
    if not tight:
        _start_again(program)
        again, tight = _climb_to(program, d, point)
        value = min(value, again)
    if np.isfinite(value):
        return value, tight
    box = 0.0
    for j in range(d.size):
        box += abs(d[j])
    return up(box * (1.0 + gamma(d.size))), False


@inner
def _climb_to(program: Program, d: Array, point: Array) -> tuple[float, bool]:
    g = d.size
    y = program.multipliers
    basic_levels(program.tableau, program.sides, program.basis, program.at, program.level)
    done = climb(
        program.tableau, program.basis, program.reach, program.at, program.level, program.objective, program.costs, y
    )
    refine_multipliers(program.rows, program.tableau, program.basis, program.objective, y)
    value = dual_bound_in(program.objective, program.rows, program.sides, program.reach, program.sums, y, program.costs)
    vertex(program, point)
    reached = 0.0
    size = 0.0
    for j in range(g):
        reached += d[j] * point[j]
        size += abs(d[j])
    return value, done and value - reached <= GAP * size + 1e-290


@inner
def vertex(program: Program, point: Array) -> None:
    """The ξ (g,) where the program stands."""
    for j in range(point.size):
        point[j] = program.at[j] / program.reach[j]
    for i in range(program.basis.size):
        j = program.basis[i]
        if j >= 0:
            point[j] = program.level[i] / program.reach[j]


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
            if (
                dual_bound_in(np.zeros(g), program.rows, program.sides, program.reach, program.sums, y, program.costs)
                < 0.0
            ):
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
    return (
        some
        and dual_bound_in(np.zeros(g), program.rows, program.sides, program.reach, program.sums, y, program.costs) < 0.0
    )
