"""The strip update of a parallelotope (Vicino, Zappa 1996), sound in floating point.

The set in hand is ``{c + T ξ + e : |ξ|∞ ≤ 1, |e| ≤ delta}``: ``delta`` (n,) carries what rounding has lost so far, so
that the parallelotope itself is made to hold it only once, after the last strip
(``kernels/parallelotopes/enclosure.py``).
"""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, down, gamma, up

EMPTY = -1
OVERFLOW = -2
"""Status of a step whose result is too large for double precision."""
UNCHANGED = 0
TIGHTENED = 1
REPLACED = 2

STRIP_ROWS = 3
"""Rows of length n that :func:`cut` needs as scratch."""

TIE = 1.0 + 1e-9
"""Strips that are equally wide are choices of equal volume: rounding, which depends on units, must not decide."""

MIN_DIVISOR = 1e-150
"""Below it an edge is never replaced: the quotients could overflow."""


@inlined
def middle(lower: float, upper: float) -> float:
    """The middle of an interval, without overflow."""
    return 0.5 * lower + 0.5 * upper


@inlined
def half_width(lower: float, upper: float, mid: float) -> float:
    """h with ``[mid − h, mid + h] ⊇ [lower, upper]``; exact for a point and for [−h, h]."""
    reach = max(upper - mid, mid - lower)
    if reach <= 0.0 or upper == -lower:
        return reach
    return up(reach)


@kernel
def project(c: Vector, T: Matrix, delta: Vector, p: Vector, g: Vector) -> tuple[float, float, float]:
    """``p'x = s + g'ξ + error``: fills g (n,) and returns ``s``, a bound of \\|error\\| and one of ``Σ |g|``."""
    n = c.size
    s, magnitude, error, spread = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        s += p[i] * c[i]
        magnitude += abs(p[i] * c[i])
        error += abs(p[i]) * delta[i]
        g[i] = 0.0
    for i in range(n):
        if p[i] != 0.0:
            for j in range(n):
                term = p[i] * T[i, j]
                g[j] += term
                magnitude += abs(term)
    for j in range(n):
        spread += abs(g[j])
    error = (error + gamma(n + 2) * magnitude) * (1.0 + gamma(n * n + n + 8)) + UNDERFLOW
    return s, error, up(spread + gamma(n) * spread)


@inner
def cut(
    c: Vector, T: Matrix, delta: Vector, p: Vector, lo: float, hi: float, takes_ties: bool, work: Matrix
) -> int:  # fmt: skip
    """Replace the set by one of the same form that holds its part in the strip ``lo ≤ p'x ≤ hi``; in place.

    Tightens the n strips of the parallelotope and the new one, and drops the widest of them, so that the volume never
    grows; where both have one width, the new one is dropped, or the old one if it ``takes_ties``. Returns ``EMPTY``
    (proved; the set is then untouched), ``UNCHANGED`` (the strip does not cut), ``TIGHTENED`` or ``REPLACED``. ``work``
    has ``STRIP_ROWS`` rows of length n. Source: Vicino & Zappa 1996.
    """
    g, mid, half = work[0], work[1], work[2]
    s, error, spread = project(c, T, delta, p, g)
    low = down(down(lo - s) - error)
    high = up(up(hi - s) + error)
    if low > spread or high < -spread:
        return EMPTY
    if (low <= -spread and high >= spread) or spread == 0.0:
        return UNCHANGED
    k, widest, tightened = _tighten(g, low, high, spread, mid, half)
    if k < 0:
        return EMPTY
    low = max(low, -spread)
    high = min(high, spread)
    takes = widest * TIE >= high - low if takes_ties else widest > (high - low) * TIE
    if takes and abs(g[k]) > MIN_DIVISOR:
        _replace_edge(c, T, delta, k, low, high, g, mid, half)
        return REPLACED
    if tightened:
        _shrink(c, T, delta, mid, half)
        return TIGHTENED
    return UNCHANGED


@inlined
def _tighten(g: Vector, low: float, high: float, spread: float, mid: Vector, half: Vector) -> tuple[int, float, bool]:
    """Own strips ``ξ_j ∈ mid_j ± half_j`` that ``low ≤ g'ξ ≤ high`` leaves; index and width of the widest; any cut?

    The index is −1 where a strip is proved empty.
    """
    k, widest, tightened = 0, -1.0, False
    for j in range(g.size):
        a, b = -1.0, 1.0
        slope = abs(g[j])
        if slope > 0.0:
            others = max(up(spread - slope), 0.0)
            least = down(down(low - others) / slope)
            most = up(up(high + others) / slope)
            if g[j] < 0.0:
                least, most = -most, -least
            a, b = max(a, least), min(b, most)
            if a > b:
                return -1, 0.0, False
            tightened = tightened or a > -1.0 or b < 1.0
        mid[j] = middle(a, b)
        half[j] = half_width(a, b, mid[j])
        if slope * (b - a) > widest * TIE:
            k, widest = j, slope * (b - a)
    return k, widest, tightened


@inlined
def _shrink(c: Vector, T: Matrix, delta: Vector, mid: Vector, half: Vector) -> None:
    """``c ← c + T mid``, ``T ← T diag(half)``; what rounding loses goes to delta."""
    n = c.size
    for i in range(n):
        centre, magnitude = c[i], abs(c[i])
        for j in range(n):
            centre += T[i, j] * mid[j]
            magnitude += abs(T[i, j]) * (abs(mid[j]) + half[j])
            T[i, j] *= half[j]
        c[i] = centre
        delta[i] = up(delta[i] + gamma(2 * n + 8) * magnitude)


@inlined
def _replace_edge(
    c: Vector, T: Matrix, delta: Vector, k: int, low: float, high: float, g: Vector, mid: Vector, half: Vector
) -> None:
    """Put the new strip in the place of strip k: ``ξ_k = (q − Σ_{j≠k} g_j ξ_j)/g_k`` with q in [low, high]."""
    n = c.size
    new_mid = middle(low, high)
    new_half = half_width(low, high, new_mid)
    for i in range(n):
        edge = T[i, k] / g[k]
        centre = c[i] + edge * new_mid
        magnitude = abs(c[i]) + abs(edge) * (abs(new_mid) + new_half)
        for j in range(n):
            if j != k:
                shear = edge * g[j]
                rest = T[i, j] - shear
                centre += rest * mid[j]
                magnitude += (abs(T[i, j]) + abs(shear)) * (abs(mid[j]) + half[j])
                T[i, j] = rest * half[j]
        c[i] = centre
        T[i, k] = edge * new_half
        delta[i] = up(delta[i] + gamma(2 * n + 8) * magnitude)


@kernel
def hull(c: Vector, T: Matrix, delta: Vector, lower: Vector, upper: Vector) -> bool:
    """Interval hull ``c ± (Σ_j |T_j| + delta)``, rounded outward; ``False`` where it overflowed."""
    n = c.size
    finite = True
    for i in range(n):
        reach = 0.0
        for j in range(T.shape[1]):
            reach += abs(T[i, j])
        if reach == 0.0 and delta[i] == 0.0:
            lower[i], upper[i] = c[i], c[i]
        else:
            reach = up(reach + gamma(T.shape[1] + 2) * reach + delta[i])
            lower[i], upper[i] = down(c[i] - reach), up(c[i] + reach)
        finite = finite and math.isfinite(lower[i]) and math.isfinite(upper[i])
    return finite
