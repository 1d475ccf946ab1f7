"""exp, log, trigonometric and hyperbolic functions of intervals, rounded outward; see ``arithmetic.py`` for NaN."""

from __future__ import annotations

import math

from lsu_mesh.kernels.intervals.arithmetic import Interval, checked
from lsu_mesh.kernels.intervals.constants import PI_HI, PI_LO
from lsu_mesh.kernels.intervals.directed import pair_down, pair_up
from lsu_mesh.kernels.intervals.double_double import add, divide
from lsu_mesh.kernels.intervals.exponential import MAX_EXPONENT, MIN_EXPONENT, exp, expm1, log
from lsu_mesh.kernels.intervals.inverse_trigonometric import acos, asin, atan, atan_of_ratio
from lsu_mesh.kernels.intervals.trigonometric import MAX_ANGLE, reduced, sin_of_reduced
from lsu_mesh.kernels.runtime.compile import inlined, inner

MAX_TURNS = 7.0
"""A wider interval holds a whole turn."""
ONE_SIDED = 40.0
"""Above it ``e^−x`` is below 2⁻¹¹⁵ of ``e^x``."""
MAX_COORDINATE, MIN_COORDINATE = 1.0e140, 1.0e-140
"""Between these sizes no product overflows or underflows on the way to an angle."""


@inner
def exponential(a: float, b: float) -> Interval:
    """``e^[a, b]``, not enclosed where it may overflow."""
    if not (a <= b <= MAX_EXPONENT):
        return math.nan, math.nan
    low = 0.0
    if a >= MIN_EXPONENT:
        s, e = exp(a)
        low = pair_down(s, e) if a != 0.0 else 1.0
    s, e = exp(max(b, MIN_EXPONENT))
    return low, pair_up(s, e) if b != 0.0 else 1.0


@inner
def logarithm(a: float, b: float) -> Interval:
    """``ln [a, b]``, not enclosed where a ≤ 0."""
    if not (a > 0.0 and a <= b < math.inf):
        return math.nan, math.nan
    low, low_e = log(a)
    high, high_e = log(b)
    return pair_down(low, low_e), pair_up(high, high_e)


@inner
def sine(a: float, b: float) -> Interval:
    """``sin [a, b]``"""
    return shifted_sine(a, b, 0)


@inner
def cosine(a: float, b: float) -> Interval:
    """``cos [a, b] = sin([a, b] + π/2)``"""
    return shifted_sine(a, b, 1)


@inner
def shifted_sine(a: float, b: float, quarters: int) -> Interval:
    """``sin([a, b] + quarters π/2)``: the bounds are at the ends, or 1 and −1 where a top or a bottom lies inside."""
    if not a <= b:
        return math.nan, math.nan
    if not (abs(a) < MAX_ANGLE and abs(b) < MAX_ANGLE and b - a < MAX_TURNS):
        return -1.0, 1.0
    q_a, r_a, e_a = reduced(a)
    q_b, r_b, e_b = reduced(b)
    q_a, q_b = q_a + quarters, q_b + quarters
    first = q_a if r_a <= 0.0 else q_a + 1  # the whole quarters from a to b
    last = q_b if r_b >= 0.0 else q_b - 1
    s_a, l_a = sin_of_reduced(q_a, r_a, e_a)
    s_b, l_b = sin_of_reduced(q_b, r_b, e_b)
    low, high = min(pair_down(s_a, l_a), pair_down(s_b, l_b)), max(pair_up(s_a, l_a), pair_up(s_b, l_b))
    if first + (1 - first) % 4 <= last:
        high = 1.0
    if first + (3 - first) % 4 <= last:
        low = -1.0
    return max(-1.0, low), min(1.0, high)


