"""Matrices of which a middle and a radius are known: ``|M − middle| ≤ radius``, entry by entry."""

from __future__ import annotations

from lsu_mesh.array_types import Matrix
from lsu_mesh.kernels.runtime.compile import inlined, inner
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, UNIT_ROUNDOFF, gamma


@inner
def product(A: Matrix, A_radius: Matrix, B: Matrix, B_radius: Matrix, C: Matrix, C_radius: Matrix) -> None:
    """``C ± C_radius ⊇ (A ± A_radius)(B ± B_radius)``; A (k, n), B (n, p); C may be neither A nor B.

    An entry whose terms are all zero stays an exact zero, and one single term times 1 is exact.
    """
    n = A.shape[1]
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            middle, mass, whole, spread, terms = 0.0, 0.0, 0.0, 0.0, 0
            for s in range(n):
                a, b = abs(A[i, s]), abs(B[s, j])
                if (a == 0.0 and A_radius[i, s] == 0.0) or (b == 0.0 and B_radius[s, j] == 0.0):
                    continue
                terms += 1
                middle += A[i, s] * B[s, j]
                mass += 0.0 if a == 1.0 or b == 1.0 else a * b
                whole += a * b
                spread += a * B_radius[s, j] + A_radius[i, s] * (b + B_radius[s, j])
            C[i, j] = middle
            lost = spread + gamma(n + 1) * (mass if terms == 1 else whole)
            C_radius[i, j] = 0.0 if lost == 0.0 else outward(lost, n)


@inlined
def assign(A: Matrix, A_radius: Matrix, B: Matrix, B_radius: Matrix) -> None:
    """``A ← B``"""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            A[i, j], A_radius[i, j] = B[i, j], B_radius[i, j]


@inlined
def outward(x: float, terms: int) -> float:
    """At least the exact value of a sum of so many products ≥ 0 that was computed as x."""
    return x * (1.0 + gamma(2 * terms + 8)) + UNDERFLOW


@inner
def scale(A: Matrix, A_radius: Matrix, factor: float, units: float) -> None:
    """``A ← factor A`` in place, where the exact factor differs from ``factor`` by at most ``units`` · 2⁻⁵³ of it."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            if A[i, j] != 0.0 or A_radius[i, j] != 0.0:
                A[i, j] *= factor
                lost = (units + 2.0) * UNIT_ROUNDOFF * abs(A[i, j])
                A_radius[i, j] = outward(A_radius[i, j] * abs(factor) * (1.0 + units * UNIT_ROUNDOFF) + lost, 1)


@inner
def add(A: Matrix, A_radius: Matrix, B: Matrix, B_radius: Matrix) -> None:
    """``A ← A + B`` in place."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            if B[i, j] != 0.0 or B_radius[i, j] != 0.0:
                total = A[i, j] + B[i, j]
                exact = A[i, j] == 0.0 and A_radius[i, j] == 0.0
                lost = 0.0 if exact else 2.0 * UNIT_ROUNDOFF * abs(total)
                A_radius[i, j] = outward(A_radius[i, j] + B_radius[i, j] + lost, 2)
                A[i, j] = total


@inner
def add_identity(A: Matrix, A_radius: Matrix) -> None:
    """``A ← A + I`` in place; exact where the diagonal was an exact zero."""
    for i in range(A.shape[0]):
        if A[i, i] == 0.0 and A_radius[i, i] == 0.0:
            A[i, i] = 1.0
        else:
            A[i, i] += 1.0
            A_radius[i, i] = outward(A_radius[i, i] + 2.0 * UNIT_ROUNDOFF * abs(A[i, i]), 2)


@inner
def row_norm(A: Matrix) -> float:
    """``‖A‖∞``, rounded up."""
    largest = 0.0
    for i in range(A.shape[0]):
        total = 0.0
        for j in range(A.shape[1]):
            total += abs(A[i, j])
        largest = max(largest, total)
    return 0.0 if largest == 0.0 else outward(largest, A.shape[1])
