"""exp, expm1 and log to 70 bits, as sums of two doubles.

Each is reduced exactly enough to a short interval and summed there: the leading terms of the series with two doubles,
the rest, which is below 2⁻²⁰ of the sum, with one. What is left of the series is below 2⁻⁷⁵. All constants come from
``constants.py``. A relative error of 2⁻⁶⁰ is what the callers allow for; tests measure below 2⁻⁶⁷.
"""

from __future__ import annotations

import math

from lsu_mesh.kernels.intervals.constants import INVERSE_FACTORIALS, LN2_HI, LN2_LO, LN2_PARTS, ODD_INVERSES
from lsu_mesh.kernels.intervals.double_double import add, divide, multiply, quick_two_sum, two_sum
from lsu_mesh.kernels.runtime.compile import inner

INVERSE_LN2 = 1.4426950408889634
LN2_1, LN2_2, LN2_3 = LN2_PARTS
MAX_EXPONENT = 709.0
"""Above it exp may overflow."""
MIN_EXPONENT = -708.0
"""Below it exp may be subnormal."""
ROOT_HALF = 0.7071067811865476


@inner
def reduced_expm1(r: float, r_lo: float) -> tuple[float, float]:
    """``e^(r + r_lo) − 1`` for ``|r| ≤ .35``: Taylor's series from the seventh power on with one double."""
    tail = 0.0
    for j in range(20, 6, -1):
        tail = (tail + INVERSE_FACTORIALS[j, 0]) * r
    s, e = tail, 0.0
    for j in range(6, 0, -1):
        s, e = add(INVERSE_FACTORIALS[j, 0], INVERSE_FACTORIALS[j, 1], s, e)
        s, e = multiply(s, e, r, r_lo)
    return s, e


@inner
def reduced(x: float) -> tuple[int, float, float]:
    """``x = k ln 2 + r`` with a whole k and ``|r| ≤ .35``, for ``|x| ≤ 709``."""
    k = math.floor(x * INVERSE_LN2 + 0.5)
    r, e = two_sum(x, -k * LN2_1)
    r, f = two_sum(r, -k * LN2_2)
    r, e = quick_two_sum(r, e + f)
    r, e = add(r, e, -k * LN2_3, 0.0)
    return k, r, e


@inner
def exp(x: float) -> tuple[float, float]:
    """``e^x`` for ``−708 ≤ x ≤ 709``."""
    k, r, r_lo = reduced(x)
    s, e = reduced_expm1(r, r_lo)
    s, e = add(1.0, 0.0, s, e)
    return math.ldexp(s, k), math.ldexp(e, k)


@inner
def expm1(x: float) -> tuple[float, float]:
    """``e^x − 1`` for ``−708 ≤ x ≤ 709``, with a small relative error near 0 too."""
    k, r, r_lo = reduced(x)
    s, e = reduced_expm1(r, r_lo)
    if k == 0:
        return s, e
    s, e = add(1.0, 0.0, s, e)
    return add(math.ldexp(s, k), math.ldexp(e, k), -1.0, 0.0)


@inner
def log(x: float) -> tuple[float, float]:
    """``ln x`` for a positive x: ``x = 2^k m`` with ``√½ ≤ m < √2``, ``ln m = 2 artanh((m − 1) / (m + 1))``."""
    m, k = math.frexp(x)
    if m < ROOT_HALF:
        m, k = 2.0 * m, k - 1
    low, low_e = two_sum(m, 1.0)
    s, s_lo = divide(m - 1.0, 0.0, low, low_e)
    z, z_lo = multiply(s, s_lo, s, s_lo)
    tail = 0.0
    for j in range(18, 4, -1):
        tail = (tail + ODD_INVERSES[j, 0]) * z
    t, e = tail, 0.0
    for j in range(4, -1, -1):
        t, e = add(ODD_INVERSES[j, 0], ODD_INVERSES[j, 1], t, e)
        if j:
            t, e = multiply(t, e, z, z_lo)
    t, e = multiply(t, e, 2.0 * s, 2.0 * s_lo)
    p, p_lo = multiply(LN2_HI, LN2_LO, float(k), 0.0)
    return add(p, p_lo, t, e)
