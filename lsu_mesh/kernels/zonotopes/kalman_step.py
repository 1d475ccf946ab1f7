"""The steps of the zonotopic Kalman filter in compiled code: a zonotope ``c + H ξ``, and a box beside it."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.linear_programs.safe_maxima import EMPTY as PROVED_EMPTY
from lsu_mesh.kernels.linear_programs.safe_maxima import TIGHT, open_program
from lsu_mesh.kernels.parallelotopes.box import keep_constants
from lsu_mesh.kernels.parallelotopes.bundle import tighten_all
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.splicing import spliced
from lsu_mesh.kernels.zonotopes.constrained_step import DONE, EMPTY, TROUBLED, UNBOUNDED
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_strips
from lsu_mesh.kernels.zonotopes.time_update import predict_constrained
from lsu_mesh.kernels.zonotopes.zonotope import absorb_box, zonotope_radius, zonotope_support
from lsu_mesh.kernels.zonotopes.zonotopic_kalman import box_shortest, corrected, kalman_gain


@inner
def zonotope_bounds(c: Array, H: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """The hull of the zonotope, met with the box; (n,), (n,)."""
    n = c.size
    radius = zonotope_radius(H)
    least, most = np.empty(n), np.empty(n)
    for i in range(n):
        least[i], most[i] = c[i] - radius[i], c[i] + radius[i]
        if radius[i] > 0.0:
            least[i], most[i] = np.nextafter(least[i], -np.inf), np.nextafter(most[i], np.inf)
        least[i], most[i] = max(least[i], lower[i]), min(most[i], upper[i])
    return least, most


@inner
def is_void(lower: Array, upper: Array) -> bool:
    """Whether a box holds no point."""
    void = False
    for i in range(lower.size):
        void = void or lower[i] > upper[i]
    return void


@spliced
def correct(
    c: Array, H: Array, lower: Array, upper: Array, C: Array, y: Array, r: Array, has_box: bool
) -> tuple[int, Array, Array, Array, Array]:
    """The data update with the strips ``|y − C x| ≤ r``, NaN for none: ``EMPTY`` where they are proved to miss the set.

    Returns c, H and the box, which with ``has_box`` the strips tighten beside the zonotope.
    """
    known = 0
    for i in range(y.size):
        known += 0 if np.isnan(y[i]) else 1
    P, values, widths = np.empty((known, c.size)), np.empty(known), np.empty(known)
    k = 0
    for i in range(y.size):
        if not np.isnan(y[i]):
            P[k], values[k], widths[k] = C[i], y[i], r[i]
            k += 1
    g = H.shape[1]
    _, A, b = meet_strips(c, H, np.zeros((0, g)), np.zeros(0), P, values, widths)
    status, _ = open_program(A, b)
    if status != TIGHT:
        return (EMPTY if status == PROVED_EMPTY else TROUBLED), c, H, lower, upper
    least, most = lower, upper
    if has_box:
        least, most = zonotope_bounds(c, H, lower, upper)
        if tighten_all(least, most, P, values, widths) != 0:
            return EMPTY, c, H, lower, upper
    K = kalman_gain(H, P, widths)
    centre, columns, slack = corrected(c, H, P, values, widths, K)
    columns, _ = absorb_box(columns, np.zeros((0, columns.shape[1])), slack)
    hull = zonotope_bounds(centre, columns, least, most)
    if is_void(hull[0], hull[1]):
        return EMPTY, c, H, lower, upper
    for i in range(c.size):
        if np.isnan(hull[0][i]) or np.isnan(hull[1][i]):
            return TROUBLED, c, H, lower, upper
    return DONE, centre, columns, least, most


@spliced
def move(
    c: Array, H: Array, lower: Array, upper: Array, A: Array, B: Array, u: Array, N: Array, widths: Array,
    domain: Array, order: int, scaled: bool, has_box: bool,
) -> tuple[int, Array, Array, Array, Array]:  # fmt: skip
    """The time update ``A X ⊕ B u ⊕ N box(widths)``, reduced to ``order`` columns (−1: all); domain as in LSU-CZ."""
    n = c.size
    body = (c, H, np.zeros((0, H.shape[1])), np.zeros(0))
    least, most = zonotope_bounds(c, H, lower, upper)
    finite, moved, low, high = predict_constrained(body, least, most, A, B, u, N, widths)
    if not finite:
        return UNBOUNDED, c, H, lower, upper
    columns = moved[1] if order < 0 else box_shortest(moved[1], order, scaled)
    keep_constants(least, most, A, B, u, N, widths, low, high)
    for i in range(n):
        if domain.shape[0] > 0:
            low[i], high[i] = max(low[i], domain[0, i]), min(high[i], domain[1, i])
        elif not has_box:
            low[i], high[i] = -np.inf, np.inf
    hull = zonotope_bounds(moved[0], columns, low, high)
    if is_void(hull[0], hull[1]):
        return EMPTY, c, H, lower, upper
    return DONE, moved[0], columns, low, high


@inner
def zonotope_image(c: Array, H: Array, P: Array, low: Array, high: Array) -> None:
    """Fills low, high (k,): bounds of ``P x`` over the zonotope, P (k, n), rounded outward."""
    opposite = np.empty(c.size)
    for i in range(P.shape[0]):
        for s in range(c.size):
            opposite[s] = -P[i, s]
        high[i] = zonotope_support(c, H, P[i])
        low[i] = -zonotope_support(c, H, opposite)
