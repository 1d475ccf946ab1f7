"""Sums, products, quotients and roots of doubles, rounded down or up.

The error of the rounded result is computed exactly where that can be done, so that an exact result stays as it is; else
the next double is taken. ``next_up(x) ≥`` the successor of x, at most one double further (S. M. Rump, P. Zimmermann,
S. Boldo and G. Melquiond 2009).
"""

from __future__ import annotations

import math

from lsu_mesh.kernels.intervals.double_double import two_product, two_sum
from lsu_mesh.kernels.runtime.compile import inlined, inner

PHI = 2.0**-53 * (1.0 + 2.0**-52)
TINY = 2.0**-1074
RELATIVE_ERROR = 2.0**-60
"""What a function computed with two doubles is taken to err by; tests measure less than 2⁻⁶⁷."""
MAX_FACTOR = 1.0e150
MIN_PRODUCT = 1.0e-250


@inlined
def next_up(x: float) -> float:
    """A double above x."""
    return x + (abs(x) * PHI + TINY)


@inlined
def next_down(x: float) -> float:
    """A double below x."""
    return x - (abs(x) * PHI + TINY)


@inlined
def sum_down(a: float, b: float) -> float:
    """A bound from below on ``a + b``, the sum itself where it is a double."""
    s, e = two_sum(a, b)
    return s if e >= 0.0 else next_down(s)


@inlined
def sum_up(a: float, b: float) -> float:
    """A bound from above on ``a + b``."""
    s, e = two_sum(a, b)
    return s if e <= 0.0 else next_up(s)


@inlined
def product_error(a: float, b: float) -> float:
    """A number with the sign of ``a b`` minus its rounded value, 0 where that is exact, NaN where it is not known."""
    p = abs(a * b)
    if abs(a) < MAX_FACTOR and abs(b) < MAX_FACTOR and p > MIN_PRODUCT:
        return two_product(a, b)[1]
    if a == 0.0 or b == 0.0:
        return 0.0
    return math.nan


@inner
def product_down(a: float, b: float) -> float:
    """A bound from below on ``a b``."""
    return a * b if product_error(a, b) >= 0.0 else next_down(a * b)


@inner
def product_up(a: float, b: float) -> float:
    """A bound from above on ``a b``."""
    return a * b if product_error(a, b) <= 0.0 else next_up(a * b)


@inlined
def quotient_error(a: float, b: float) -> float:
    """A number with the sign of ``a / b`` minus its rounded value, 0 or NaN as in :func:`product_error`; b is not 0."""
    q = a / b
    if abs(q) < MAX_FACTOR and abs(b) < MAX_FACTOR and abs(a) > MIN_PRODUCT and abs(q) > 1.0e-100:
        p, e = two_product(q, b)
        rest = (a - p) - e
        return rest if b > 0.0 else -rest
    if a == 0.0:
        return 0.0
    return math.nan


@inner
def quotient_down(a: float, b: float) -> float:
    """A bound from below on ``a / b`` for b other than 0."""
    return a / b if quotient_error(a, b) >= 0.0 else next_down(a / b)


@inner
def quotient_up(a: float, b: float) -> float:
    """A bound from above on ``a / b`` for b other than 0."""
    return a / b if quotient_error(a, b) <= 0.0 else next_up(a / b)


@inlined
def root_error(x: float) -> float:
    """A number with the sign of ``√x`` minus its rounded value, 0 or NaN as in :func:`product_error`; x ≥ 0."""
    if x == 0.0:
        return 0.0
    if not MIN_PRODUCT < x < MAX_FACTOR:
        return math.nan
    s = math.sqrt(x)
    p, e = two_product(s, s)
    return (x - p) - e


@inner
def root_down(x: float) -> float:
    """A bound from below on ``√x`` for x ≥ 0."""
    return math.sqrt(x) if root_error(x) >= 0.0 else next_down(math.sqrt(x))


@inner
def root_up(x: float) -> float:
    """A bound from above on ``√x`` for x ≥ 0."""
    return math.sqrt(x) if root_error(x) <= 0.0 else next_up(math.sqrt(x))


@inlined
def pair_down(hi: float, lo: float) -> float:
    """A bound from below on a value that ``hi + lo`` is within ``RELATIVE_ERROR`` of."""
    return hi if lo > RELATIVE_ERROR * abs(hi) or hi == 0.0 else next_down(hi)


@inlined
def pair_up(hi: float, lo: float) -> float:
    """A bound from above on a value that ``hi + lo`` is within ``RELATIVE_ERROR`` of."""
    return hi if lo < -RELATIVE_ERROR * abs(hi) or hi == 0.0 else next_up(hi)
