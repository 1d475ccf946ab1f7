"""One step of the simulated plant and one measurement, with the simulation's own rounding charged to the noise.

Plain NumPy, column by column, so that plants and sensors need no compiler: each entry is the sum over j = 0, 1, … in
this order, with the bits of a loop over the entries.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma


def bounded(A: Matrix, x: Vector, B: Matrix, u: Vector, unit: Vector, half_widths: Vector) -> Vector:
    """``A x + B u + w`` (k,) with ``w = half_widths · unit`` shrunk: within ``half_widths`` of ``A x + B u`` exactly.

    A (k, n), B (k, p), ``|unit| ≤ 1`` (k,), half_widths (k,). Where a half-width is below the rounding error (0, say)
    w is 0 and the value is the rounded one.
    """
    with np.errstate(all="ignore"):
        value, magnitude = np.zeros(half_widths.size), half_widths.copy()
        for matrix, entries in ((A, x), (B, u)):
            for j in range(entries.size):
                term = matrix[:, j] * entries[j]
                value += term
                magnitude += np.abs(term)
        room = half_widths - (2.0 * gamma(x.size + u.size + 4) * magnitude + UNDERFLOW)
        return np.where(room > 0.0, value + unit * room, value)


def mapped(A: Matrix, x: Vector, B: Matrix, u: Vector, N: Matrix, unit: Vector, half_widths: Vector) -> Vector:
    """``A x + B u + N w`` (k,) with ``w = half_widths · unit``, in floating point (nothing charged)."""
    with np.errstate(all="ignore"):
        value = np.zeros(A.shape[0])
        for matrix, entries in ((A, x), (B, u), (N, half_widths * unit)):
            for j in range(entries.size):
                value += matrix[:, j] * entries[j]
        return value
