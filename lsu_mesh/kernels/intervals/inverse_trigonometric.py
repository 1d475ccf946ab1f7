"""atan, asin and acos to 70 bits, as sums of two doubles."""

from __future__ import annotations

import math

from lsu_mesh.kernels.intervals.constants import ATANS, HALF_PI_HI, HALF_PI_LO, ODD_INVERSES, PI_HI, PI_LO
from lsu_mesh.kernels.intervals.double_double import add, divide, multiply, root, two_sum
from lsu_mesh.kernels.runtime.compile import inner

MIN_STEEP = 1.0e300
"""From here on the inverse of a slope, and its square, are of no account: atan is within 2⁻⁹⁹⁰ of π / 2."""


@inner
def atan_of_slope(t: float, t_lo: float) -> tuple[float, float]:
    """``atan(t + t_lo)`` for 0 ≤ t ≤ 1: ``atan(k/8) + atan((t − k/8) / (1 + t k/8))``, then Gregory's series."""
    k = math.floor(8.0 * t + 0.5)
    if k > 0:
        c = k / 8.0
        low, low_e = multiply(t, t_lo, c, 0.0)
        low, low_e = add(1.0, 0.0, low, low_e)
        t, t_lo = add(t, t_lo, -c, 0.0)
        t, t_lo = divide(t, t_lo, low, low_e)
    z, z_lo = multiply(t, t_lo, t, t_lo)
    tail = 0.0
    for j in range(12, 2, -1):
        tail = (ODD_INVERSES[j, 0] - tail) * z
    s, e = tail, 0.0
    for j in range(2, -1, -1):
        s, e = add(ODD_INVERSES[j, 0], ODD_INVERSES[j, 1], -s, -e)
        if j:
            s, e = multiply(s, e, z, z_lo)
    s, e = multiply(s, e, t, t_lo)
    return add(ATANS[k, 0], ATANS[k, 1], s, e)


@inner
def atan_of_ratio(y: float, y_lo: float, x: float, x_lo: float) -> tuple[float, float]:
    """``atan(y / x)`` for y ≥ 0, x ≥ 0, not both 0: π/2 minus the angle of the inverse where that is flatter."""
    if y <= x:
        t, t_lo = divide(y, y_lo, x, x_lo)
        return atan_of_slope(t, t_lo)
    t, t_lo = divide(x, x_lo, y, y_lo)
    s, e = atan_of_slope(t, t_lo)
    return add(HALF_PI_HI, HALF_PI_LO, -s, -e)


@inner
def atan(x: float) -> tuple[float, float]:
    """``atan x``"""
    size = abs(x)
    if size >= MIN_STEEP:
        s, e = HALF_PI_HI, HALF_PI_LO
    elif size < 1.0e-290:
        s, e = size, 0.0
    else:
        s, e = atan_of_ratio(size, 0.0, 1.0, 0.0)
    return (s, e) if x >= 0.0 else (-s, -e)


@inner
def asin(x: float) -> tuple[float, float]:
    """``asin x = atan(x / √((1 − x) (1 + x)))`` for ``|x| ≤ 1``"""
    size = abs(x)
    if size < 1.0e-290:
        return x, 0.0
    one, one_e = two_sum(1.0, -size)
    two, two_e = two_sum(1.0, size)
    if one == 0.0:
        s, e = HALF_PI_HI, HALF_PI_LO
    else:
        p, p_lo = multiply(one, one_e, two, two_e)
        p, p_lo = root(p, p_lo)
        s, e = atan_of_ratio(size, 0.0, p, p_lo)
    return (s, e) if x >= 0.0 else (-s, -e)


@inner
def acos(x: float) -> tuple[float, float]:
    """``acos x = 2 atan(√((1 − x) / (1 + x)))`` for ``|x| ≤ 1``"""
    one, one_e = two_sum(1.0, -x)
    two, two_e = two_sum(1.0, x)
    if one == 0.0:
        return 0.0, 0.0
    if two == 0.0:
        return PI_HI, PI_LO
    a, a_lo = root(one, one_e)
    b, b_lo = root(two, two_e)
    s, e = atan_of_ratio(a, a_lo, b, b_lo)
    return 2.0 * s, 2.0 * e
