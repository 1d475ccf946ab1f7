"""An interior-point method for linear programs whose rows come in pairs along a band.

``min c'z`` over ``z = [x; θ; h]``: many x (N,) in an order in which each row meets only neighbours, few coefficients θ
(t,) and few half-widths h (w,)::

    |a_r · x[first_r : first_r + span_r] + g_r · θ + d_r| <= factor_r · h[width_r] + reach_r,    lower <= z <= upper

A row with ``width_r = −1`` and ``reach_r = 0`` is an equation. Mehrotra's predictor and corrector: each step solves one
system with a band and a border, so that its cost is linear in N. The iterates stay close to the central path, so the
answer is a *centred* point of the optimal face, not a vertex.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Indices, Matrix, Vector
from lsu_mesh.kernels.linear_programs.bordered_systems import factor_bordered, solve_bordered
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel

TO_BOUNDARY = 0.99
EQUATION = 1e-9
"""Weight of an equation's multiplier in it: the proximal step that makes the system definite."""
FIXED = 1e30
"""Curvature of an unknown that does not move."""
NO_LIMIT, IS_FIXED = -1.0, -2.0
"""What stands for a slack in ``Point.limits``."""
BALANCED = 1e-9
"""Largest violation of the dual equations at the end, as a share of the cost."""
FAR = 1e6
"""Steps are polished from this multiple of the aim on."""
NEAR = 1e4
"""From this multiple of the aim on, the best point is kept."""
PATIENCE = 5
"""After so many steps without a better point, rounding has the better of the method."""
LEAST_PIVOT = 1e-15


class Rows(NamedTuple):
    """Pairs of rows; a (R, S), g (R, t), all others (R,). A row with ``span = 0`` is not used."""

    first: Indices
    span: Indices
    a: Matrix
    g: Matrix
    d: Vector
    width: Indices
    factor: Vector
    reach: Vector


class Limits(NamedTuple):
    """lower <= z <= upper, infinite where there is none; cost c; each (N + t + w,)."""

    lower: Vector
    upper: Vector
    cost: Vector


class Point(NamedTuple):
    """Unknowns z, slacks and multipliers of the pairs (R, 2) and of the limits (N + t + w, 2), all positive.

    An equation keeps its multiplier, of any sign, in ``pairs_dual[r, 0]``.
    """

    z: Vector
    pairs: Matrix
    pairs_dual: Matrix
    limits: Matrix
    limits_dual: Matrix


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


@inlined
def is_equation(rows: Rows, r: int) -> bool:
    """Whether the row is an equation."""
    return bool(rows.width[r] < 0 and rows.reach[r] == 0.0)


@inner
def row_values(rows: Rows, z: Vector, count: int, out: Matrix) -> None:
    """``a·x + g·θ`` and ``factor·h`` of every row without their constants, (R, 2); ``count``: how many x there are."""
    coefficients = rows.g.shape[1]
    for r in range(rows.first.size):
        total = 0.0
        first = rows.first[r]
        for j in range(rows.span[r]):
            total += rows.a[r, j] * z[first + j]
        for j in range(coefficients):
            total += rows.g[r, j] * z[count + j]
        out[r, 0] = total
        w = rows.width[r]
        out[r, 1] = rows.factor[r] * z[count + coefficients + w] if w >= 0 else 0.0


@inner
def _assemble(rows: Rows, point: Point, system: System) -> None:
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
def _regularise(point: Point, system: System, least: float) -> None:
    """A little more curvature, so that a direction that nothing bounds stays where it is; fixed unknowns too."""
    count = system.band.shape[0]
    for i in range(count):
        system.band[i, 0] += least if point.limits[i, 0] != IS_FIXED else FIXED
    for i in range(system.corner.shape[0]):
        system.corner[i, i] += least if point.limits[count + i, 0] != IS_FIXED else FIXED


@inner
def _least_curvature(system: System) -> float:
    """So little that it changes no step in a direction that the rows or limits bound."""
    smallest = np.inf
    for i in range(system.band.shape[0]):
        if system.band[i, 0] > 0.0:
            smallest = min(smallest, system.band[i, 0])
    return 1e-10 * smallest if np.isfinite(smallest) else 1e-10


