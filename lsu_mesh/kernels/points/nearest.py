"""The point of a parallelotope, or of its part in a box, that is nearest to a target.

``argmin max_i |x_i − m_i|/q_i``, q the half-widths of the box, and of all such points the one with the least sum. A
linear program in the distances ``x_i = m_i + q_i (z⁺_i − z⁻_i)`` and their largest t, by the dual simplex method: it
starts at the target, which costs nothing, and takes one strip after the other that the point violates. Its answer is
an approximation; :func:`_reach` proves that the point lies in the set.
"""

from __future__ import annotations

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.parallelotopes.enclosure import inflate, residual_row
from lsu_mesh.kernels.points.room import (
    EDGES,
    FACTOR,
    HALF_WIDTHS,
    INVERSE,
    MARGIN,
    RESIDUAL,
    TARGET,
    Room,
    labels_of,
    row_of,
    square_of,
    tableau_of,
)
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel
from lsu_mesh.kernels.runtime.linear_algebra import invert
from lsu_mesh.kernels.runtime.rounding import EPSILON, UNDERFLOW, gamma

INSIDE = 1e-9
"""Share of the strips by which the point stays clear of their faces."""
MAX_MARGIN = 0.5
MAX_RESIDUAL = 0.25
VIOLATION = 1e-13
"""Share of a strip's reach by which it may be violated, far less than the margin."""
TINY = 1e-12
"""Entries and costs below this are rounding."""


@kernel
def nearest_point(c: Vector, T: Matrix, lower: Vector, upper: Vector, point: Vector, work: Room) -> bool:
    """Move ``point`` (n,), from a target, to the nearest one in ``{c + T ξ : |ξ|∞ ≤ 1} ∩ [lower, upper]``.

    Returns whether it is proved to lie in both. Where the set is so thin that no nearest point can be proved, the
    point is the centre c, if it lies in the box, else the nearest one without a proof.
    """
    n = c.size
    P, edges, residual = square_of(work, n, INVERSE), square_of(work, n, EDGES), row_of(work, n, RESIDUAL)
    target, margin = row_of(work, n, TARGET), row_of(work, n, MARGIN)
    for i in range(n):
        point[i] = min(max(point[i], lower[i]), upper[i])
    is_regular = _prepare(c, T, lower, upper, point, P=P, edges=edges, residual=residual, work=work)
    if is_regular and _is_proved(P, residual, c, point):
        return True
    for i in range(n):
        target[i] = point[i]
    for least in (INSIDE, 0.0):
        if is_regular:
            _margins(P, residual, c, lower, upper, least, margin)
            if _solve(P, c, lower, upper, target, margin, point, work) and _is_proved(P, residual, c, point):
                return True
    is_inside = True
    for i in range(n):
        point[i] = min(max(c[i], lower[i]), upper[i])
        margin[i] = 0.0
        is_inside = is_inside and point[i] == c[i]
    if is_regular and not is_inside:
        _solve(P, c, lower, upper, target, margin, point, work)
    return is_inside


@inlined
def _prepare(
    c: Vector, T: Matrix, lower: Vector, upper: Vector, point: Vector,
    P: Matrix, edges: Matrix, residual: Vector, work: Room,
) -> bool:  # fmt: skip
    """``P ≈ T⁻¹`` and ``residual ≥ Σ_j |I − P T|_ij``; a coordinate without edges gets one, and is fixed at c.

    ``T' ξ = x − c`` with the further edges has ξ = 0 along them where x is fixed: it is a solution of ``T ξ = x − c``.
    """
    n = c.size
    q = row_of(work, n, HALF_WIDTHS)
    for i in range(n):
        q[i] = 0.5 * upper[i] - 0.5 * lower[i]
        for j in range(n):
            edges[i, j] = T[i, j]
    j = 0
    for i in range(n):
        if not _row_is_zero(T, i):
            continue
        while j < n and not _column_is_zero(T, j):
            j += 1
        if j == n or not lower[i] <= c[i] <= upper[i]:
            return False
        edges[i, j], point[i], q[i] = 1.0, c[i], 0.0
        j += 1
    if not invert(edges, P, square_of(work, n, FACTOR)):
        return False
    for i in range(n):
        residual[i] = residual_row(P, edges, i)
        if not residual[i] <= MAX_RESIDUAL:
            return False
    return True


@inlined
def _row_is_zero(T: Matrix, i: int) -> bool:
    total = 0.0
    for j in range(T.shape[1]):
        total += abs(T[i, j])
    return total == 0.0


@inlined
def _column_is_zero(T: Matrix, j: int) -> bool:
    total = 0.0
    for i in range(T.shape[0]):
        total += abs(T[i, j])
    return total == 0.0


@inner
def _is_proved(P: Matrix, residual: Vector, c: Vector, x: Vector) -> bool:
    """Whether ``T ξ = x − c`` is proved to have a solution with ``|ξ|∞ ≤ 1``.

    ``ξ = P (x − c) + (I − P T) ξ``, so ``|ξ|∞ ≤ |P (x − c)|∞ / (1 − max residual)``, which is below 2 where each row
    passes: residuals are at most ``MAX_RESIDUAL``, which proves T regular, too.
    """
    is_inside = True
    for i in range(c.size):
        # written so that a NaN proves nothing
        is_inside = is_inside and _reach(P, i, c, x) + 2.0 * residual[i] * (1.0 + 4.0 * EPSILON) <= 1.0 - 4.0 * EPSILON
    return is_inside


