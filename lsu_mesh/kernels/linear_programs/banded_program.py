"""Linear programs whose rows come in pairs along a band, and a point of their interior.

``min c'z`` over ``z = [x; θ; h]``: many x (N,) in an order in which each row meets only neighbours, few coefficients θ
(t,) and few half-widths h (w,)::

    |a_r · x[first_r : first_r + span_r] + g_r · θ + d_r| <= factor_r · h[width_r] + reach_r,    lower <= z <= upper

A row with ``width_r = −1`` and ``reach_r = 0`` is an equation.
"""

from __future__ import annotations

from typing import NamedTuple

from lsu_mesh.array_types import Indices, Matrix, Vector
from lsu_mesh.kernels.runtime.compile import inlined, inner

NO_LIMIT, IS_FIXED = -1.0, -2.0
"""What stands for a slack in ``Point.limits``."""


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
def objective(limits: Limits, z: Vector) -> float:
    """``c'z``"""
    total = 0.0
    for i in range(z.size):
        total += limits.cost[i] * z[i]
    return total
