"""Scaling by powers of two, which is exact and makes results independent of units."""

from __future__ import annotations

from lsu_mesh.kernels.runtime.compile import inlined


@inlined
def unit_factor(x: float) -> float:
    """The power of two that brings x > 0 into [½, 1); 1 where x is 0, not finite, or extreme."""
    factor = 1.0
    if 2.0**-900 < x < 2.0**900:
        while x * factor >= 1.0:
            factor *= 0.5
        while x * factor < 0.5:
            factor *= 2.0
    return factor