@inlined
def _reach(P: Matrix, i: int, c: Vector, x: Vector) -> float:
    """``|P_i (x − c)|``, rounded up."""
    n = c.size
    total, magnitude = 0.0, 0.0
    for j in range(n):
        term = P[i, j] * (x[j] - c[j])
        total += term
        magnitude += abs(term)
    return inflate(abs(total) + gamma(n + 2) * magnitude, n + 4)


@inlined
def _margins(
    P: Matrix, residual: Vector, c: Vector, lower: Vector, upper: Vector, least: float, margin: Vector
) -> None:
    """How far the point has to stay within each strip ``|P_i (x − c)| ≤ 1``: what rounding may cost, and ``least``."""
    n = c.size
    for i in range(n):
        lost = 0.0
        for j in range(n):
            far = max(upper[j] - c[j], c[j] - lower[j], 0.0)
            lost += abs(P[i, j]) * (gamma(2 * n + 8) * far + EPSILON * max(abs(lower[j]), abs(upper[j])))
        margin[i] = min(least + 2.0 * (lost + 2.0 * residual[i]) + 16.0 * EPSILON, MAX_MARGIN)


@inner
def _solve(
    P: Matrix, c: Vector, lower: Vector, upper: Vector, target: Vector, margin: Vector, point: Vector, work: Room
) -> bool:
    """``point`` ← the nearest one to the target in the strips ``|P_i (x − c)| ≤ 1 − margin_i`` and in the box.

    ``False`` where there is none, or none was found.
    """
    n = c.size
    q, table, labels = row_of(work, n, HALF_WIDTHS), tableau_of(work, n), labels_of(work, n)
    _fill(P, c, lower, upper, target, margin, q, table)
    for k in range(7 * n + 1):
        labels[k] = k - 5 * n if k >= 5 * n else -1.0
    if not _iterate(table, labels, n):
        return False
    for i in range(n):
        point[i] = target[i]
    last = table.shape[1] - 1
    for k in range(5 * n):
        variable = int(labels[k])
        if 0 <= variable < n:
            point[variable] += q[variable] * table[k, last]
        elif n <= variable < 2 * n:
            point[variable - n] -= q[variable - n] * table[k, last]
    for i in range(n):
        point[i] = min(max(point[i], lower[i]), upper[i])
    return True


@inner
def _fill(
    P: Matrix, c: Vector, lower: Vector, upper: Vector, target: Vector, margin: Vector, q: Vector, table: Matrix
) -> None:
    """Rows: the 2 n sides of the strips, ``z⁺_i + z⁻_i ≤ t``, ``z⁺_i ≤ …``, ``z⁻_i ≤ …``; then the costs t and Σ z."""
    n, t = c.size, 2 * c.size
    last = t + 1
    for k in range(5 * n + 2):
        for j in range(2 * n + 2):
            table[k, j] = 0.0
    for k in range(n):
        at, size = 0.0, 0.0
        for j in range(n):
            at += P[k, j] * (target[j] - c[j])
            size += abs(P[k, j]) * q[j]
        size = max(size, UNDERFLOW)
        for j in range(n):
            entry = P[k, j] * q[j] / size
            table[2 * k, j], table[2 * k, n + j] = entry, -entry
            table[2 * k + 1, j], table[2 * k + 1, n + j] = -entry, entry
        table[2 * k, last] = (1.0 - margin[k] - at) / size
        table[2 * k + 1, last] = (1.0 - margin[k] + at) / size
    for i in range(n):
        table[2 * n + i, i], table[2 * n + i, n + i], table[2 * n + i, t] = 1.0, 1.0, -1.0
        table[3 * n + i, i], table[4 * n + i, n + i] = 1.0, 1.0
        if q[i] > 0.0:
            table[3 * n + i, last] = max((upper[i] - target[i]) / q[i], 0.0)
            table[4 * n + i, last] = max((target[i] - lower[i]) / q[i], 0.0)
        table[5 * n + 1, i], table[5 * n + 1, n + i] = 1.0, 1.0
    table[5 * n, t] = 1.0


@inner
def _iterate(table: Matrix, labels: Vector, n: int) -> bool:
    """Dual simplex steps until no row is violated; ``False`` where a row cannot be met, or it takes too long."""
    last = 2 * n + 1
    for _ in range(20 * n + 20):
        row, worst = -1, -VIOLATION
        for k in range(5 * n):
            if table[k, last] < worst:
                row, worst = k, table[k, last]
        if row < 0:
            return True
        column = _entering(table, row, n)
        if column < 0:
            return False
        _pivot(table, row, column)
        labels[row], labels[5 * n + column] = labels[5 * n + column], labels[row]
    return False


@inlined
def _entering(table: Matrix, row: int, n: int) -> int:
    """The column with the least ratio of the first cost, of equal ones that of the second; −1 where there is none."""
    column, first, second = -1, 0.0, 0.0
    for j in range(2 * n + 1):
        slope = -table[row, j]
        if slope <= TINY:
            continue
        one, other = table[5 * n, j] / slope, table[5 * n + 1, j] / slope
        if column < 0 or one < first - TINY or (one <= first + TINY and other < second - TINY):
            column, first, second = j, one, other
    return column


@inlined
def _pivot(table: Matrix, row: int, column: int) -> None:
    """Exchange the variable of the row with that of the column."""
    inverse = 1.0 / table[row, column]
    for j in range(table.shape[1]):
        table[row, j] *= inverse
    table[row, column] = inverse
    for k in range(table.shape[0]):
        factor = table[k, column]
        if k != row and factor != 0.0:
            for j in range(table.shape[1]):
                table[k, j] -= factor * table[row, j]
            table[k, column] = -factor * inverse
