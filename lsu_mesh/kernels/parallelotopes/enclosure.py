"""A parallelotope that surely holds a zonotope, whatever rounding does.

A parallelotope has no generator to spare for what rounding loses. The sum ``T ξ ⊕ G diag(widths) η ⊕ box(delta)`` is
enclosed along the edges T: with ``M ≈ T⁻¹`` and ``R ≥ |I − M T|`` every ``z = T⁻¹ e`` fulfils ``|z| ≤ |M e| + R |z|``,
so that ``|z|_i ≤ b_i + ρ_i max(b)/(1 − max(ρ))`` with ``b ≥ |M e|`` and the row sums ρ of R; edge i grows by the factor
``1 + |z|_i``. Where T is numerically singular the edges become an orthogonal basis along the longest columns, verified
in the same way.
"""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel
from lsu_mesh.kernels.runtime.linear_algebra import invert, orthogonal_basis
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, UNIT_ROUNDOFF, gamma, size_of_product, up
from lsu_mesh.kernels.runtime.scratch import BASIS, ENCLOSE, FACTOR, INVERSE, Scratch, columns_of, row, square

MAX_RESIDUAL = 0.25
"""An approximate inverse with a larger ‖I − M T‖∞ is not used."""


@inner
def enclose(T: Matrix, G: Matrix, widths: Vector, delta: Vector, work: Scratch) -> bool:
    """``T ← T'`` with ``T'[−1,1]ⁿ ⊇ T[−1,1]ⁿ ⊕ G diag(widths)[−1,1]^q ⊕ box(delta)``, in place.

    T (n, n), G (n, q or more), widths (q,), delta (n,). ``False`` where the result is not finite.
    """
    return enclose_along_edges(T, G, widths, delta, work) or enclose_orthogonally(T, G, widths, delta, work)


@kernel
def enclose_along_edges(T: Matrix, G: Matrix, widths: Vector, delta: Vector, work: Scratch) -> bool:
    """As :func:`enclose`, edges keep their directions; ``False``, T untouched, where T is numerically singular."""
    n = T.shape[0]
    inverse = square(work, n, INVERSE)
    grown, own = row(work, n, ENCLOSE), row(work, n, ENCLOSE + 1)
    if not invert(T, inverse, square(work, n, FACTOR)):
        return False
    for i in range(n):
        grown[i] = _noise_reach(inverse, i, G, widths, delta)
        own[i] = 1.0
    return _grow(T, inverse, grown, own, work, T)


@inner
def enclose_orthogonally(T: Matrix, G: Matrix, widths: Vector, delta: Vector, work: Scratch) -> bool:
    """As :func:`enclose`, with new edges: an orthogonal basis, the longest columns first, in row-scaled coordinates."""
    n, q = T.shape[0], widths.size
    basis, inverse, columns = square(work, n, BASIS), square(work, n, INVERSE), columns_of(work, n, n + q)
    grown, own, scale = row(work, n, ENCLOSE), row(work, n, ENCLOSE + 1), row(work, n, ENCLOSE + 2)
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
    orthogonal_basis(columns, n + q, basis)
    for i in range(n):
        for j in range(n):
            inverse[j, i] = basis[i, j] / scale[i]
    for i in range(n):
        for j in range(n):
            basis[i, j] *= scale[i]
    for i in range(n):
        grown[i] = inflate(_noise_reach(inverse, i, G, widths, delta) + _edge_reach(inverse, i, T), n)
        own[i] = 0.0
    return _grow(basis, inverse, grown, own, work, T)


@inlined
def inflate(x: float, operations: int) -> float:
    """x ≥ 0 rounded up by the relative error of as many operations on non-negative numbers; 0 stays 0, NaN NaN."""
    return 0.0 if x == 0.0 else x + gamma(operations) * x + UNDERFLOW


@inlined
def residual_row(M: Matrix, V: Matrix, i: int) -> float:
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
    return inflate(total + gamma(n + 3) * magnitude, n * n + n + 6)


