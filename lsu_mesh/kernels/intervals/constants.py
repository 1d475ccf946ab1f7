"""Constants as sums of two doubles, from integer arithmetic: π, ln 2, arc tangents, reciprocals of factorials.

Every value is computed with 320 bits by series whose remainder is below 2⁻³⁰⁰, and split into ``hi + lo`` with an error
below 2⁻¹⁰⁶ of the value.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from lsu_mesh.array_types import Array

BITS = 320


def _arctan_of_inverse(n: int) -> int:
    """``2^BITS atan(1 / n)`` by Gregory's series, n ≥ 2."""
    power = (1 << BITS) // n
    total, k, sign = power, 1, -1
    while power:
        power //= n * n
        k += 2
        total += sign * (power // k)
        sign = -sign
    return total


def _scaled_log2() -> int:
    """``2^BITS ln 2 = 2^BITS Σ 1 / (k 2^k)``."""
    return sum((1 << (BITS - k)) // k for k in range(1, BITS))


def _scaled_atan(x: Fraction) -> int:
    """``2^BITS atan(x)`` for 0 ≤ x ≤ 1, by halving the angle exactly enough twice, then Gregory's series."""
    if x == 1:
        return PI_SCALED // 4
    value = (x.numerator << BITS) // x.denominator
    one, halvings = 1 << BITS, 3
    for _ in range(halvings):  # tan(a / 2) = t / (1 + √(1 + t²))
        root = math.isqrt((one * one) + value * value)
        value = (value << BITS) // (one + root)
    square, power = (value * value) >> BITS, value
    total, k, sign = power, 1, -1
    while power:
        power = (power * square) >> BITS
        k += 2
        total += sign * (power // k)
        sign = -sign
    return total << halvings


PI_SCALED = 4 * (4 * _arctan_of_inverse(5) - _arctan_of_inverse(239))
"""``2^BITS π`` by Machin's formula."""


def pair(value: Fraction) -> tuple[float, float]:
    """The two doubles whose sum is nearest to a value, the first being the nearest double."""
    hi = value.numerator / value.denominator
    return hi, float(value - Fraction(hi))


def parts(value: Fraction, bits: int, count: int) -> list[float]:
    """The leading parts of a value, each of at most ``bits`` bits, and what remains as one more double."""
    found: list[float] = []
    for _ in range(count):
        exponent = math.frexp(float(value))[1]
        unit = Fraction(2) ** (exponent - bits)
        part = unit * (value // unit)
        found.append(float(part))
        value -= part
    return [*found, float(value)]


def _pairs(values: list[Fraction]) -> Array:
    found = np.array([pair(value) for value in values])
    found.flags.writeable = False
    return found


_PI, _LN2 = Fraction(PI_SCALED, 1 << BITS), Fraction(_scaled_log2(), 1 << BITS)
PI_HI, PI_LO = pair(_PI)
HALF_PI_PARTS = tuple(parts(_PI / 2, 33, 3))
"""π / 2 as three parts of 33 bits and a double: a multiple of a part by a whole number below 2²⁰ is exact."""
HALF_PI_HI, HALF_PI_LO = pair(_PI / 2)
LN2_HI, LN2_LO = pair(_LN2)
LN2_PARTS = tuple(parts(_LN2, 40, 2))
"""ln 2 as two parts of 40 bits and a double: a multiple of a part by a whole number below 2¹³ is exact."""
TWO_OVER_PI_LIMBS = np.array(
    [int((Fraction(2) / _PI) * (1 << 256)) >> (32 * i) & 0xFFFFFFFF for i in range(8)], dtype=np.uint64
)
"""``⌊2²⁵⁶ 2/π⌋`` in limbs of 32 bits, the lowest first."""
TWO_OVER_PI_LIMBS.flags.writeable = False
INVERSE_FACTORIALS = _pairs([Fraction(1, math.factorial(j)) for j in range(25)])
"""(25, 2): ``1 / j!``"""
ATANS = _pairs([Fraction(_scaled_atan(Fraction(k, 8)), 1 << BITS) for k in range(9)])
"""(9, 2): ``atan(k / 8)``"""
ODD_INVERSES = _pairs([Fraction(1, 2 * k + 1) for k in range(20)])
"""(20, 2): ``1 / (2 k + 1)``"""
