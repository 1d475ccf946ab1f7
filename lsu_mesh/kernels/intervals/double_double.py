"""Numbers as unevaluated sums ``hi + lo`` of two doubles: some 104 bits, from + − × ÷ √ alone.

So the bits are the same on every processor: nothing is fused, nothing comes from a library. Sums and products of
T. J. Dekker 1971 and D. E. Knuth; a sum errs by at most 2⁻¹⁰³ of the sum of sizes, a product by 2⁻¹⁰² of itself, a
quotient by 2⁻¹⁰⁰, as long as nothing overflows and no product falls below 2⁻⁹⁰⁰ (M. Joldes, J.-M. Muller and
V. Popescu 2017).
"""

from __future__ import annotations

import math

from lsu_mesh.kernels.runtime.compile import inlined

SPLITTER = 134217729.0
"""2²⁷ + 1"""


@inlined
def two_sum(a: float, b: float) -> tuple[float, float]:
    """``a + b = s + e`` exactly."""
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


@inlined
def quick_two_sum(a: float, b: float) -> tuple[float, float]:
    """As :func:`two_sum`, for ``|a| ≥ |b|``."""
    s = a + b
    return s, b - (s - a)


@inlined
def two_product(a: float, b: float) -> tuple[float, float]:
    """``a b = p + e`` exactly, for sizes of factors below 2⁹⁹⁵ and a product that is 0 or above 2⁻⁹⁰⁰."""
    p = a * b
    t = SPLITTER * a
    a_hi = t - (t - a)
    a_lo = a - a_hi
    t = SPLITTER * b
    b_hi = t - (t - b)
    b_lo = b - b_hi
    return p, ((a_hi * b_hi - p) + a_hi * b_lo + a_lo * b_hi) + a_lo * b_lo


@inlined
def add(a: float, a_lo: float, b: float, b_lo: float) -> tuple[float, float]:
    """``(a + a_lo) + (b + b_lo)``"""
    s, e = two_sum(a, b)
    t, f = two_sum(a_lo, b_lo)
    s, e = quick_two_sum(s, e + t)
    return quick_two_sum(s, e + f)


@inlined
def multiply(a: float, a_lo: float, b: float, b_lo: float) -> tuple[float, float]:
    """``(a + a_lo) (b + b_lo)``"""
    p, e = two_product(a, b)
    return quick_two_sum(p, e + (a * b_lo + a_lo * b))


@inlined
def divide(a: float, a_lo: float, b: float, b_lo: float) -> tuple[float, float]:
    """``(a + a_lo) / (b + b_lo)``: two steps of long division."""
    q = a / b
    p, e = multiply(b, b_lo, q, 0.0)
    r, r_lo = add(a, a_lo, -p, -e)
    second = (r + r_lo) / b
    p, e = multiply(b, b_lo, second, 0.0)
    r, r_lo = add(r, r_lo, -p, -e)
    q, second = quick_two_sum(q, second)
    return add(q, second, (r + r_lo) / b, 0.0)


@inlined
def root(a: float, a_lo: float) -> tuple[float, float]:
    """``√(a + a_lo)`` for a > 0: the square root of a, corrected by one step of Newton."""
    s = math.sqrt(a)
    p, e = two_product(s, s)
    r, r_lo = add(a, a_lo, -p, -e)
    return quick_two_sum(s, (r + r_lo) / (2.0 * s))
