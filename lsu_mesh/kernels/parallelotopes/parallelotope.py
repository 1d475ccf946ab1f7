"""The steps of LSUP: a parallelotope through the strips and the time update, rounded outward."""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.parallelotopes.edge_selection import choose
from lsu_mesh.kernels.parallelotopes.enclosure import MAX_RESIDUAL, enclose, inflate, residual_row
from lsu_mesh.kernels.parallelotopes.strip_update import EMPTY, OVERFLOW, STRIP_ROWS, UNCHANGED, cut
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel
from lsu_mesh.kernels.runtime.linear_algebra import invert
from lsu_mesh.kernels.runtime.rounding import down, gamma, size_of_product, up
from lsu_mesh.kernels.runtime.scratch import BUNDLE, DELTA, STRIP, Scratch, candidates_of, row, weights_of
from lsu_mesh.kernels.runtime.unowned_views import block

IMAGE = 0
CGZ = 1
EDGES = 2
STRIPS = 3
"""Time updates of LSUP."""


@inlined
def predict(
    c: Vector, T: Matrix, A: Matrix, B: Matrix, u: Vector, G: Matrix, widths: Vector, time_update: int,
    new_c: Vector, new_T: Matrix, work: Scratch,
) -> int:  # fmt: skip
    """Time update: a parallelotope around the zonotope ``A P + B u ⊕ G diag(widths)[−1,1]^q``.

    c (n,), T (n, n), A (n, n), B (n, p), u (p,), G (n, q), widths (q,). ``IMAGE``: edges along A T (Lainová et al.
    2019, eq. 36); ``CGZ``: greedy swaps of edges (Chisci, Garulli & Zappa 1996); ``EDGES``: the best n of all edges;
    ``STRIPS``: the image; the caller then offers the faces of the box that circumscribes the zonotope, left in rows
    ``BUNDLE`` and ``BUNDLE + 1`` of the scratch vectors. Returns 0 or ``OVERFLOW``.
    """
    delta = row(work, c.size, DELTA)
    image(c, T, A, B, u, new_c, new_T, delta)
    zonotope_hull(new_c, new_T, G, widths, delta, row(work, c.size, BUNDLE), row(work, c.size, BUNDLE + 1))
    columns, weights = G, widths
    if time_update in (CGZ, EDGES):
        choose(new_T, G, widths, delta, time_update == EDGES, work)
        columns, weights = candidates_of(work, c.size, widths.size), weights_of(work, c.size, widths.size)
    return 0 if enclose(new_T, columns, weights, delta, work) else OVERFLOW


@inlined
def zonotope_hull(c: Vector, T: Matrix, G: Matrix, widths: Vector, delta: Vector, lower: Vector, upper: Vector) -> None:
    """Interval hull ``c ± (Σ_j |T_j| + |G| widths + delta)``, rounded outward."""
    n, q = c.size, widths.size
    for i in range(n):
        reach = delta[i]
        for j in range(n):
            reach += abs(T[i, j])
        for j in range(q):
            reach += size_of_product(G[i, j], widths[j])
        reach = inflate(reach, n + q + 4)
        lower[i], upper[i] = down(c[i] - reach), up(c[i] + reach)


@inlined
def image(c: Vector, T: Matrix, A: Matrix, B: Matrix, u: Vector, new_c: Vector, new_T: Matrix, delta: Vector) -> None:
    """``new_c ≈ A c + B u``, ``new_T ≈ A T``; ``delta`` (n,) bounds what rounding has lost in both together."""
    n, p = c.size, u.size
    for i in range(n):
        centre, magnitude = 0.0, 0.0
        for k in range(n):
            centre += A[i, k] * c[k]
            magnitude += size_of_product(A[i, k], c[k])
        for k in range(p):
            centre += B[i, k] * u[k]
            magnitude += size_of_product(B[i, k], u[k])
        for j in range(n):
            new_T[i, j] = 0.0
        for k in range(n):
            if A[i, k] != 0.0:
                for j in range(n):
                    new_T[i, j] += A[i, k] * T[k, j]
                    magnitude += size_of_product(A[i, k], T[k, j])
        new_c[i] = centre
        delta[i] = inflate(gamma(n + p + 2) * magnitude, n * n + n + p + 4)


@inner
def cut_all(
    c: Vector, T: Matrix, P: Matrix, first: Vector, second: Vector, interval: bool, takes_ties: bool, work: Scratch
) -> int:  # fmt: skip
    """Cut by strips in the order of the rows of P (m, n), in place (the set is spoilt where the status is not 0).

    The strips are ``first ≤ P x ≤ second`` where ``interval``, else ``|first − P x| ≤ second``; NaN is no strip.
    Returns 0, ``OVERFLOW``, or k + 1 where the strip of row k is proved to miss the set. Source: Lainová et al. 2019,
    eq. (33).
    """
    delta = row(work, c.size, DELTA)
    strips = block(work, STRIP * c.size, STRIP_ROWS, c.size)
    touched = False
    for i in range(c.size):
        delta[i] = 0.0
    for k in range(first.size):
        if not math.isnan(first[k]):
            low = first[k] if interval else down(first[k] - second[k])
            high = second[k] if interval else up(first[k] + second[k])
            status = cut(c, T, delta, P[k], low, high, takes_ties, strips)
            if status == EMPTY:
                return k + 1
            touched = touched or status != UNCHANGED
    if touched and not enclose(T, T, delta[0:0], delta, work):
        return OVERFLOW
    return 0


@kernel
def faces(c: Vector, T: Matrix, P: Matrix, y: Vector, r: Vector, factor: Matrix) -> bool:
    """Strips ``|y − P x| ≤ r`` around the set, ``P ≈ T⁻¹``; ``False`` where T is numerically singular."""
    n = c.size
    if not invert(T, P, factor):
        return False
    for i in range(n):
        residual = residual_row(P, T, i)
        if not residual <= MAX_RESIDUAL:
            return False
        s, magnitude = 0.0, 0.0
        for k in range(n):
            term = P[i, k] * c[k]
            s += term
            magnitude += abs(term)
        y[i] = s
        r[i] = up(up(1.0 + residual) + inflate(gamma(n) * magnitude, n + 4))
    return True


@inner
def predict_output(c: Vector, T: Matrix, C: Matrix, r: Vector, lower: Vector, upper: Vector, point: Vector) -> None:
    """Output interval ``C c ± (r + Σ_i |C T_i|)``, rounded outward (Lainová et al. 2019, eqs. 43–45, errata)."""
    n = c.size
    for k in range(C.shape[0]):
        s, magnitude, reach = 0.0, 0.0, 0.0
        for i in range(n):
            s += C[k, i] * c[i]
            magnitude += size_of_product(C[k, i], c[i])
        for j in range(n):
            entry = 0.0
            for i in range(n):
                entry += C[k, i] * T[i, j]
                magnitude += size_of_product(C[k, i], T[i, j])
            reach += abs(entry)
        reach += r[k]
        reach = inflate(reach + gamma(n + 2) * magnitude, n * n + 2 * n + 8)
        lower[k], upper[k], point[k] = down(s - reach), up(s + reach), s
