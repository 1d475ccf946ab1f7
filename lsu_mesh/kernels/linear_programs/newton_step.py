"""One Newton step towards the central path of a banded program.

The slacks and their multipliers are eliminated, which leaves a symmetric matrix with a band (one row an x) and a border
(one column a θ or h): one step costs time linear in the number of x.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.linear_programs.banded_program import IS_FIXED, Limits, Point, Rows, is_equation, row_values
from lsu_mesh.kernels.linear_programs.bordered_systems import solve_bordered
from lsu_mesh.kernels.runtime.compile import inner

EQUATION = 1e-9
"""Weight of an equation's multiplier in it: the proximal step that makes the system definite."""
FIXED = 1e30
"""Curvature of an unknown that does not move."""


class System(NamedTuple):
    """Newton's matrix: band (N, reach + 1), border (N, t + w), corner (t + w, t + w)."""

    band: Matrix
    border: Matrix
    corner: Matrix


class Work(NamedTuple):
    """Values f and widths W of the rows at the point, (R, 2); how a step changes them; multipliers on trial."""

    values: Matrix
    changes: Matrix
    weights: Matrix
    limit_weights: Matrix
    residual: Vector


@inner
def assemble(rows: Rows, point: Point, system: System) -> None:
    """The matrix of Newton's step."""
    band, border, corner = system
    count = border.shape[0]
    coefficients = rows.g.shape[1]
    band[:] = 0.0
    border[:] = 0.0
    corner[:] = 0.0
    for r in range(rows.first.size):
        span = rows.span[r]
        if span == 0:
            continue
        first, w, factor = rows.first[r], coefficients + rows.width[r], rows.factor[r]
        if is_equation(rows, r):
            both, difference = 1.0 / EQUATION, 0.0
        else:
            upper = point.pairs_dual[r, 0] / point.pairs[r, 0]
            lower = point.pairs_dual[r, 1] / point.pairs[r, 1]
            both, difference = upper + lower, (lower - upper) * factor
        has_width = rows.width[r] >= 0
        for i in range(span):
            value = both * rows.a[r, i]
            if value == 0.0:
                continue
            for j in range(i + 1):
                band[first + i, i - j] += value * rows.a[r, j]
            for j in range(coefficients):
                border[first + i, j] += value * rows.g[r, j]
            if has_width:
                border[first + i, w] += difference * rows.a[r, i]
        for i in range(coefficients):
            for j in range(i + 1):
                corner[i, j] += both * rows.g[r, i] * rows.g[r, j]
            if has_width:
                corner[w, i] += difference * rows.g[r, i]
        if has_width:
            corner[w, w] += both * factor * factor
    _add_limits(point, band, corner, count)


@inner
def _add_limits(point: Point, band: Matrix, corner: Matrix, count: int) -> None:
    for i in range(point.z.size):
        weight = 0.0
        for side in range(2):
            if point.limits[i, side] >= 0.0:
                weight += point.limits_dual[i, side] / point.limits[i, side]
        if i < count:
            band[i, 0] += weight
        else:
            corner[i - count, i - count] += weight


@inner
def regularise(point: Point, system: System, least: float) -> None:
    """A little more curvature, so that a direction that nothing bounds stays where it is; fixed unknowns too."""
    count = system.band.shape[0]
    for i in range(count):
        system.band[i, 0] += least if point.limits[i, 0] != IS_FIXED else FIXED
    for i in range(system.corner.shape[0]):
        system.corner[i, i] += least if point.limits[count + i, 0] != IS_FIXED else FIXED


@inner
def least_curvature(system: System) -> float:
    """So little that it changes no step in a direction that the rows or limits bound."""
    smallest = np.inf
    for i in range(system.band.shape[0]):
        if system.band[i, 0] > 0.0:
            smallest = min(smallest, system.band[i, 0])
    return 1e-10 * smallest if np.isfinite(smallest) else 1e-10


@inner
def gradient(
    rows: Rows, limits: Limits, point: Point, count: int, weights: Matrix, limit_weights: Matrix, out: Vector
) -> None:
    """The derivative of the Lagrangian with these multipliers; 0 at fixed unknowns."""
    coefficients = rows.g.shape[1]
    for i in range(out.size):
        out[i] = limits.cost[i] - limit_weights[i, 0] + limit_weights[i, 1]
    for r in range(rows.first.size):
        if rows.span[r] == 0:
            continue
        first, w = rows.first[r], rows.width[r]
        difference = weights[r, 0] - weights[r, 1]
        for i in range(rows.span[r]):
            out[first + i] += difference * rows.a[r, i]
        for i in range(coefficients):
            out[count + i] += difference * rows.g[r, i]
        if w >= 0:
            out[count + coefficients + w] -= (weights[r, 0] + weights[r, 1]) * rows.factor[r]
    for i in range(out.size):
        if point.limits[i, 0] == IS_FIXED:
            out[i] = 0.0


