"""sin, cos and tan to 70 bits, as sums of two doubles, for every double below 2⁶² in size.

``x = q π/2 + r`` with a whole q and ``|r| ≤ π/4``; r is relatively exact to 2⁻⁶⁵ (the double nearest to a multiple of
π/2 is some 2⁻⁶¹ away from it). Below 2²⁰ by parts of π/2 (W. J. Cody and W. Waite), above by 2/π with 256 bits (M. H.
Payne and R. N. Hanek). Then Taylor's series: leading terms with two doubles, the rest with one.
"""

from __future__ import annotations

import math

import numpy as np

from lsu_mesh.kernels.intervals.constants import (
    HALF_PI_HI,
    HALF_PI_LO,
    HALF_PI_PARTS,
    INVERSE_FACTORIALS,
    TWO_OVER_PI_LIMBS,
)
from lsu_mesh.kernels.intervals.double_double import add, multiply, quick_two_sum, two_product, two_sum
from lsu_mesh.kernels.runtime.compile import inner

QUARTER_PI = 0.7853981633974483
INVERSE_HALF_PI = 0.6366197723675814
PART_1, PART_2, PART_3, PART_4 = HALF_PI_PARTS
MAX_BY_PARTS = 1048576.0
MAX_ANGLE = 4611686018427387904.0
"""2⁶²; larger angles are not reduced."""
LIMB = 4294967296.0


@inner
def reduced(x: float) -> tuple[int, float, float]:
    """q, and r as a sum of two doubles, for ``|x| < 2⁶²``; the sign of r is exact."""
    size = abs(x)
    if size <= QUARTER_PI:
        return 0, x, 0.0
    if size >= MAX_BY_PARTS:
        return reduced_large(x)
    whole = math.floor(x * INVERSE_HALF_PI + 0.5)
    n = float(whole)
    r, _ = two_sum(x, -n * PART_1)  # exact: the two are within a factor of 2, or n is 0
    r, e = two_sum(r, -n * PART_2)
    r, f = two_sum(r, -n * PART_3)
    r, e = quick_two_sum(r, e + f)
    p, g = two_product(-n, PART_4)
    r, e = add(r, e, p, g)
    return whole, r, e


@inner
def reduced_large(x: float) -> tuple[int, float, float]:
    """As :func:`reduced`, from ``x 2/π`` with 256 bits behind the point."""
    mantissa, exponent = math.frexp(abs(x))
    m = np.uint64(math.ldexp(mantissa, 53))
    mask, shift = np.uint64(0xFFFFFFFF), np.uint64(32)
    low, high = m & mask, m >> shift
    limbs = np.zeros(10, dtype=np.uint64)
    for i in range(8):
        carry = np.uint64(0)
        for j in range(2):
            total = (low if j == 0 else high) * TWO_OVER_PI_LIMBS[i] + limbs[i + j] + carry
            limbs[i + j] = total & mask
            carry = total >> shift
        limbs[i + 2] = carry
    bits = 256 - (exponent - 53)  # bits behind the point of the product
    quotient, fraction_hi, fraction_lo = 0, 0.0, 0.0
    for i in range(9, -1, -1):
        for part in range(31, -1, -1):
            position = 32 * i + part
            bit = (limbs[i] >> np.uint64(part)) & np.uint64(1)
            if position >= bits:
                quotient = 2 * quotient + int(bit)
    is_up = ((limbs[(bits - 1) // 32] >> np.uint64((bits - 1) % 32)) & np.uint64(1)) == np.uint64(1)
    if is_up:  # round to the nearest whole number: the fraction minus 1 is minus its complement
        quotient += 1
        for i in range(10):
            limbs[i] = limbs[i] ^ mask
    taken, top = 0, bits - 2
    for position in range(bits - 2, -1, -1):
        bit = (limbs[position // 32] >> np.uint64(position % 32)) & np.uint64(1)
        if taken == 0 and bit == np.uint64(0):
            continue
        if taken == 0:
            top = position
        if bit == np.uint64(1):
            value = math.ldexp(1.0, position - bits)
            if top - position < 53:
                fraction_hi += value
            else:
                fraction_lo += value
        taken += 1
        if taken == 106:
            break
    if is_up:
        fraction_hi, fraction_lo = -fraction_hi, -fraction_lo
    r, e = multiply(fraction_hi, fraction_lo, HALF_PI_HI, HALF_PI_LO)
    return (quotient, r, e) if x > 0.0 else (-quotient, -r, -e)


@inner
def reduced_sin(r: float, r_lo: float) -> tuple[float, float]:
    """``sin(r + r_lo)`` for ``|r| ≤ π/4``."""
    z, z_lo = multiply(r, r_lo, r, r_lo)
    tail = 0.0
    for j in range(23, 7, -2):
        tail = (INVERSE_FACTORIALS[j, 0] - tail) * z
    s, e = tail, 0.0
    for j in range(7, 0, -2):
        s, e = add(INVERSE_FACTORIALS[j, 0], INVERSE_FACTORIALS[j, 1], -s, -e)
        if j > 1:
            s, e = multiply(s, e, z, z_lo)
    return multiply(s, e, r, r_lo)


@inner
def reduced_cos(r: float, r_lo: float) -> tuple[float, float]:
    """``cos(r + r_lo)`` for ``|r| ≤ π/4``."""
    z, z_lo = multiply(r, r_lo, r, r_lo)
    tail = 0.0
    for j in range(24, 8, -2):
        tail = (INVERSE_FACTORIALS[j, 0] - tail) * z
    s, e = tail, 0.0
    for j in range(8, -1, -2):
        s, e = add(INVERSE_FACTORIALS[j, 0], INVERSE_FACTORIALS[j, 1], -s, -e)
        if j > 0:
            s, e = multiply(s, e, z, z_lo)
    return s, e


@inner
def sin_of_reduced(q: int, r: float, r_lo: float) -> tuple[float, float]:
    """``sin(q π/2 + r)``"""
    s, e = reduced_sin(r, r_lo) if q % 2 == 0 else reduced_cos(r, r_lo)
    return (s, e) if q % 4 < 2 else (-s, -e)
