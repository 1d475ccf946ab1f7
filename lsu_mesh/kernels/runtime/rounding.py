"""Outward rounding: bounds on what floating-point arithmetic can have lost.

Notation of Higham, *Accuracy and Stability of Numerical Algorithms*, §3: ``u = 2⁻⁵³``, ``γ_k = k u / (1 − k u)``; a sum
of k products computed in any order differs from the exact one by at most ``γ_k Σ |a_i b_i|`` plus underflow.
"""

from __future__ import annotations

from lsu_mesh.kernels.runtime.compile import inlined

UNIT_ROUNDOFF = 2.0**-53
EPSILON = 2.0**-52
UNDERFLOW = 2.0**-1000
"""Stands for everything that gradual underflow can lose in a few hundred operations."""


@inlined
def up(x: float) -> float:
    """A double that is strictly larger than x, at most two units in the last place away (or ``UNDERFLOW``)."""
    return x + (abs(x) * EPSILON + UNDERFLOW)


@inlined
def down(x: float) -> float:
    """A double that is strictly smaller than x, at most two units in the last place away (or ``UNDERFLOW``)."""
    return x - (abs(x) * EPSILON + UNDERFLOW)


@inlined
def size_of_product(a: float, b: float) -> float:
    """``|a b|``, and ``UNDERFLOW`` where that is rounded to 0 and no factor is 0: only a true zero has no error."""
    size = abs(a * b)
    if size == 0.0 and a != 0.0 and b != 0.0:
        return UNDERFLOW
    return size


@inlined
def gamma(k: int) -> float:
    """``γ_k`` rounded up (with one operation to spare for the multiplication by it)."""
    return (k + 2) * UNIT_ROUNDOFF / (1.0 - (k + 2) * UNIT_ROUNDOFF)
