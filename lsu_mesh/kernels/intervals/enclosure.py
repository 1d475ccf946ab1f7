"""Linear enclosures of functions over a box, row by row, by Taylor's theorem of first and of second order.

``f_i(z) ∈ M_i (z − z̄) + [low_i, high_i]`` for every z in the box; z̄ is a point of it, d_j the larger distance of z̄_j to
the ends. First order: M the middle of the gradient over the box, ``± Σ R_j d_j`` with R its radius, and ``[f_i(z̄)]``.
Second order: M the middle of the gradient at z̄ and ``½ Σ H_jj [0, d_j²] ± Σ_{j<k} |H_jk| d_j d_k`` besides. Each row
takes the narrower of the two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Integers, Matrix, Vector
from lsu_mesh.kernels.intervals.arithmetic import multiply_intervals
from lsu_mesh.kernels.intervals.directed import product_up, sum_down, sum_up
from lsu_mesh.kernels.intervals.tape import Tape, evaluate
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel

FIRST = 1
SECOND = 2
NOT_ENCLOSED = 0


class Functions(NamedTuple):
    """m functions of p variables z on one tape, whose first ``slopes_end`` rows are all but the second derivatives.

    values (m,), gradients (m, p), hessians (m, p, p) are rows of the tape, −1 where a derivative is 0; ``orders`` (m,):
    up to which order a function has derivatives; ``variables`` (p,): numbers of z among those of the tape.
    """

    tape: Tape
    slopes_end: int
    values: Integers
    gradients: Integers
    hessians: Integers
    orders: Integers
    variables: Integers


class Linear(NamedTuple):
    """M (m, p), low (m,), high (m,), and the order that was taken (m,), ``NOT_ENCLOSED`` where there is none."""

    slopes: Matrix
    low: Vector
    high: Vector
    order: Integers


@inlined
def size_of(low: float, high: float) -> float:
    """``max |[low, high]|``"""
    return max(abs(low), abs(high))


@inner
def middle_and_radius(low: float, high: float) -> tuple[float, float]:
    """A double within, or next to, an interval, and a bound on its distance from every point of it."""
    middle = low + 0.5 * (high - low)
    return middle, max(sum_up(high, -middle), sum_up(middle, -low))


@kernel
def enclose(functions: Functions, lower: Vector, upper: Vector, center: Vector, result: Linear) -> None:
    """Enclose all functions over the box [lower, upper] of all variables of the tape, around ``center``."""
    rows = functions.tape.operations.size
    p = functions.variables.size
    low, high = np.empty(rows), np.empty(rows)
    low_at, high_at = np.empty(rows), np.empty(rows)
    needs_second = False
    for i in range(functions.values.size):
        needs_second |= functions.orders[i] >= SECOND
    evaluate(functions.tape, lower, upper, rows if needs_second else functions.slopes_end, low, high)
    evaluate(functions.tape, center, center, functions.slopes_end, low_at, high_at)
    distances = np.empty(p)
    for j in range(p):
        v = functions.variables[j]
        distances[j] = max(sum_up(upper[v], -center[v]), sum_up(center[v], -lower[v]))
    slopes = np.empty(p)
    for i in range(functions.values.size):
        at = functions.values[i]
        result.order[i] = NOT_ENCLOSED
        if not (math.isfinite(low_at[at]) and math.isfinite(high_at[at]) and low[at] <= high[at]):
            continue
        remainder = first_order(functions, i, low, high, distances, result.slopes)
        if math.isfinite(remainder):
            result.order[i] = FIRST
            result.low[i], result.high[i] = sum_down(low_at[at], -remainder), sum_up(high_at[at], remainder)
        if functions.orders[i] < SECOND:
            continue
        below, above = second_order(functions, i, low, high, low_at, high_at, distances, slopes)
        if not (math.isfinite(below) and math.isfinite(above)):
            continue
        below, above = sum_down(low_at[at], below), sum_up(high_at[at], above)
        if result.order[i] == NOT_ENCLOSED or above - below < result.high[i] - result.low[i]:
            result.order[i], result.low[i], result.high[i] = SECOND, below, above
            result.slopes[i] = slopes


@inner
def first_order(functions: Functions, i: int, low: Vector, high: Vector, distances: Vector, slopes: Matrix) -> float:
    """Write row i of M, return ``Σ R_j d_j``; not finite where a derivative is not enclosed."""
    remainder = 0.0
    for j in range(distances.size):
        slopes[i, j] = 0.0
        at = functions.gradients[i, j]
        if at >= 0:
            slopes[i, j], radius = middle_and_radius(low[at], high[at])
            if not math.isfinite(slopes[i, j]):
                return math.nan
            if radius > 0.0 and distances[j] > 0.0:
                remainder = sum_up(remainder, product_up(radius, distances[j]))
    return remainder


@inner
def second_order(
    functions: Functions, i: int, low: Vector, high: Vector, low_at: Vector, high_at: Vector, distances: Vector,
    slopes: Vector,
) -> tuple[float, float]:  # fmt: skip
    """Write M_i to slopes (p,), return bounds on what is left without ``f_i(z̄)``; not finite as in first_order."""
    p = distances.size
    below, above = 0.0, 0.0
    for j in range(p):
        slopes[j] = 0.0
        at = functions.gradients[i, j]
        if at >= 0:
            slopes[j], radius = middle_and_radius(low_at[at], high_at[at])
            if not math.isfinite(slopes[j]):
                return math.nan, math.nan
            if radius > 0.0 and distances[j] > 0.0:
                error = product_up(radius, distances[j])
                below, above = sum_down(below, -error), sum_up(above, error)
    for j in range(p):
        if distances[j] == 0.0:
            continue
        for k in range(j, p):
            at = functions.hessians[i, j, k]
            if at < 0 or distances[k] == 0.0:
                continue
            if not low[at] <= high[at]:
                return math.nan, math.nan
            area = product_up(distances[j], distances[k])
            if j == k:
                half = 0.5 * area
                above = sum_up(above, product_up(max(0.0, high[at]), half))
                below = sum_down(below, -product_up(max(0.0, -low[at]), half))
            else:
                error = product_up(size_of(low[at], high[at]), area)
                below, above = sum_down(below, -error), sum_up(above, error)
    return below, above


@kernel
def offsets(result: Linear, center: Vector, columns: Integers, middles: Vector, radii: Vector) -> None:
    """``f_i(z) ∈ Σ_columns M_ij z_j + middles_i ± radii_i`` where all other z are z̄: z̄ is taken from the offset."""
    for i in range(result.low.size):
        low, high = result.low[i], result.high[i]
        for j in range(columns.size):
            k = columns[j]
            a, b = multiply_intervals(result.slopes[i, k], result.slopes[i, k], center[k], center[k])
            low, high = sum_down(low, -b), sum_up(high, -a)
        middles[i], radii[i] = middle_and_radius(low, high)
