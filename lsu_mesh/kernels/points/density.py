"""A Kalman recursion (m, P) beside a set, and the mean of N(m, P) truncated at the set's hull.

Nothing of it ever enters a set: it only tells where in the set the state probably lies. Explicit loops in a fixed
order, so that single steps, compiled runs and a later verification give the same bits.
"""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.points.normal import truncated_normal
from lsu_mesh.kernels.points.room import COVARIANCE, FACTOR, SPREAD, Room, row_of, square_of
from lsu_mesh.kernels.runtime.compile import inlined, kernel

MAX_VARIANCE = 1e300


@kernel
def start(lower: Vector, upper: Vector, mean: Vector, P: Matrix) -> None:
    """Mean (n,) and covariance (n, n) of the uniform distribution on the box [lower, upper] (n,)."""
    n = mean.size
    for i in range(n):
        mean[i] = 0.5 * lower[i] + 0.5 * upper[i]
        half = 0.5 * upper[i] - 0.5 * lower[i]
        for j in range(n):
            P[i, j] = 0.0
        P[i, i] = min(half * half / 3.0, MAX_VARIANCE)


@kernel
def update(mean: Vector, P: Matrix, C: Matrix, y: Vector, widths: Vector, r: Vector, work: Room) -> None:
    """In place, by the outputs y (m,) one after the other, NaN where there is none; C (m, n).

    ``m ← m + P c (y − c'm)/s``, ``P ← P − P c c'P/s``, ``s = c'P c + variance``. The noise has the variance
    ``(r² + (widths − r)²)/3`` where the strip is wider than r (m,): what widens it is an error of its own. Else it is
    ``widths²/3``.
    """
    n = mean.size
    spread = row_of(work, n, SPREAD)
    for k in range(y.size):
        if math.isnan(y[k]):
            continue
        own = min(r[k], widths[k])
        more = widths[k] - own
        total, error = (own * own + more * more) / 3.0, y[k]
        for i in range(n):
            spread[i] = 0.0
            for j in range(n):
                spread[i] += P[i, j] * C[k, j]
            total += C[k, i] * spread[i]
            error -= C[k, i] * mean[i]
        if not total > 0.0:
            continue
        for i in range(n):
            gain = spread[i] / total
            mean[i] += gain * error
            for j in range(n):
                P[i, j] -= gain * spread[j]
        _make_symmetric(P)


@kernel
def predict(
    mean: Vector, P: Matrix, A: Matrix, B: Matrix, u: Vector, Q: Matrix, G: Matrix, widths: Vector, first: int,
    work: Room,
) -> None:  # fmt: skip
    """In place: ``m ← A m + B u``, ``P ← A P A' + Q + Σ_j G_j G_j' widths_j²/3`` over the columns j ≥ first of G."""
    n = mean.size
    moved, AP = row_of(work, n, SPREAD), square_of(work, n, FACTOR)
    for i in range(n):
        moved[i] = 0.0
        for j in range(n):
            moved[i] += A[i, j] * mean[j]
            AP[i, j] = 0.0
            for k in range(n):
                AP[i, j] += A[i, k] * P[k, j]
        for j in range(u.size):
            moved[i] += B[i, j] * u[j]
    for i in range(n):
        mean[i] = moved[i]
        for j in range(n):
            P[i, j] = Q[i, j]
            for k in range(n):
                P[i, j] += AP[i, k] * A[j, k]
    for k in range(first, widths.size):
        if widths[k] > 0.0:
            for i in range(n):
                for j in range(n):
                    P[i, j] += (G[i, k] * widths[k]) * (G[j, k] * widths[k]) / 3.0
    _make_symmetric(P)


@kernel
def noise_covariance(G: Matrix, widths: Vector, Q: Matrix) -> None:
    """``Q ← G diag(widths²/3) G'``; G (n, q), widths (q,)."""
    for i in range(Q.shape[0]):
        for j in range(Q.shape[0]):
            Q[i, j] = 0.0
            for k in range(widths.size):
                Q[i, j] += (G[i, k] * widths[k]) * (G[j, k] * widths[k]) / 3.0


@kernel
def is_finite(mean: Vector, P: Matrix) -> bool:
    """Whether no number of the density has outgrown double precision."""
    total = 0.0
    for i in range(mean.size):
        total += 0.0 * mean[i]
        for j in range(mean.size):
            total += 0.0 * P[i, j]
    return not math.isnan(total)


@kernel
def truncated_mean(mean: Vector, P: Matrix, lower: Vector, upper: Vector, point: Vector, work: Room) -> None:
    """``point`` (n,) ← mean of N(m, P) truncated at the box [lower, upper], coordinate after coordinate.

    With s² = P_ii, p = P e_i / s and the mean μ and variance v of the truncated standard normal: ``m ← m + μ p``,
    ``P ← P − (1 − v) p p'``. A coordinate without variance is moved into the box, and at the end all are. Source:
    Simon & Simon 2010, the rotation written out.
    """
    n = mean.size
    V, p = square_of(work, n, COVARIANCE), row_of(work, n, SPREAD)
    for i in range(n):
        point[i] = mean[i]
        for j in range(n):
            V[i, j] = P[i, j]
    for i in range(n):
        s = math.sqrt(V[i, i]) if V[i, i] > 0.0 else 0.0
        c, d = (lower[i] - point[i]) / s, (upper[i] - point[i]) / s
        if not (s > 0.0 and math.isfinite(c) and math.isfinite(d)):
            point[i] = min(max(point[i], lower[i]), upper[i])
            continue
        mu, variance = truncated_normal(c, d)
        for j in range(n):
            p[j] = V[j, i] / s
            point[j] += mu * p[j]
        for j in range(n):
            for k in range(n):
                V[j, k] -= (1.0 - variance) * p[j] * p[k]
    for i in range(n):
        middle = 0.5 * lower[i] + 0.5 * upper[i]
        point[i] = min(max(point[i], lower[i]), upper[i]) if math.isfinite(point[i]) else middle


@inlined
def _make_symmetric(P: Matrix) -> None:
    """Rounding must not make it asymmetric, nor a variance negative."""
    for i in range(P.shape[0]):
        P[i, i] = max(P[i, i], 0.0)
        for j in range(i):
            P[i, j] = 0.5 * P[i, j] + 0.5 * P[j, i]
            P[j, i] = P[i, j]
