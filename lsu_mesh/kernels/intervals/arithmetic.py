"""+ − × ÷, powers, roots and absolute values of intervals ``[a, b]``, rounded outward.

``(NaN, NaN)`` stands for *not enclosed*: an argument leaves the domain of a function, or a bound overflows. Every
operation passes it on.
"""

from __future__ import annotations

import math

from lsu_mesh.kernels.intervals.directed import (
    pair_down,
    pair_up,
    product_down,
    product_up,
    quotient_down,
    quotient_up,
    root_down,
    root_up,
    sum_down,
    sum_up,
)
from lsu_mesh.kernels.intervals.double_double import multiply
from lsu_mesh.kernels.runtime.compile import inlined, inner

Interval = tuple[float, float]


@inlined
def checked(low: float, high: float) -> Interval:
    """The interval, or *not enclosed* where a bound is not finite."""
    if math.isfinite(low) and math.isfinite(high):
        return low, high
    return math.nan, math.nan


@inner
def add(a: float, b: float, c: float, d: float) -> Interval:
    """``[a, b] + [c, d]``"""
    return checked(sum_down(a, c), sum_up(b, d))


@inner
def subtract(a: float, b: float, c: float, d: float) -> Interval:
    """``[a, b] − [c, d]``"""
    return checked(sum_down(a, -d), sum_up(b, -c))


@inner
def multiply_intervals(a: float, b: float, c: float, d: float) -> Interval:
    """``[a, b] [c, d]``"""
    if a >= 0.0:
        if c >= 0.0:
            return checked(product_down(a, c), product_up(b, d))
        if d <= 0.0:
            return checked(product_down(b, c), product_up(a, d))
        return checked(product_down(b, c), product_up(b, d))
    if b <= 0.0:
        if c >= 0.0:
            return checked(product_down(a, d), product_up(b, c))
        if d <= 0.0:
            return checked(product_down(b, d), product_up(a, c))
        return checked(product_down(a, d), product_up(a, c))
    if c >= 0.0:
        return checked(product_down(a, d), product_up(b, d))
    if d <= 0.0:
        return checked(product_down(b, c), product_up(a, c))
    low = min(product_down(a, d), product_down(b, c))
    return checked(low, max(product_up(a, c), product_up(b, d)))


@inner
def divide_intervals(a: float, b: float, c: float, d: float) -> Interval:
    """``[a, b] / [c, d]``, not enclosed where the divisor holds 0."""
    if not (c > 0.0 or d < 0.0):
        return math.nan, math.nan
    if d < 0.0:
        a, b, c, d = -b, -a, -d, -c
    low = quotient_down(a, d if a >= 0.0 else c)
    return checked(low, quotient_up(b, c if b >= 0.0 else d))


@inner
def square(a: float, b: float) -> Interval:
    """``[a, b]²``"""
    if a >= 0.0:
        return checked(product_down(a, a), product_up(b, b))
    if b <= 0.0:
        return checked(product_down(b, b), product_up(a, a))
    size = max(-a, b)
    return checked(0.0, product_up(size, size)) if size >= 0.0 else (math.nan, math.nan)


@inner
def power_of_number(x: float, n: int) -> tuple[float, float, bool]:
    """``x^n`` for x > 0 and n ≥ 1 as a sum of two doubles, and whether that is within its error."""
    s, e = 1.0, 0.0
    base, base_lo = x, 0.0
    while n > 0:
        if n % 2 == 1:
            s, e = multiply(s, e, base, base_lo)
        n //= 2
        if n > 0:
            base, base_lo = multiply(base, base_lo, base, base_lo)
            if not 1.0e-140 < base < 1.0e140:
                return s, e, False
    return s, e, 1.0e-280 < s < 1.0e280


@inner
def power_bounds(x: float, n: int) -> Interval:
    """Bounds on ``x^n`` for x ≥ 0 and n ≥ 1."""
    if x == 0.0:
        return 0.0, 0.0
    s, e, is_sure = power_of_number(x, n)
    if is_sure:
        return pair_down(s, e), pair_up(s, e)
    low, high = 1.0, 1.0  # step by step: a bound that leaves the range of doubles ends as 0 or infinity
    for _ in range(n):
        low, high = max(0.0, product_down(low, x)), product_up(high, x)
    return low, high


@inner
def integer_power(a: float, b: float, n: int) -> Interval:
    """``[a, b]^n`` for a whole n; not enclosed where n < 0 and the base holds 0."""
    if n < 0:
        low, high = integer_power_positive(a, b, -n)
        return divide_intervals(1.0, 1.0, low, high)
    return integer_power_positive(a, b, n)


@inner
def integer_power_positive(a: float, b: float, n: int) -> Interval:
    """``[a, b]^n`` for n ≥ 0."""
    if n == 0:
        return 1.0, 1.0
    if not a <= b:
        return math.nan, math.nan
    if a >= 0.0:
        return checked(power_bounds(a, n)[0], power_bounds(b, n)[1])
    if n % 2 == 0:
        if b <= 0.0:
            return checked(power_bounds(-b, n)[0], power_bounds(-a, n)[1])
        return checked(0.0, power_bounds(max(-a, b), n)[1])
    low = -power_bounds(-a, n)[1]
    return checked(low, power_bounds(b, n)[1] if b >= 0.0 else -power_bounds(-b, n)[0])


@inner
def square_root(a: float, b: float) -> Interval:
    """``√[a, b]``, not enclosed where a < 0."""
    if not a >= 0.0:
        return math.nan, math.nan
    return checked(root_down(a), root_up(b))


@inner
def absolute(a: float, b: float) -> Interval:
    """``|[a, b]|``"""
    if a >= 0.0:
        return a, b
    if b <= 0.0:
        return -b, -a
    return (0.0, max(-a, b)) if a <= b else (math.nan, math.nan)


@inner
def sign(a: float, b: float) -> Interval:
    """The hull of the slopes of ``|x|``: 1, −1, or [−1, 1] where the interval holds 0."""
    if a > 0.0:
        return 1.0, 1.0
    if b < 0.0:
        return -1.0, -1.0
    return (-1.0, 1.0) if a <= b else (math.nan, math.nan)


@inner
def minimum(a: float, b: float, c: float, d: float) -> Interval:
    """``min([a, b], [c, d])``"""
    return (min(a, c), min(b, d)) if a <= b and c <= d else (math.nan, math.nan)


@inner
def maximum(a: float, b: float, c: float, d: float) -> Interval:
    """``max([a, b], [c, d])``"""
    return (max(a, c), max(b, d)) if a <= b and c <= d else (math.nan, math.nan)
