"""The steps of LSUO: a box through the time update, the strips and the interval hull, rounded outward."""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.parallelotopes.strip_update import (
    EMPTY,
    OVERFLOW,
    STRIP_ROWS,
    TIGHTENED,
    UNCHANGED,
    cut,
    half_width,
    hull,
    middle,
)
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, down, gamma, size_of_product, up
from lsu_mesh.kernels.runtime.scratch import BODY, BOX, DELTA, STRIP, Scratch, row, square
from lsu_mesh.kernels.runtime.unowned_views import block


@inlined
def predict(
    lower: Vector, upper: Vector, A: Matrix, B: Matrix, u: Vector, G: Matrix, widths: Vector,
    new_lower: Vector, new_upper: Vector, work: Scratch,
) -> int:  # fmt: skip
    """Time update ``c⁺ = A c + B u``, ``q⁺ = |A| q + |G| widths`` (Pavelková & Jirsa 2018, eq. 9).

    lower, upper (n,), A (n, n), B (n, p), u (p,), G (n, k) and widths (k,): noise map and, for an unknown input, B.
    Returns 0 or ``OVERFLOW``.
    """
    n, p, k = lower.size, u.size, widths.size
    c, q = row(work, n, BOX), row(work, n, BOX + 1)
    for j in range(n):
        c[j] = middle(lower[j], upper[j])
        q[j] = half_width(lower[j], upper[j], c[j])
    finite = True
    for i in range(n):
        centre, magnitude, reach = 0.0, 0.0, 0.0
        for j in range(n):
            centre += A[i, j] * c[j]
            magnitude += size_of_product(A[i, j], c[j])
            reach += size_of_product(A[i, j], q[j])
        for j in range(p):
            centre += B[i, j] * u[j]
            magnitude += size_of_product(B[i, j], u[j])
        for j in range(k):
            reach += size_of_product(G[i, j], widths[j])
        reach += gamma(n + p + 2) * magnitude
        reach += gamma(2 * n + p + k + 8) * reach
        if reach == 0.0:
            new_lower[i], new_upper[i] = centre, centre
        else:
            reach += UNDERFLOW
            new_lower[i], new_upper[i] = down(centre - reach), up(centre + reach)
        finite = finite and math.isfinite(new_lower[i]) and math.isfinite(new_upper[i])
    return 0 if finite else OVERFLOW


@kernel
def keep_constants(
    lower: Vector, upper: Vector, A: Matrix, B: Matrix, u: Vector, G: Matrix, widths: Vector,
    new_lower: Vector, new_upper: Vector,
) -> None:  # fmt: skip
    """The bounds of each coordinate that a time update leaves as it is, bit by bit: rounding never widens a constant.

    As :func:`predict`; ``x_i⁺ = x_i`` where row i of A is that of the identity and nothing drives it.
    """
    n = lower.size
    for i in range(n):
        constant = A[i, i] == 1.0
        for j in range(n):
            constant = constant and (j == i or A[i, j] == 0.0)
        for j in range(u.size):
            constant = constant and (B[i, j] == 0.0 or u[j] == 0.0)
        for j in range(widths.size):
            constant = constant and (G[i, j] == 0.0 or widths[j] == 0.0)
        if constant:
            new_lower[i], new_upper[i] = max(lower[i], new_lower[i]), min(upper[i], new_upper[i])


