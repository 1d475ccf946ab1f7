"""A parallelotope that surely holds a zonotope: verified enclosure, time update by the image, data update by strips.

A parallelotope has no generator to spare for what rounding loses. The sum ``T ξ ⊕ G diag(widths) η ⊕ box(delta)`` is enclosed
along the edges T: with ``M ≈ T⁻¹`` and ``R ≥ |I − M T|`` every ``z = T⁻¹ e`` fulfils ``|z| ≤ |M e| + R |z|``, so that
``|z|_i ≤ b_i + ρ_i max(b)/(1 − max(ρ))`` with ``b ≥ |M e|`` and the row sums ρ of R; edge i grows by the factor ``1 + |z|_i``.
Where T is numerically singular the edges become an orthogonal basis along the longest columns, verified in the same way.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.compile import kernel
from lsu_mesh.kernels.linear_algebra import invert, orthogonal_basis
from lsu_mesh.kernels.rounding import UNDERFLOW, UNIT_ROUNDOFF, down, gamma, up
from lsu_mesh.kernels.strip import EMPTY, UNCHANGED, cut

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]

OVERFLOW = -2
"""Status of a step whose result is too large for double precision."""

LARGEST_RESIDUAL = 0.25
"""An approximate inverse with a larger ‖I − M T‖∞ is not used."""


@kernel
def scratch(n: int, columns: int) -> Matrix:
    """Scratch for the functions below, n states and as many noise columns."""
    return np.zeros((3 * n + 8, n + columns))


@kernel
def enclose(T: Matrix, G: Matrix, widths: Vector, delta: Vector, work: Matrix) -> bool:
    """``T ← T'`` with ``T'[−1,1]ⁿ ⊇ T[−1,1]ⁿ ⊕ G diag(widths)[−1,1]^q ⊕ box(delta)``, in place.

    T (n, n), G (n, q), widths (q,), delta (n,). ``False`` where the result is not finite.
    """
    return enclose_along_edges(T, G, widths, delta, work) or enclose_orthogonally(T, G, widths, delta, work)


@kernel
def enclose_along_edges(T: Matrix, G: Matrix, widths: Vector, delta: Vector, work: Matrix) -> bool:
    """As :func:`enclose`, edges keep their directions; ``False``, T untouched, where T is numerically singular."""
    n = T.shape[0]
    inverse, factor = work[0:n, 0:n], work[n : 2 * n, 0:n]
    grown, own = work[2 * n, 0:n], work[2 * n + 1, 0:n]
    if not invert(T, inverse, factor):
        return False
    for i in range(n):
        grown[i] = _noise_reach(inverse, i, G, widths, delta)
        own[i] = 1.0
    return _grow(T, inverse, grown, own, work[2 * n + 2 : 2 * n + 8, 0:n], T)


@kernel
def enclose_orthogonally(T: Matrix, G: Matrix, widths: Vector, delta: Vector, work: Matrix) -> bool:
    """As :func:`enclose`, with new edges: an orthogonal basis, the longest columns first, in row-scaled coordinates."""
    n, q = G.shape
    basis, inverse = work[0:n, 0:n], work[n : 2 * n, 0:n]
    grown, own = work[2 * n, 0:n], work[2 * n + 1, 0:n]
    columns = work[2 * n + 8 : 3 * n + 8, 0 : n + q]
    scale = work[2 * n + 2, 0:n]
    for i in range(n):
        size = delta[i]
        for j in range(n):
            size += abs(T[i, j])
        for j in range(q):
            size += abs(G[i, j]) * widths[j]
        if not math.isfinite(size):
            return False
        scale[i] = _power_of_two(size)
        for j in range(n):
            columns[i, j] = T[i, j] / scale[i]
        for j in range(q):
            columns[i, n + j] = G[i, j] * widths[j] / scale[i]
    orthogonal_basis(columns, basis)
    for i in range(n):
        for j in range(n):
            inverse[j, i] = basis[i, j] / scale[i]
    for i in range(n):
        for j in range(n):
            basis[i, j] *= scale[i]
    for i in range(n):
        grown[i] = up(_noise_reach(inverse, i, G, widths, delta) + _edge_reach(inverse, i, T))
        own[i] = 0.0
    return _grow(basis, inverse, grown, own, work[2 * n + 2 : 2 * n + 8, 0:n], T)


@kernel
def image(c: Vector, T: Matrix, A: Matrix, B: Matrix, u: Vector, new_c: Vector, new_T: Matrix, delta: Vector) -> None:
    """``new_c ≈ A c + B u``, ``new_T ≈ A T``; ``delta`` (n,) bounds what rounding has lost in both together."""
    n, p = c.size, u.size
    for i in range(n):
        centre, magnitude = 0.0, 0.0
        for k in range(n):
            term = A[i, k] * c[k]
            centre += term
            magnitude += abs(term)
        for k in range(p):
            term = B[i, k] * u[k]
            centre += term
            magnitude += abs(term)
        for j in range(n):
            new_T[i, j] = 0.0
        for k in range(n):
            if A[i, k] != 0.0:
                for j in range(n):
                    term = A[i, k] * T[k, j]
                    new_T[i, j] += term
                    magnitude += abs(term)
        new_c[i] = centre
        delta[i] = _inflate(gamma(n + p + 2) * magnitude, n * n + n + p + 4)


@kernel
def predict_image(
    c: Vector, T: Matrix, A: Matrix, B: Matrix, u: Vector, G: Matrix, widths: Vector,
    new_c: Vector, new_T: Matrix, work: Matrix,
) -> int:  # fmt: skip
    """Time update along the edges A T: ``A P + B u ⊕ G diag(widths)[−1,1]^q`` (Lainová et al. 2019, eq. 36).

    c (n,), T (n, n), A (n, n), B (n, p), u (p,), G (n, q), widths (q,). Returns 0 or ``OVERFLOW``.
    """
    delta = work[work.shape[0] - 1, 0 : c.size]
    image(c, T, A, B, u, new_c, new_T, delta)
    if not enclose(new_T, G, widths, delta, work):
        return OVERFLOW
    return 0


@kernel
def update(c: Vector, T: Matrix, C: Matrix, y: Vector, r: Vector, new_c: Vector, new_T: Matrix, work: Matrix) -> int:
    """Data update: the strips ``|y − C x| ≤ r`` in the order of the rows; NaN is no strip (Lainová et al. 2019, eq. 33).

    C (m, n), y (m,), r (m,). Returns 0, ``OVERFLOW``, or k + 1 where the strip of row k is proved to miss the set.
    """
    n = c.size
    last = work.shape[0] - 1
    delta, strips = work[last, 0:n], work[0:3, 0:n]
    _start(c, T, new_c, new_T, delta)
    touched = False
    for k in range(y.size):
        if not math.isnan(y[k]):
            status = cut(new_c, new_T, delta, C[k], down(y[k] - r[k]), up(y[k] + r[k]), strips)
            if status == EMPTY:
                return k + 1
            touched = touched or status != UNCHANGED
    if touched and not enclose(new_T, new_T[:, 0:0], delta[0:0], delta, work):
        return OVERFLOW
    return 0


@kernel
def meet_box(c: Vector, T: Matrix, lower: Vector, upper: Vector, new_c: Vector, new_T: Matrix, work: Matrix) -> int:
    """Offer the faces of a box as strips, each where it cuts. Returns as :func:`update`, k being the coordinate."""
    n = c.size
    last = work.shape[0] - 1
    delta, strips, axis = work[last, 0:n], work[0:3, 0:n], work[3, 0:n]
    _start(c, T, new_c, new_T, delta)
    touched = False
    for k in range(n):
        for i in range(n):
            axis[i] = 1.0 if i == k else 0.0
        status = cut(new_c, new_T, delta, axis, lower[k], upper[k], strips)
        if status == EMPTY:
            return k + 1
        touched = touched or status != UNCHANGED
    if touched and not enclose(new_T, new_T[:, 0:0], delta[0:0], delta, work):
        return OVERFLOW
    return 0


@kernel
def _start(c: Vector, T: Matrix, new_c: Vector, new_T: Matrix, delta: Vector) -> None:
    n = c.size
    for i in range(n):
        new_c[i] = c[i]
        delta[i] = 0.0
        for j in range(n):
            new_T[i, j] = T[i, j]


@kernel
def faces(c: Vector, T: Matrix, P: Matrix, y: Vector, r: Vector, factor: Matrix) -> bool:
    """Strips ``|y − P x| ≤ r`` around the set, ``P ≈ T⁻¹``; ``False`` where T is numerically singular."""
    n = c.size
    if not invert(T, P, factor):
        return False
    for i in range(n):
        residual = _residual_row(P, T, i)
        if not residual <= LARGEST_RESIDUAL:
            return False
        s, magnitude = 0.0, 0.0
        for k in range(n):
            term = P[i, k] * c[k]
            s += term
            magnitude += abs(term)
        y[i] = s
        r[i] = up(up(1.0 + residual) + _inflate(gamma(n) * magnitude, n + 4))
    return True


@kernel
def predict_output(c: Vector, T: Matrix, C: Matrix, r: Vector, lower: Vector, upper: Vector, point: Vector) -> None:
    """Output interval ``C c ± (r + Σ_i |C T_i|)``, rounded outward (Lainová et al. 2019, eqs. 43–45, errata)."""
    n = c.size
    for k in range(C.shape[0]):
        s, magnitude, reach = 0.0, 0.0, 0.0
        for i in range(n):
            s += C[k, i] * c[i]
            magnitude += abs(C[k, i] * c[i])
        for j in range(n):
            entry = 0.0
            for i in range(n):
                term = C[k, i] * T[i, j]
                entry += term
                magnitude += abs(term)
            reach += abs(entry)
        reach += r[k]
        reach = _inflate(reach + gamma(n + 2) * magnitude, n * n + 2 * n + 8)
        lower[k], upper[k], point[k] = down(s - reach), up(s + reach), s


@kernel
def _power_of_two(size: float) -> float:
    """The power of two at or below size (division by it is exact); 1 for 0 and for extreme sizes."""
    if not (1e-290 < size < 1e290):
        return 1.0
    return math.ldexp(0.5, math.frexp(size)[1])


@kernel
def _noise_reach(M: Matrix, i: int, G: Matrix, widths: Vector, delta: Vector) -> float:
    """``Σ_q |(M G)_iq| widths_q + (|M| delta)_i``, rounded up."""
    n, q = G.shape
    reach, magnitude = 0.0, 0.0
    for j in range(q):
        if widths[j] > 0.0:
            entry, size = 0.0, 0.0
            for k in range(n):
                term = M[i, k] * G[k, j]
                entry += term
                size += abs(term)
            reach += abs(entry) * widths[j]
            magnitude += size * widths[j]
    for k in range(n):
        reach += abs(M[i, k]) * delta[k]
    return _inflate(reach + gamma(n + 2) * magnitude, n + q + 6)


@kernel
def _edge_reach(M: Matrix, i: int, T: Matrix) -> float:
    """``Σ_j |(M T)_ij|``, rounded up."""
    n = T.shape[0]
    reach, magnitude = 0.0, 0.0
    for j in range(n):
        entry = 0.0
        for k in range(n):
            term = M[i, k] * T[k, j]
            entry += term
            magnitude += abs(term)
        reach += abs(entry)
    return _inflate(reach + gamma(n + 2) * magnitude, 2 * n + 6)


@kernel
def _inflate(x: float, operations: int) -> float:
    """x ≥ 0 rounded up by the relative error of as many operations on non-negative numbers."""
    return x + gamma(operations) * x + UNDERFLOW if x > 0.0 else 0.0


@kernel
def _grow(V: Matrix, M: Matrix, grown: Vector, own: Vector, work: Matrix, T: Matrix) -> bool:
    """``T ← V diag(own + z)`` where ``z ≥ |V⁻¹ e|`` for every e whose ``|M e| ≤ grown``; V and T may be the same.

    The rounding of the products is enclosed as well. ``False``, T untouched, where ``M ≈ V⁻¹`` is not good enough.
    """
    n = V.shape[0]
    residual, first, lost, final = work[0], work[1], work[2], work[3]
    largest = 0.0
    for i in range(n):
        residual[i] = _residual_row(M, V, i)
        largest = max(largest, residual[i])
    if not largest <= LARGEST_RESIDUAL:
        return False
    _solve_bound(grown, residual, largest, first)
    for i in range(n):
        size = 0.0
        for j in range(n):
            size += abs(V[i, j]) * (own[j] + first[j])
        lost[i] = _inflate(4.0 * UNIT_ROUNDOFF * size, n + 4)
    for i in range(n):
        reach = grown[i]
        for k in range(n):
            reach += abs(M[i, k]) * lost[k]
        grown[i] = _inflate(reach, n + 4)
    _solve_bound(grown, residual, largest, final)
    for i in range(n):
        final[i] = up(own[i] + final[i]) if own[i] + final[i] > 0.0 else 0.0
        # ``lost`` was made from ``first``: it holds for ``final`` as long as that is not twice as large
        if not (final[i] <= 1.75 * (own[i] + first[i]) and math.isfinite(final[i])):
            return False
    for i in range(n):
        for j in range(n):
            T[i, j] = V[i, j] * final[j]
    return True


@kernel
def _residual_row(M: Matrix, V: Matrix, i: int) -> float:
    """``Σ_j |I − M V|_ij``, rounded up."""
    n = V.shape[0]
    total, magnitude = 0.0, 1.0
    for j in range(n):
        entry = -1.0 if i == j else 0.0
        for k in range(n):
            term = M[i, k] * V[k, j]
            entry += term
            magnitude += abs(term)
        total += abs(entry)
    return _inflate(total + gamma(n + 3) * magnitude, 2 * n + 6)


@kernel
def _solve_bound(b: Vector, residual: Vector, largest: float, z: Vector) -> None:
    """``z_i = b_i + ρ_i max(b)/(1 − max(ρ))``, rounded up."""
    greatest = 0.0
    for i in range(b.size):
        greatest = max(greatest, b[i])
    for i in range(b.size):
        z[i] = _inflate(b[i] + residual[i] * greatest / (1.0 - largest), 8)
