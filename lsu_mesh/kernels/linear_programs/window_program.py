"""The program of a window: a start from which the interior-point method needs few iterations, and a checked answer.

All half-widths large, all multipliers of a half-width equal: that start is feasible for the rows and for the dual
equations at once, and it is well centred, whatever the data.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.linear_programs.banded_program import (
    IS_FIXED,
    NO_LIMIT,
    Limits,
    Point,
    Rows,
    is_equation,
    objective,
    row_values,
)
from lsu_mesh.kernels.linear_programs.interior_point import improve
from lsu_mesh.kernels.runtime.compile import inner, kernel

MARGIN = 0.1
"""How far from its limits an unknown starts, as a share of their distance."""
WIDE = 2.0
"""Half-widths start at so many times the largest residual."""
THINNEST = 1e-10
"""A state whose box is thinner than this share of the size of the data is fixed at its middle."""
SHARE = 0.95
"""Share of a half-width's cost that its rows carry at the start; the rest goes to its limit."""
GAP = 1e-8
"""Complementarity at the end, as a share of the objective."""
MIN_VALUE = 1e-10
"""… and as a share of the size of the data, where these are almost without noise."""
NARROWEST = 1e-3
"""No half-width starts below this share of the size of the data."""


@kernel
def solve_window(
    rows: Rows, limits: Limits, start: Vector, count: int, reach: int, most: int
) -> tuple[int, Vector, float, float, float, float]:  # fmt: skip
    """Solve, and make the answer exact: iterations, z, objective, its lower bound, violation, size of the data.

    ``start`` (N + t + w,): where to begin; only x and θ are used. Half-widths of the answer are the smallest that its
    x and θ allow.
    """
    widths = count + rows.g.shape[1]
    scale = data_size(rows, start, count)
    inner_rows, inner_limits = in_units_of(scale, rows, limits, count)
    z = start.copy()
    for i in range(z.size):
        if i < count or i >= widths:
            z[i] /= scale
    point = _starting_point(inner_rows, inner_limits, z, count, widths)
    iterations = improve(inner_rows, inner_limits, point, count, reach, GAP, MIN_VALUE, most)
    for i in range(z.size):
        z[i] = point.z[i] * (scale if i < count or i >= widths else 1.0)
    z, violation = restored(rows, limits, z, count)
    bound = dual_bound(rows, limits, z, point.pairs_dual, count)
    return iterations, z, objective(limits, z), bound, violation, scale


@kernel
def data_size(rows: Rows, start: Vector, count: int) -> float:
    """The size of the data, 1 where they are all 0; programs are solved in units of it."""
    scale = 0.0
    for r in range(rows.first.size):
        if rows.span[r] > 0:
            scale = max(scale, abs(rows.d[r]))
    for i in range(count):
        scale = max(scale, abs(start[i]))
    return scale if scale > 0.0 else 1.0


@kernel
def in_units_of(scale: float, rows: Rows, limits: Limits, count: int) -> tuple[Rows, Limits]:
    """The same program in other units of states and half-widths; θ keeps its own."""
    widths = count + rows.g.shape[1]
    lower, upper = limits.lower.copy(), limits.upper.copy()
    for i in range(lower.size):
        if i < count or i >= widths:
            lower[i] /= scale
            upper[i] /= scale
        if i < count and upper[i] - lower[i] <= THINNEST:
            lower[i] = upper[i] = 0.5 * (lower[i] + upper[i])
    return (
        Rows(
            rows.first, rows.span, rows.a, rows.g / scale, rows.d / scale, rows.width, rows.factor, rows.reach / scale
        ),
        Limits(lower, upper, limits.cost),
    )


@kernel
def checked(
    rows: Rows, limits: Limits, z: Vector, multipliers: Matrix, count: int
) -> tuple[Vector, float, float, float]:  # fmt: skip
    """Another solver's answer made exact: z, objective, its lower bound, violation."""
    exact, violation = restored(rows, limits, z, count)
    signed = multipliers.copy()
    for r in range(signed.shape[0]):
        if rows.span[r] > 0 and not is_equation(rows, r):
            for side in range(2):
                signed[r, side] = max(signed[r, side], 0.0)
    return exact, objective(limits, exact), dual_bound(rows, limits, exact, signed, count), violation


@inner
def _starting_point(rows: Rows, limits: Limits, start: Vector, count: int, widths: int) -> Point:
    z = start.copy()
    size = z.size
    for i in range(widths):
        z[i] = _inside(z[i], limits.lower[i], limits.upper[i])
    z[widths:] = 0.0
    values = np.empty((rows.first.size, 2))
    row_values(rows, z, count, values)
    terms = _start_widths(rows, limits, z, widths, values)
    row_values(rows, z, count, values)
    pairs, pairs_dual = np.zeros((rows.first.size, 2)), np.zeros((rows.first.size, 2))
    total, pairs_count = 0.0, 0
    for r in range(rows.first.size):
        if rows.span[r] > 0 and rows.width[r] >= 0:
            i = widths + rows.width[r]
            for side in range(2):
                f = values[r, 0] + rows.d[r]
                W = values[r, 1] + rows.reach[r]
                pairs[r, side] = max(W - (f if side == 0 else -f), MARGIN * max(W, abs(f)))
                pairs_dual[r, side] = SHARE * limits.cost[i] / (2.0 * rows.factor[r] * terms[rows.width[r]])
                total += pairs[r, side] * pairs_dual[r, side]
                pairs_count += 1
    mu = total / pairs_count if pairs_count > 0 else 1.0
    _start_constant_rows(rows, values, pairs, pairs_dual, mu)
    slacks, duals = np.full((size, 2), NO_LIMIT), np.zeros((size, 2))
    for i in range(size):
        if limits.lower[i] == limits.upper[i]:
            slacks[i, 0] = slacks[i, 1] = IS_FIXED
            continue
        if np.isfinite(limits.lower[i]):
            slacks[i, 0] = z[i] - limits.lower[i]
            duals[i, 0] = mu / slacks[i, 0]
        if np.isfinite(limits.upper[i]):
            slacks[i, 1] = limits.upper[i] - z[i]
            duals[i, 1] = mu / slacks[i, 1]
        if slacks[i, 0] > 0.0 and slacks[i, 1] > 0.0:  # equal multipliers balance each other
            duals[i, 0] = duals[i, 1] = 0.5 * (duals[i, 0] + duals[i, 1])
        elif i >= widths:
            rest = limits.cost[i] * (1.0 - SHARE if terms[i - widths] > 0 else 1.0)
            duals[i, 0] = max(rest, 1e-3 * limits.cost[i])
    return Point(z, pairs, pairs_dual, slacks, duals)


