"""Outputs ``y = C x + D u + d + v``, known up to a multiple of a period, as plain strips ``|y − C x| ≤ r``."""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.compile import inlined, kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, UNIT_ROUNDOFF, down, gamma, up

MAX_PERIODS = 2.0**40
"""A set that spans more periods says nothing of y, and y nothing of it."""


@kernel
def output_shift(D: Matrix, d: Vector, u: Vector, u_widths: Vector, shift: Vector, spread: Vector) -> None:
    """Fills shift (m,) and spread (m,): ``|D u + d − shift| ≤ spread`` for all u within u_widths (p,) of u (p,)."""
    for i in range(d.size):
        total, mass, reach = d[i], abs(d[i]), 0.0
        terms = 0
        for j in range(u.size):
            if D[i, j] != 0.0:
                terms += 1
                total += D[i, j] * u[j]
                mass += abs(D[i, j] * u[j])
                reach += abs(D[i, j]) * u_widths[j]
        shift[i], spread[i] = total, 0.0
        if terms > 0:
            lost = reach + gamma(terms + 2) * mass
            spread[i] = lost * (1.0 + gamma(2 * terms + 8)) + UNDERFLOW


@kernel
def plain_strips(
    y: Vector, r: Vector, shift: Vector, spread: Vector, period: Vector, low: Vector, high: Vector,
    plain_y: Vector, plain_r: Vector,
) -> int:  # fmt: skip
    """Fills plain_y, plain_r (m,): every x with ``low ≤ C x ≤ high`` and a true y has ``|plain_y − C x| ≤ plain_r``.

    ``y − shift`` with its rounding in r; of an output with a period the strip of the one j for which
    ``y + j period`` can be, or from the smallest to the largest such j. Where there is none the strip is that of the
    nearest j, which misses. Returns how many outputs have none. low, high (m,) are read where period > 0 only.
    """
    missed = 0
    for i in range(y.size):
        plain_y[i], plain_r[i] = y[i], r[i]
        if math.isnan(y[i]):
            continue
        if shift[i] != 0.0 or spread[i] != 0.0:
            plain_y[i] = y[i] - shift[i]
            lost = UNIT_ROUNDOFF * abs(plain_y[i])
            plain_r[i] = up(up(r[i] + spread[i]) + up(lost)) if lost > 0.0 or spread[i] > 0.0 else r[i]
        if period[i] > 0.0:
            missed += _choose_period(i, period[i], low[i], high[i], plain_y, plain_r)
    return missed


@inlined
def _choose_period(i: int, period: float, low: float, high: float, y: Vector, r: Vector) -> int:
    """Replace entry i of y, r by the strip of the possible multiples; returns 1 where there is none."""
    unit = 0.0 if period == math.floor(period) else 2.0 * UNIT_ROUNDOFF * period
    first, last = (low - r[i] - y[i]) / period, (high + r[i] - y[i]) / period
    if not (abs(first) < MAX_PERIODS and abs(last) < MAX_PERIODS):
        y[i] = math.nan
        return 0
    # each quotient is off by its rounding, and by what the period is not known to
    mass = (abs(low) + abs(high) + r[i] + abs(y[i])) / period
    slack = up(gamma(16) * (mass + 1.0))
    smallest, largest = math.ceil(first - slack), math.floor(last + slack)
    missed = 0
    if smallest > largest:
        missed = 1
        smallest = math.floor(0.5 * (first + last) + 0.5)
        largest = smallest
    reach = max(abs(smallest), abs(largest))
    lost = up(reach * unit + gamma(6) * (abs(y[i]) + reach * period))
    if smallest == largest:
        if smallest != 0:
            y[i] += smallest * period
            r[i] = up(r[i] + lost)
        return missed
    bottom = down(down(down(y[i] + smallest * period) - r[i]) - lost)
    top = up(up(up(y[i] + largest * period) + r[i]) + lost)
    y[i] = 0.5 * bottom + 0.5 * top
    r[i] = up(max(top - y[i], y[i] - bottom))
    return missed


@kernel
def shifted_interval(lower: Vector, upper: Vector, point: Vector, shift: Vector, spread: Vector) -> None:
    """Move an interval of ``C x + v``, and its point, by ``shift ± spread`` in place, rounded outward; each (m,)."""
    for i in range(lower.size):
        if shift[i] != 0.0 or spread[i] != 0.0:
            lower[i] = down(down(lower[i] + shift[i]) - spread[i])
            upper[i] = up(up(upper[i] + shift[i]) + spread[i])
            point[i] += shift[i]
