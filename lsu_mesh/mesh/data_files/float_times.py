"""Times held as binary floating-point numbers: the nearest nanosecond, and half the spacing of such numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Integers, Vector

_SPLITTER = 134217729.0
"""2²⁷ + 1: splits a double into two of 26 bits (Dekker 1971)."""


def float_ns(values: Vector, unit_ns: int) -> Integers:
    """``values · unit_ns`` rounded to whole ns, halves to the even one, exactly; finite values below 2⁶² ns."""
    whole = np.floor(values)
    part = values - whole  # exact
    product = part * unit_ns
    error = _product_error(part, float(unit_ns), product)
    nearest = np.rint(product)
    distance = product - nearest
    # The product alone is rounded: at what looks like a half, the error says to which side the true one lies.
    nearest = np.where((distance == 0.5) & (error > 0), nearest + 1, nearest)
    nearest = np.where((distance == -0.5) & (error < 0), nearest - 1, nearest)
    odd = ((whole.astype(np.int64) * unit_ns) & 1).astype(bool)
    is_half = (np.abs(distance) == 0.5) & (error == 0)
    nearest = np.where(is_half & odd, nearest + np.where(distance > 0, 1, -1), nearest)
    return whole.astype(np.int64) * unit_ns + nearest.astype(np.int64)


def _product_error(a: Vector, b: float, product: Vector) -> Vector:
    """``a b − product``, exactly."""
    c = _SPLITTER * a
    high = c - (c - a)
    low = a - high
    d = _SPLITTER * b
    b_high = d - (d - b)
    b_low = b - b_high
    error: Vector = ((high * b_high - product) + high * b_low + low * b_high) + low * b_low
    return error


def half_spacing_ns(values: NDArray[np.floating], unit_ns: int) -> Integers:
    """Whole ns within half the spacing of the numbers, around :func:`float_ns`: 119 for today's seconds in float64.

    A moment t (whole ns) whose nearest float is the given one lies no further from the rounded time.
    """
    half = np.spacing(np.abs(values)).astype(np.float64) * 0.5 * unit_ns
    whole: Integers = np.floor(half + 0.5).astype(np.int64)
    return whole
