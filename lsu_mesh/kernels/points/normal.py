"""The truncated normal distribution, in plain arithmetic: the same bits on every machine.

The C library's ``exp`` and ``erfc`` differ between machines in their last bits, and published points are computed
again elsewhere. Nothing here is a bound.
"""

from __future__ import annotations

import math

from lsu_mesh.kernels.runtime.compile import inner, kernel

LOG2_E = 1.4426950408889634
LN2_HIGH = 6.93147180369123816490e-01
LN2_LOW = 1.90821492927058770002e-10
"""``ln 2`` in two parts: the first times a whole number up to 2^20 is exact."""
SQRT_HALF_PI = 1.2533141373155003
SQRT_HALF = 0.7071067811865476
INVERSE_SQRT_2PI = 0.3989422804014327
NARROW = 1e-4
"""An interval narrower than this is one of a uniform density: the formula would lose all digits."""
MIDDLE = 3.75
CHEBYSHEV = (
    1.177578934567402,
    -0.004590054580646541,
    -0.08424913336651792,
    0.05920993999819203,
    -0.026658668435306145,
    0.009074997670705813,
    -0.0024131635404180244,
    0.0004907758365261957,
    -6.916973302544866e-05,
    4.139027986793664e-06,
    7.740383054914576e-07,
    -2.1886400966311922e-07,
    1.076500004289342e-08,
    4.52196003874018e-09,
    -7.754394803039976e-10,
    -6.318182340950526e-11,
    2.8688541441436076e-11,
    1.9351691966045853e-13,
    -9.641984180771859e-13,
    3.319566843629218e-14,
    3.4285705587742334e-14,
    -1.5757597247236597e-15,
)
"""Series of ``(1 + 2 x) erfcx(x)`` in ``(x − 3.75)/(x + 3.75)``, x ≥ 0, to 1e-14; interpolated at Chebyshev's nodes.

The substitution is that of Shepherd & Laframboise 1981.
"""


@inner
def exponential(x: float) -> float:
    """``exp(x)`` for x ≤ 0, to a unit in the last place or two."""
    if x < -745.0:
        return 0.0
    k = math.floor(x * LOG2_E + 0.5)
    r = (x - k * LN2_HIGH) - k * LN2_LOW
    total = 1.0
    for i in range(14, 0, -1):
        total = 1.0 + total * r / i
    return math.ldexp(total, int(k))


@kernel
def scaled_tail(x: float) -> float:
    """``exp(x²/2) erfc(x/√2)`` for x ≥ 0."""
    z = x * SQRT_HALF
    t = (z - MIDDLE) / (z + MIDDLE)
    later, latest = 0.0, 0.0
    for k in range(len(CHEBYSHEV) - 1, 0, -1):
        latest, later = CHEBYSHEV[k] + 2.0 * t * latest - later, latest
    return (CHEBYSHEV[0] + t * latest - later) / (1.0 + 2.0 * z)


@kernel
def truncated_normal(c: float, d: float) -> tuple[float, float]:
    """Mean and variance of N(0, 1) truncated at [c, d], c ≤ d finite, also far out in a tail.

    ``μ = (φ(c) − φ(d)) / (Φ(d) − Φ(c))``, ``v = 1 + (c φ(c) − d φ(d)) / (Φ(d) − Φ(c)) − μ²`` (Simon & Simon 2010).
    """
    is_mirrored = c + d < 0.0
    if is_mirrored:
        c, d = -d, -c
    width = d - c
    if width < NARROW / max(1.0, abs(c)):
        mean, variance = 0.5 * c + 0.5 * d, width * width / 12.0
    else:
        if c <= 0.0:
            below, above = exponential(-0.5 * c * c), exponential(-0.5 * d * d)
            mass = 1.0 - 0.5 * (below * scaled_tail(-c) + above * scaled_tail(d))
            low, high = below * INVERSE_SQRT_2PI / mass, above * INVERSE_SQRT_2PI / mass
        else:  # in units of the density at c, which may be too small for a number
            decay = exponential(-0.5 * width * (c + d))
            mass = SQRT_HALF_PI * (scaled_tail(c) - (decay * scaled_tail(d) if decay > 0.0 else 0.0))
            low, high = 1.0 / mass, decay / mass
        mean = min(max(low - high, c), d)
        variance = 1.0 + (c * low - (d * high if high > 0.0 else 0.0)) - mean * mean
        variance = min(max(variance, 0.0), 1.0)
    return (-mean if is_mirrored else mean), variance