@inner
def _power_of_two(size: float) -> float:
    """The power of two at or below size (division by it is exact); 1 for 0 and for extreme sizes."""
    if not (1e-290 < size < 1e290):
        return 1.0
    return math.ldexp(0.5, math.frexp(size)[1])


@inlined
def _noise_reach(M: Matrix, i: int, G: Matrix, widths: Vector, delta: Vector) -> float:
    """``Σ_q |(M G)_iq| widths_q + (|M| delta)_i``, rounded up."""
    n, q = M.shape[0], widths.size
    reach, magnitude = 0.0, 0.0
    for j in range(q):
        if widths[j] > 0.0:
            entry, size = 0.0, 0.0
            for k in range(n):
                entry += M[i, k] * G[k, j]
                size += size_of_product(M[i, k], G[k, j])
            reach += size_of_product(entry, widths[j])
            magnitude += size_of_product(size, widths[j])
    for k in range(n):
        reach += size_of_product(M[i, k], delta[k])
    return inflate(reach + gamma(n + 2) * magnitude, 2 * n + q + 8)


@inner
def _edge_reach(M: Matrix, i: int, T: Matrix) -> float:
    """``Σ_j |(M T)_ij|``, rounded up."""
    n = T.shape[0]
    reach, magnitude = 0.0, 0.0
    for j in range(n):
        entry = 0.0
        for k in range(n):
            entry += M[i, k] * T[k, j]
            magnitude += size_of_product(M[i, k], T[k, j])
        reach += abs(entry)
    return inflate(reach + gamma(n + 2) * magnitude, n * n + n + 6)


@inner
def _grow(V: Matrix, M: Matrix, grown: Vector, own: Vector, work: Scratch, T: Matrix) -> bool:
    """``T ← V diag(own + z)`` where ``z ≥ |V⁻¹ e|`` for every e whose ``|M e| ≤ grown``; V and T may be the same.

    The rounding of the products is enclosed as well. ``False`` where ``M ≈ V⁻¹`` is not good enough (T is untouched) or
    a product overflows.
    """
    n = V.shape[0]
    residual, first = row(work, n, ENCLOSE + 3), row(work, n, ENCLOSE + 4)
    lost, final = row(work, n, ENCLOSE + 5), row(work, n, ENCLOSE + 6)
    largest = 0.0
    for i in range(n):
        residual[i] = residual_row(M, V, i)
        if not residual[i] <= MAX_RESIDUAL:
            return False
        largest = max(largest, residual[i])
    _solve_bound(grown, residual, largest, first)
    for i in range(n):
        size = 0.0
        for j in range(n):
            size += size_of_product(V[i, j], own[j] + first[j])
        lost[i] = inflate(8.0 * UNIT_ROUNDOFF * size, n + 4)
    for i in range(n):
        reach = grown[i]
        for k in range(n):
            reach += size_of_product(M[i, k], lost[k])
        grown[i] = inflate(reach, n + 4)
    _solve_bound(grown, residual, largest, final)
    for i in range(n):
        final[i] += own[i]
        final[i] = 0.0 if final[i] == 0.0 else up(final[i])
        # ``lost`` was made from ``first``: it holds for ``final`` as long as that is not eight times as large
        if not (final[i] <= 7.0 * (own[i] + first[i]) and math.isfinite(final[i])):
            return False
    finite = True
    for i in range(n):
        for j in range(n):
            T[i, j] = V[i, j] * final[j]
            finite = finite and math.isfinite(T[i, j])
    return finite


@inlined
def _solve_bound(b: Vector, residual: Vector, largest: float, z: Vector) -> None:
    """``z_i = b_i + ρ_i max(b)/(1 − max(ρ))``, rounded up."""
    greatest = 0.0
    for i in range(b.size):
        greatest = max(greatest, b[i])
    for i in range(b.size):
        z[i] = inflate(b[i] + residual[i] * greatest / (1.0 - largest), b.size + 6)
