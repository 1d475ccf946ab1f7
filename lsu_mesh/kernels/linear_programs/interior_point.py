"""Mehrotra's predictor and corrector for linear programs with a band.

Each step solves one system with a band and a border, so that its cost is linear in the number of x. The iterates stay
close to the central path, so the answer is a *centred* point of the optimal face, not a vertex.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.kernels.linear_programs.banded_program import Limits, Point, Rows, is_equation, objective, row_values
from lsu_mesh.kernels.linear_programs.bordered_systems import factor_bordered
from lsu_mesh.kernels.linear_programs.newton_step import (
    System,
    Work,
    aims,
    assemble,
    gradient,
    least_curvature,
    regularise,
    solve,
)
from lsu_mesh.kernels.runtime.compile import inner, kernel

TO_BOUNDARY = 0.99
BALANCED = 1e-9
"""Largest violation of the dual equations at the end, as a share of the cost."""
FAR = 1e6
"""Steps are polished from this multiple of the aim on."""
NEAR = 1e4
"""From this multiple of the aim on, the best point is kept."""
PATIENCE = 5
"""After so many steps without a better point, rounding has the better of the method."""
LEAST_PIVOT = 1e-15


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
        assemble(rows, point, system)
        if iteration == 0:
            curvature = least_curvature(system)
        regularise(point, system, curvature)
        factor_bordered(system.band, system.border, system.corner, LEAST_PIVOT)
        aims(rows, limits, point, moved, 0.0, 0.0, work)
        solve(rows, limits, point, moved, count, system, work, 0)
        primal, dual = _step_lengths(rows, point, moved, 1.0)
        affine, _ = _gap(point, moved, primal, dual)
        sigma = min(max((affine / total) ** 3, 1e-6), 1.0)
        aims(rows, limits, point, moved, sigma * total / terms, 1.0, work)
        solve(rows, limits, point, moved, count, system, work, 1 if merit <= FAR else 0)
        primal, dual = _step_lengths(rows, point, moved, 1.0 / TO_BOUNDARY)
        _go(point, moved, TO_BOUNDARY * primal, TO_BOUNDARY * dual)
    _copy(best, point)
    return most


@inner
def _imbalance(rows: Rows, limits: Limits, point: Point, count: int, work: Work) -> float:
    """Largest violation of a dual equation, as a share of the largest cost."""
    gradient(rows, limits, point, count, point.pairs_dual, point.limits_dual, work.residual)
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