@inner
def _gradient(
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
def _aims(
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
def _solve(
    rows: Rows, limits: Limits, point: Point, moved: Point, count: int, system: System, work: Work, polishes: int
) -> None:  # fmt: skip
    """Newton's direction for the multipliers in ``work``; each polish puts in the residual of the dual equations."""
    _gradient(rows, limits, point, count, work.weights, work.limit_weights, work.residual)
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
            _gradient(rows, limits, point, count, moved.pairs_dual, moved.limits_dual, work.residual)


@inner
def _add(one: Matrix, other: Matrix) -> None:
    for i in range(one.shape[0]):
        for j in range(one.shape[1]):
            one[i, j] += other[i, j]


@inner
def _longest(slacks: Matrix, changes: Matrix, longest: float) -> float:
    """The longest step, at most ``longest``, that leaves all that is positive so."""
    for i in range(slacks.shape[0]):
        for side in range(2):
            if slacks[i, side] > 0.0 and slacks[i, side] < -longest * changes[i, side]:
                longest = -slacks[i, side] / changes[i, side]
    return longest


@inner
def _complementarity(
    slacks: Matrix, duals: Matrix, changes: Matrix, dual_changes: Matrix, primal: float, dual: float
) -> tuple[float, int]:  # fmt: skip
    """``Σ slack · multiplier`` after a step, and how many terms it has."""
    total, terms = 0.0, 0
    for i in range(slacks.shape[0]):
        for side in range(2):
            if slacks[i, side] > 0.0:
                s = slacks[i, side] + primal * changes[i, side]
                total += s * (duals[i, side] + dual * dual_changes[i, side])
                terms += 1
    return total, terms


@inner
def _gap(point: Point, moved: Point, primal: float, dual: float) -> tuple[float, int]:
    one, terms = _complementarity(point.pairs, point.pairs_dual, moved.pairs, moved.pairs_dual, primal, dual)
    other, more = _complementarity(point.limits, point.limits_dual, moved.limits, moved.limits_dual, primal, dual)
    return one + other, terms + more


@inner
def _go(point: Point, moved: Point, primal: float, dual: float) -> None:
    for i in range(point.z.size):
        point.z[i] += primal * moved.z[i]
        for side in range(2):
            if point.limits[i, side] > 0.0:
                point.limits[i, side] += primal * moved.limits[i, side]
                point.limits_dual[i, side] += dual * moved.limits_dual[i, side]
    for r in range(point.pairs.shape[0]):
        for side in range(2):
            point.pairs[r, side] += primal * moved.pairs[r, side]
            point.pairs_dual[r, side] += dual * moved.pairs_dual[r, side]


@inner
def _violation(rows: Rows, point: Point, work: Work) -> float:
    """How far the slacks are from what the rows leave: 0 once the start was feasible."""
    worst = 0.0
    for r in range(rows.first.size):
        if rows.span[r] == 0:
            continue
        f, W = work.values[r, 0] + rows.d[r], work.values[r, 1] + rows.reach[r]
        if is_equation(rows, r):
            worst = max(worst, abs(f))
        else:
            worst = max(worst, abs(W - f - point.pairs[r, 0]), abs(W + f - point.pairs[r, 1]))
    return worst


@inner
def _copy(source: Point, target: Point) -> None:
    target.z[:] = source.z
    target.pairs[:] = source.pairs
    target.pairs_dual[:] = source.pairs_dual
    target.limits[:] = source.limits
    target.limits_dual[:] = source.limits_dual


@inner
def _empty_like(point: Point) -> Point:
    return Point(
        np.zeros_like(point.z), np.zeros_like(point.pairs), np.zeros_like(point.pairs_dual),
        np.zeros_like(point.limits), np.zeros_like(point.limits_dual),
    )  # fmt: skip


@inner
def objective(limits: Limits, z: Vector) -> float:
    """``c'z``"""
    total = 0.0
    for i in range(z.size):
        total += limits.cost[i] * z[i]
    return total


@kernel
def improve(
    rows: Rows, limits: Limits, point: Point, count: int, reach: int, share: float, least: float, most: int
) -> int:  # fmt: skip
    """From a start with positive slacks and multipliers to the optimum, in place; how many iterations it took.

    ``count``: how many x there are; ``reach``: how far apart two x in one row are at most. It ends when the
    complementarity is at most ``share`` of the objective plus ``least``, and rows are violated by no more than
    ``least`` (a feasible start stays so), after ``most`` iterations, or where rounding allows no better point: whether
    the point is good enough is for the caller to check.
    """
    k = point.z.size - count
    system = System(np.empty((count, reach + 1)), np.empty((count, k)), np.empty((k, k)))
    work = Work(
        np.zeros_like(point.pairs), np.zeros_like(point.pairs), np.zeros_like(point.pairs),
        np.zeros_like(point.limits), np.zeros(count + k),
    )  # fmt: skip
    moved = _empty_like(point)
    best = _empty_like(point)
    curvature, best_merit, best_iteration = 0.0, np.inf, 0
    for iteration in range(most):
        row_values(rows, point.z, count, work.values)
        total, terms = _gap(point, moved, 0.0, 0.0)
        aim = share * abs(objective(limits, point.z)) + least
        merit = total / aim
        if merit <= NEAR:
            unbalanced = _imbalance(rows, limits, point, count, work)
            merit = max(merit, unbalanced / BALANCED, _violation(rows, point, work) / least)
        if merit < best_merit:
            best_merit, best_iteration = merit, iteration
            if merit <= NEAR or iteration == 0:
                _copy(point, best)
        if merit <= 1.0:
            return iteration
        if iteration - best_iteration > PATIENCE or not np.isfinite(total):
            _copy(best, point)
            return iteration
        _assemble(rows, point, system)
        if iteration == 0:
            curvature = _least_curvature(system)
        _regularise(point, system, curvature)
        factor_bordered(system.band, system.border, system.corner, LEAST_PIVOT)
        _aims(rows, limits, point, moved, 0.0, 0.0, work)
        _solve(rows, limits, point, moved, count, system, work, 0)
        primal, dual = _step_lengths(rows, point, moved, 1.0)
        affine, _ = _gap(point, moved, primal, dual)
        sigma = min(max((affine / total) ** 3, 1e-6), 1.0)
        _aims(rows, limits, point, moved, sigma * total / terms, 1.0, work)
        _solve(rows, limits, point, moved, count, system, work, 1 if merit <= FAR else 0)
        primal, dual = _step_lengths(rows, point, moved, 1.0 / TO_BOUNDARY)
        _go(point, moved, TO_BOUNDARY * primal, TO_BOUNDARY * dual)
    _copy(best, point)
    return most


@inner
def _imbalance(rows: Rows, limits: Limits, point: Point, count: int, work: Work) -> float:
    """Largest violation of a dual equation, as a share of the largest cost."""
    _gradient(rows, limits, point, count, point.pairs_dual, point.limits_dual, work.residual)
    worst, largest = 0.0, 0.0
    for i in range(point.z.size):
        worst, largest = max(worst, abs(work.residual[i])), max(largest, abs(limits.cost[i]))
    return worst / largest if largest > 0.0 else worst


@inner
def _step_lengths(rows: Rows, point: Point, moved: Point, longest: float) -> tuple[float, float]:
    """The longest steps, at most ``longest``, of unknowns and multipliers; an equation's multiplier has any sign."""
    primal = _longest(point.limits, moved.limits, _longest(point.pairs, moved.pairs, longest))
    dual = _longest(point.limits_dual, moved.limits_dual, longest)
    for r in range(rows.first.size):
        if rows.span[r] > 0 and not is_equation(rows, r):
            for side in range(2):
                if point.pairs_dual[r, side] < -dual * moved.pairs_dual[r, side]:
                    dual = -point.pairs_dual[r, side] / moved.pairs_dual[r, side]
    return primal, dual