@inner
def tangent(a: float, b: float) -> Interval:
    """``tan [a, b]``, not enclosed where a pole lies inside."""
    if not (a <= b and abs(a) < MAX_ANGLE and abs(b) < MAX_ANGLE and b - a < MAX_TURNS):
        return math.nan, math.nan
    q_a, r_a, e_a = reduced(a)
    q_b, r_b, e_b = reduced(b)
    first = q_a if r_a <= 0.0 else q_a + 1
    last = q_b if r_b >= 0.0 else q_b - 1
    if first + (1 - first) % 2 <= last:
        return math.nan, math.nan
    s, e = sin_of_reduced(q_a, r_a, e_a)
    c, f = sin_of_reduced(q_a + 1, r_a, e_a)
    low, low_e = divide(s, e, c, f)
    s, e = sin_of_reduced(q_b, r_b, e_b)
    c, f = sin_of_reduced(q_b + 1, r_b, e_b)
    high, high_e = divide(s, e, c, f)
    return checked(pair_down(low, low_e), pair_up(high, high_e))


@inner
def arctangent(a: float, b: float) -> Interval:
    """``atan [a, b]``"""
    if not a <= b:
        return math.nan, math.nan
    low, low_e = atan(a)
    high, high_e = atan(b)
    return pair_down(low, low_e), pair_up(high, high_e)


@inner
def arcsine(a: float, b: float) -> Interval:
    """``asin [a, b]``, not enclosed outside [−1, 1]."""
    if not (a >= -1.0 and a <= b <= 1.0):
        return math.nan, math.nan
    low, low_e = asin(a)
    high, high_e = asin(b)
    return pair_down(low, low_e), pair_up(high, high_e)


@inner
def arccosine(a: float, b: float) -> Interval:
    """``acos [a, b]``, not enclosed outside [−1, 1]."""
    if not (a >= -1.0 and a <= b <= 1.0):
        return math.nan, math.nan
    low, low_e = acos(b)
    high, high_e = acos(a)
    return pair_down(low, low_e), pair_up(high, high_e)


@inlined
def without_tiny(a: float, b: float) -> Interval:
    """An interval around another one whose ends are 0 or not tiny, so that no product of the angle underflows."""
    if 0.0 < abs(a) < MIN_COORDINATE:
        a = 0.0 if a > 0.0 else -MIN_COORDINATE
    if 0.0 < abs(b) < MIN_COORDINATE:
        b = 0.0 if b < 0.0 else MIN_COORDINATE
    return a, b


@inner
def polar_angle(y: float, x: float) -> tuple[float, float]:
    """The angle of (x, y), not the origin, in (−π, π], as a sum of two doubles."""
    s, e = atan_of_ratio(abs(y), 0.0, abs(x), 0.0)
    if x < 0.0:
        s, e = add(PI_HI, PI_LO, -s, -e)
    return (s, e) if y >= 0.0 else (-s, -e)


@inner
def angle_from_left(y: float, x: float) -> tuple[float, float]:
    """The angle of (x, y), x < 0, in (π/2, 3π/2)."""
    s, e = atan_of_ratio(abs(y), 0.0, -x, 0.0)
    return add(PI_HI, PI_LO, -s, -e) if y >= 0.0 else add(PI_HI, PI_LO, s, e)


@inner
def angle(a: float, b: float, c: float, d: float, any_branch: bool) -> Interval:
    """``atan2([a, b], [c, d])`` of a box (y, x) that misses the origin.

    A box that meets the cut (y = 0 with points below, x < 0) is enclosed where any branch will do: then by the angle in
    (π/2, 3π/2). The angle is monotone in each coordinate on a half-plane, so the bounds are at corners.
    """
    if not (a <= b and c <= d):
        return math.nan, math.nan
    if max(abs(a), abs(b), abs(c), abs(d)) > MAX_COORDINATE:
        return math.nan, math.nan
    a, b, c, d = without_tiny(a, b)[0], without_tiny(a, b)[1], without_tiny(c, d)[0], without_tiny(c, d)[1]
    if c > 0.0:  # right
        low, low_e = polar_angle(a, d if a >= 0.0 else c)
        high, high_e = polar_angle(b, c if b >= 0.0 else d)
    elif a > 0.0 or (a == 0.0 and (d < 0.0)):  # above
        low, low_e = polar_angle(a if d >= 0.0 else b, d)
        high, high_e = polar_angle(a if c <= 0.0 else b, c)
    elif b < 0.0:  # below
        low, low_e = polar_angle(b if c <= 0.0 else a, c)
        high, high_e = polar_angle(b if d >= 0.0 else a, d)
    elif d < 0.0 and any_branch:  # left, across the cut
        low, low_e = angle_from_left(b, d if b >= 0.0 else c)
        high, high_e = angle_from_left(a, c if a >= 0.0 else d)
    else:
        return math.nan, math.nan
    return pair_down(low, low_e), pair_up(high, high_e)


