"""Generators of a lifted zonotope that are parallel become one: that costs nothing but rounding, which is enclosed."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma, up
from lsu_mesh.kernels.zonotopes.lifted_zonotope import row_scales, without_zero_columns

PARALLEL = 2.0**-40
"""Two columns are parallel where they differ by this share of the second one's largest entry, on scaled rows."""


@inner
def merge_parallel(L: Array, slack: Array) -> Array:
    """Columns (N, ≤ g) that generate, with the slack, a zonotope which contains ``L ξ ⊕ box(slack)``.

    ``L_i ξ_i + L_j ξ_j = L_i (ξ_i + t ξ_j) + (L_j − t L_i) ξ_j`` and ``|ξ_i + t ξ_j| ≤ 1 + |t|``: where ``L_j ≈ t L_i``
    the first is a longer column in place of both, and what it leaves goes to the slack (N,), rounded up.
    """
    g = L.shape[1]
    scale = row_scales(L)
    merged = False
    for i in range(g):
        p = _largest_entry(L, i, scale)
        if p < 0:
            continue
        for j in range(i + 1, g):
            if L[p, j] != 0.0 and _are_parallel(L, i, j, p, scale):
                _merge(L, i, j, L[p, j] / L[p, i], slack)
                merged = True
    return without_zero_columns(L) if merged else L


@inner
def _largest_entry(L: Array, j: int, scale: Array) -> int:
    """The row in which column j is largest, in units of the rows; −1 for a column of zeros."""
    best, p = 0.0, -1
    for s in range(L.shape[0]):
        if scale[s] > 0.0 and abs(L[s, j]) / scale[s] > best:
            best, p = abs(L[s, j]) / scale[s], s
    return p


@inner
def _are_parallel(L: Array, i: int, j: int, p: int, scale: Array) -> bool:
    """Whether ``L_j − t L_i``, ``t = L_pj / L_pi``, is next to nothing in every row."""
    t = L[p, j] / L[p, i]
    if not np.isfinite(t):
        return False
    bound = PARALLEL * abs(L[p, j]) / scale[p]
    for s in range(L.shape[0]):  # noqa: SIM110 (kernels have no generators)
        if scale[s] > 0.0 and abs(L[s, j] - t * L[s, i]) / scale[s] > bound:
            return False
    return True


@inner
def _merge(L: Array, i: int, j: int, t: float, slack: Array) -> None:
    """Column i longer by ``1 + |t|``, column j zero."""
    longer = up(1.0 + abs(t))
    for s in range(L.shape[0]):
        product = t * L[s, i]
        left = abs(L[s, j] - product)
        lost = abs(L[s, j]) + 2.0 * abs(product)
        entry = L[s, i] * longer
        if lost > 0.0 or entry != 0.0:
            slack[s] = up(slack[s] + up(left + up(gamma(2) * (lost + abs(entry)) + UNDERFLOW)))
        L[s, i] = entry
        L[s, j] = 0.0
