"""Ranges of the variables of ``{ξ : A ξ = b, |ξ|∞ ≤ 1}`` that single rows imply: no program is solved for them.

Every combination ``y'A ξ = y'b`` of rows holds on the set, and bounds each of its variables by the ranges of the
others. The rows of the tableau at a vertex are the combinations that say most: all but one of their variables are
nonbasic there.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.linear_programs.safe_maxima import Program
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, down, gamma, up

WORTH = 0.02
"""A row is verified where it seems to shorten some range by this share."""


@kernel
def implied_ranges(program: Program) -> tuple[Array, Array]:
    """Ranges low, high (g,) within [−1, 1] that hold every ξ of the set, rounded outward.

    The rows of the tableau are taken in order, each with the ranges that those before have left. A row is computed anew
    from A by its multipliers, so that it need not be believed: see :func:`_verified_row`.
    """
    m, g = program.rows.shape
    low = np.empty(g)
    high = np.empty(g)
    row = np.empty(g)
    for j in range(g):
        low[j], high[j] = -program.reach[j], program.reach[j]
    for i in range(m):
        if program.basis[i] < 0:
            continue
        for j in range(g):
            row[j] = program.tableau[i, j]
        side = 0.0
        for k in range(m):
            side += program.tableau[i, g + k] * program.sides[k]
        if _narrow(row, side, 0.0, low, high, False):
            side, slack = _verified_row(program, i, row)
            if np.isfinite(slack):
                _narrow(row, side, slack, low, high, True)
    for j in range(g):
        low[j], high[j] = low[j] / program.reach[j], high[j] / program.reach[j]
    return low, high


@inner
def _verified_row(program: Program, i: int, row: Array) -> tuple[float, float]:
    """``y'A`` to ``row`` (g,), ``y'b``, and the slack with which the computed row holds; y is row i of ``B⁻¹``.

    An entry of ``y'A`` is off by at most ``γ_m Σ_k |y_k A_kj|``, which moves the row by ``γ_m Σ_k |y_k| Σ_j |A_kj|
    reach_j``; ``y'b`` is off by ``γ_m Σ_k |y_k b_k|``. :func:`_narrow` sums g products of at most ``|row_j| reach_j``
    and subtracts three times. All of it is below ``2 γ_{g+m+16}`` times the sum of these sizes.
    """
    m, g = program.rows.shape
    side = 0.0
    mass = 0.0
    for j in range(g):
        row[j] = 0.0
    for k in range(m):
        y = program.tableau[i, g + k]
        if y != 0.0:
            source = program.rows[k]
            for j in range(g):
                row[j] += y * source[j]
            side += y * program.sides[k]
            mass += abs(y) * (program.sums[k] + abs(program.sides[k]))
    for j in range(g):
        mass += abs(row[j]) * program.reach[j]
    return side, up(2.0 * gamma(g + m + 16) * mass + UNDERFLOW)


@inner
def _narrow(row: Array, side: float, slack: float, low: Array, high: Array, writes: bool) -> bool:
    """Whether ``|row · x − side| ≤ slack`` shortens some range [low_j, high_j] noticeably; ``writes``: shorten them."""
    g = row.size
    least = 0.0
    most = 0.0
    for j in range(g):
        if row[j] > 0.0:
            least += row[j] * low[j]
            most += row[j] * high[j]
        else:
            least += row[j] * high[j]
            most += row[j] * low[j]
    shortens = False
    for j in range(g):
        a = row[j]
        if a == 0.0:
            continue
        at_low, at_high = (a * low[j], a * high[j]) if a > 0.0 else (a * high[j], a * low[j])
        first = side - (most - at_high) - slack
        last = side - (least - at_low) + slack
        lower, upper = (first / a, last / a) if a > 0.0 else (last / a, first / a)
        little = WORTH * (high[j] - low[j])
        if lower > low[j] + little or upper < high[j] - little:
            shortens = True
        if writes:
            if low[j] < lower <= high[j]:
                low[j] = max(low[j], down(lower))
            if low[j] <= upper < high[j]:
                high[j] = min(high[j], up(upper))
    return shortens
