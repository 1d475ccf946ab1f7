"""One step of the simulated plant and one measurement, with the simulation's own rounding charged to the noise."""

from __future__ import annotations

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.compile import kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma


@kernel
def bounded(A: Matrix, x: Vector, B: Matrix, u: Vector, unit: Vector, half_widths: Vector, out: Vector) -> None:
    """``out = A x + B u + w`` with ``w = half_widths · unit`` shrunk: abs(out − A x − B u) ≤ half_widths exactly.

    A (k, n), B (k, p), ``|unit| ≤ 1`` (k,), half_widths (k,). Where a half-width is below the rounding error (0, say)
    w is 0 and out is the rounded value.
    """
    n, p = x.size, u.size
    for i in range(out.size):
        value, magnitude = 0.0, half_widths[i]
        for j in range(n):
            term = A[i, j] * x[j]
            value += term
            magnitude += abs(term)
        for j in range(p):
            term = B[i, j] * u[j]
            value += term
            magnitude += abs(term)
        room = half_widths[i] - (2.0 * gamma(n + p + 4) * magnitude + UNDERFLOW)
        if room > 0.0:
            value += unit[i] * room
        out[i] = value


@kernel
def mapped(
    A: Matrix, x: Vector, B: Matrix, u: Vector, N: Matrix, unit: Vector, half_widths: Vector, out: Vector
) -> None:
    """``out = A x + B u + N w`` with ``w = half_widths · unit``, in floating point (nothing charged)."""
    for i in range(out.size):
        value = 0.0
        for j in range(x.size):
            value += A[i, j] * x[j]
        for j in range(u.size):
            value += B[i, j] * u[j]
        for j in range(unit.size):
            value += N[i, j] * (half_widths[j] * unit[j])
        out[i] = value