@inner
def hyperbolic_sine_of(x: float) -> tuple[float, float]:
    """``sinh x = (E + E / (E + 1)) / 2`` with ``E = e^x − 1``, for ``0 ≤ x ≤ 709``."""
    s, e = expm1(x)
    if x > ONE_SIDED:
        return 0.5 * s, 0.5 * e
    t, f = add(s, e, 1.0, 0.0)
    t, f = divide(s, e, t, f)
    s, e = add(s, e, t, f)
    return 0.5 * s, 0.5 * e


@inner
def hyperbolic_sine_bounds(x: float) -> Interval:
    """Bounds on ``sinh x`` for ``|x| ≤ 709``."""
    s, e = hyperbolic_sine_of(abs(x))
    return (pair_down(s, e), pair_up(s, e)) if x >= 0.0 else (-pair_up(s, e), -pair_down(s, e))


@inner
def hyperbolic_sine(a: float, b: float) -> Interval:
    """``sinh [a, b]``, not enclosed where it may overflow."""
    if not (a <= b and a >= -MAX_EXPONENT and b <= MAX_EXPONENT):
        return math.nan, math.nan
    return hyperbolic_sine_bounds(a)[0], hyperbolic_sine_bounds(b)[1]


@inner
def hyperbolic_cosine_bounds(x: float) -> Interval:
    """Bounds on ``cosh x = (e^x + e^−x) / 2`` for ``0 ≤ x ≤ 709``."""
    if x == 0.0:
        return 1.0, 1.0
    s, e = exp(x)
    if x <= ONE_SIDED:
        t, f = divide(1.0, 0.0, s, e)
        s, e = add(s, e, t, f)
    return pair_down(0.5 * s, 0.5 * e), pair_up(0.5 * s, 0.5 * e)


@inner
def hyperbolic_cosine(a: float, b: float) -> Interval:
    """``cosh [a, b]``, not enclosed where it may overflow."""
    if not (a <= b and a >= -MAX_EXPONENT and b <= MAX_EXPONENT):
        return math.nan, math.nan
    small = 0.0 if a <= 0.0 <= b else min(abs(a), abs(b))
    return hyperbolic_cosine_bounds(small)[0], hyperbolic_cosine_bounds(max(abs(a), abs(b)))[1]


@inner
def hyperbolic_tangent_bounds(x: float) -> Interval:
    """Bounds on ``tanh x = (e^2x − 1) / (e^2x + 1)``."""
    size = abs(x)
    if size > 300.0:
        low, high = 1.0 - 2.0**-53, 1.0
    else:
        s, e = expm1(2.0 * size)
        t, f = add(s, e, 2.0, 0.0)
        s, e = divide(s, e, t, f)
        low, high = pair_down(s, e), min(1.0, pair_up(s, e))
    return (low, high) if x >= 0.0 else (-high, -low)


@inner
def hyperbolic_tangent(a: float, b: float) -> Interval:
    """``tanh [a, b]``"""
    if not a <= b:
        return math.nan, math.nan
    return hyperbolic_tangent_bounds(a)[0], hyperbolic_tangent_bounds(b)[1]