@inner
def _start_widths(rows: Rows, limits: Limits, z: Vector, widths: int, values: Matrix) -> Vector:
    """Set the half-widths; how many rows each has."""
    terms = np.zeros(z.size - widths)
    largest = 0.0
    for r in range(rows.first.size):
        w = rows.width[r]
        if rows.span[r] > 0 and w >= 0:
            terms[w] += 1
            needed = max(abs(values[r, 0] + rows.d[r]) - rows.reach[r], 0.0) / rows.factor[r]
            z[widths + w] = max(z[widths + w], WIDE * needed)
            largest = max(largest, needed)
    for i in range(widths, z.size):
        least = max(1e-2 * largest, NARROWEST)
        low, high = limits.lower[i], limits.upper[i]
        wanted = max(z[i], least, low + least)
        z[i] = wanted if wanted < high else _inside(wanted, low, high)
    return terms


@inner
def _start_constant_rows(rows: Rows, values: Matrix, pairs: Matrix, pairs_dual: Matrix, mu: float) -> None:
    """Rows whose width is known."""
    for r in range(rows.first.size):
        if rows.span[r] > 0 and rows.width[r] < 0 and not is_equation(rows, r):
            f = values[r, 0] + rows.d[r]
            for side in range(2):
                room = rows.reach[r] - (f if side == 0 else -f)
                pairs[r, side] = max(room, MARGIN * rows.reach[r])
                pairs_dual[r, side] = mu / pairs[r, side]


@inner
def _inside(value: float, low: float, high: float) -> float:
    """The value, moved away from its limits."""
    if low == high:
        return low
    if np.isfinite(low) and np.isfinite(high):
        room = MARGIN * (high - low)
        return min(max(value, low + room), high - room)
    if np.isfinite(low):
        return max(value, low + MARGIN)
    return min(value, high - MARGIN) if np.isfinite(high) else value


@inner
def restored(rows: Rows, limits: Limits, z: Vector, count: int) -> tuple[Vector, float]:
    """z with x and θ in their limits and the smallest half-widths that then fulfil the rows; the largest violation."""
    widths = count + rows.g.shape[1]
    out = np.empty_like(z)
    for i in range(z.size):
        out[i] = min(max(z[i], limits.lower[i]), limits.upper[i])
    for i in range(widths, z.size):
        out[i] = limits.lower[i]
    values = np.empty((rows.first.size, 2))
    row_values(rows, out, count, values)
    violation = 0.0
    for r in range(rows.first.size):
        if rows.span[r] > 0:
            over = abs(values[r, 0] + rows.d[r]) - rows.reach[r]
            w = rows.width[r]
            if w < 0:
                violation = max(violation, over)
            else:
                out[widths + w] = max(out[widths + w], over / rows.factor[r])
    for i in range(widths, z.size):
        if out[i] > limits.upper[i]:
            violation = max(violation, out[i] - limits.upper[i])
            out[i] = limits.upper[i]
    return out, violation


@inner
def dual_bound(rows: Rows, limits: Limits, z: Vector, multipliers: Matrix, count: int) -> float:
    """``min c'z`` is not below this, for any multipliers; unknowns without limits are taken to stay near z.

    ``Σ λ (d − reach) + Σ_i min over the limits of (c + A'λ)_i z_i``
    """
    coefficients = rows.g.shape[1]
    widths = count + coefficients
    reduced = limits.cost.copy()
    total = 0.0
    for r in range(rows.first.size):
        if rows.span[r] == 0:
            continue
        difference = multipliers[r, 0] - multipliers[r, 1]
        together = multipliers[r, 0] + multipliers[r, 1]
        total += difference * rows.d[r] - (0.0 if is_equation(rows, r) else together * rows.reach[r])
        for i in range(rows.span[r]):
            reduced[rows.first[r] + i] += difference * rows.a[r, i]
        for i in range(coefficients):
            reduced[count + i] += difference * rows.g[r, i]
        if rows.width[r] >= 0:
            reduced[widths + rows.width[r]] -= together * rows.factor[r]
    near = 1e-300
    for i in range(z.size):
        near = max(near, abs(z[i]))
    for i in range(z.size):
        low, high = max(limits.lower[i], z[i] - near), min(limits.upper[i], z[i] + near)
        total += min(reduced[i] * low, reduced[i] * high)
    return total