@inlined
def update(
    lower: Vector, upper: Vector, C: Matrix, y: Vector, r: Vector, meet: bool, takes_ties: bool,
    new_lower: Vector, new_upper: Vector, work: Scratch,
) -> int:  # fmt: skip
    """Data update: the strips ``|y − C x| ≤ r`` cut the box as a parallelotope; interval hull; meet with the box.

    C (m, n), y (m,) with NaN for a missing entry, r (m,). Without ``meet`` the hull may exceed the prior (Pavelková &
    Jirsa 2018, eqs. 11–13). ``takes_ties``: as in :func:`cut`. Returns 0, ``OVERFLOW``, or k + 1 where the strip of
    row k is proved to miss the set.
    """
    n = lower.size
    c, delta, T = row(work, n, BOX), row(work, n, DELTA), square(work, n, BODY)
    strips = block(work, STRIP * n, STRIP_ROWS, n)
    for i in range(n):
        new_lower[i], new_upper[i] = lower[i], upper[i]
        delta[i] = 0.0
        c[i] = middle(lower[i], upper[i])
        for j in range(n):
            T[i, j] = 0.0
        T[i, i] = half_width(lower[i], upper[i], c[i])
    touched, last = False, 0
    for k in range(y.size):
        if not math.isnan(y[k]):
            status = cut(c, T, delta, C[k], down(y[k] - r[k]), up(y[k] + r[k]), takes_ties, strips)
            if status == EMPTY:
                return k + 1
            touched = touched or status != UNCHANGED
            last = k + 1
    if not touched:
        return 0
    hull_lower, hull_upper = row(work, n, BOX + 1), row(work, n, BOX + 2)
    if not hull(c, T, delta, hull_lower, hull_upper):
        return 0 if meet else OVERFLOW
    for i in range(n):
        new_lower[i] = max(lower[i], hull_lower[i]) if meet else hull_lower[i]
        new_upper[i] = min(upper[i], hull_upper[i]) if meet else hull_upper[i]
        if new_lower[i] > new_upper[i]:
            return last
    return 0


@inner
def tighten(lower: Vector, upper: Vector, p: Vector, lo: float, hi: float) -> int:
    """Exact interval hull of the box and the strip ``lo ≤ p'x ≤ hi``, rounded outward, in place.

    Returns ``EMPTY`` (proved; the box may be spoilt), ``UNCHANGED`` or ``TIGHTENED``.
    """
    n = lower.size
    least, most, magnitude = 0.0, 0.0, 0.0
    for j in range(n):
        low, high = p[j] * lower[j], p[j] * upper[j]
        least += min(low, high)
        most += max(low, high)
        magnitude += max(abs(low), abs(high))
    error = gamma(n + 2) * magnitude
    error += gamma(n + 4) * error + UNDERFLOW
    least, most = down(least - error), up(most + error)
    if least > hi or most < lo:
        return EMPTY
    if least >= lo and most <= hi:
        return UNCHANGED
    status = UNCHANGED
    for j in range(n):
        if p[j] != 0.0:
            low, high = p[j] * lower[j], p[j] * upper[j]
            # what the other coordinates add, at least and at most
            others_least = down(down(least - min(low, high)) - error)
            others_most = up(up(most - max(low, high)) + error)
            first, second = down(lo - others_most) / p[j], up(hi - others_least) / p[j]
            new_lower, new_upper = down(min(first, second)), up(max(first, second))
            if new_lower > upper[j] or new_upper < lower[j]:
                return EMPTY
            if new_lower > lower[j]:
                lower[j] = new_lower
                status = TIGHTENED
            if new_upper < upper[j]:
                upper[j] = new_upper
                status = TIGHTENED
    return status


@inner
def volume(lower: Vector, upper: Vector) -> float:
    """``Π (upper − lower)``."""
    product = 1.0
    for i in range(lower.size):
        product *= upper[i] - lower[i]
    return product


@inner
def predict_output(
    lower: Vector, upper: Vector, C: Matrix, r: Vector, y_lower: Vector, y_upper: Vector, y_point: Vector
) -> None:
    """Output interval ``C c ± (r + |C| q)``, rounded outward (Lainová et al. 2019, eqs. 27–31)."""
    n = lower.size
    for k in range(C.shape[0]):
        centre, magnitude, reach = 0.0, 0.0, r[k]
        for j in range(n):
            mid = middle(lower[j], upper[j])
            term = C[k, j] * mid
            centre += term
            magnitude += abs(term)
            reach += abs(C[k, j]) * half_width(lower[j], upper[j], mid)
        reach += gamma(n + 2) * magnitude
        reach += gamma(2 * n + 8) * reach + UNDERFLOW
        y_lower[k], y_upper[k], y_point[k] = down(centre - reach), up(centre + reach), centre