@inner
def aims(
    rows: Rows, limits: Limits, point: Point, moved: Point, target: float, second_order: float, work: Work
) -> None:  # fmt: skip
    """Multipliers of Newton's right side; ``moved``, times ``second_order``, is the predictor."""
    for r in range(rows.first.size):
        if rows.span[r] == 0:
            continue
        f, W = work.values[r, 0] + rows.d[r], work.values[r, 1] + rows.reach[r]
        if is_equation(rows, r):
            work.weights[r, 0] = point.pairs_dual[r, 0] + f / EQUATION
            continue
        for side in range(2):
            s, dual = point.pairs[r, side], point.pairs_dual[r, side]
            gap = W - (f if side == 0 else -f) - s
            aim = target - second_order * moved.pairs[r, side] * moved.pairs_dual[r, side]
            work.weights[r, side] = (aim - dual * gap) / s
    for i in range(point.z.size):
        for side in range(2):
            s, dual = point.limits[i, side], point.limits_dual[i, side]
            if s >= 0.0:
                gap = (point.z[i] - limits.lower[i] if side == 0 else limits.upper[i] - point.z[i]) - s
                aim = target - second_order * moved.limits[i, side] * moved.limits_dual[i, side]
                work.limit_weights[i, side] = (aim - dual * gap) / s


@inner
def _spread(rows: Rows, limits: Limits, point: Point, moved: Point, work: Work) -> None:
    """Changes of slacks and multipliers that go with ``moved.z`` and the right side's multipliers."""
    for r in range(rows.first.size):
        if rows.span[r] == 0:
            continue
        f, W = work.values[r, 0] + rows.d[r], work.values[r, 1] + rows.reach[r]
        change, wider = work.changes[r, 0], work.changes[r, 1]
        if is_equation(rows, r):
            moved.pairs_dual[r, 0] = (f + change) / EQUATION
            continue
        for side in range(2):
            s, dual = point.pairs[r, side], point.pairs_dual[r, side]
            sign = 1.0 if side == 0 else -1.0
            moved.pairs[r, side] = (W - sign * f - s) + wider - sign * change
            moved.pairs_dual[r, side] = work.weights[r, side] - dual - dual / s * (wider - sign * change)
    for i in range(point.z.size):
        for side in range(2):
            s, dual = point.limits[i, side], point.limits_dual[i, side]
            if s >= 0.0:
                sign = 1.0 if side == 0 else -1.0
                gap = (point.z[i] - limits.lower[i] if side == 0 else limits.upper[i] - point.z[i]) - s
                moved.limits[i, side] = gap + sign * moved.z[i]
                moved.limits_dual[i, side] = work.limit_weights[i, side] - dual - dual / s * sign * moved.z[i]


@inner
def solve(
    rows: Rows, limits: Limits, point: Point, moved: Point, count: int, system: System, work: Work, polishes: int
) -> None:  # fmt: skip
    """Newton's direction for the multipliers in ``work``; each polish puts in the residual of the dual equations."""
    gradient(rows, limits, point, count, work.weights, work.limit_weights, work.residual)
    moved.z[:] = 0.0
    for polish in range(polishes + 1):
        for i in range(work.residual.size):
            work.residual[i] = -work.residual[i]
        solve_bordered(system.band, system.border, system.corner, work.residual[:count], work.residual[count:])
        for i in range(moved.z.size):
            moved.z[i] += work.residual[i]
        row_values(rows, moved.z, count, work.changes)
        _spread(rows, limits, point, moved, work)
        if polish < polishes:
            _add(moved.pairs_dual, point.pairs_dual)
            _add(moved.limits_dual, point.limits_dual)
            gradient(rows, limits, point, count, moved.pairs_dual, moved.limits_dual, work.residual)


@inner
def _add(one: Matrix, other: Matrix) -> None:
    for i in range(one.shape[0]):
        for j in range(one.shape[1]):
            one[i, j] += other[i, j]
