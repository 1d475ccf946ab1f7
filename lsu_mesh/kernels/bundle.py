"""The steps of LSUPB: a parallelotope and a box that both hold the state and tighten each other.

Both are outer sets of the same state, so each may be met with any set that holds the other: data strips go to both, the
faces of the box are offered to the parallelotope as strips, and the box is met with the hull of the parallelotope and with
its faces. A per-step minimum of the volume lets a parallelotope elongate over time; the box stops that.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels import box, parallelotope
from lsu_mesh.kernels.box import tighten
from lsu_mesh.kernels.compile import kernel
from lsu_mesh.kernels.parallelotope import STRIPS, cut_by_box, faces
from lsu_mesh.kernels.rounding import down, up
from lsu_mesh.kernels.scratch import BODY, BUNDLE, FACTOR, Scratch
from lsu_mesh.kernels.strip import EMPTY, OVERFLOW, hull

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]

_predict_parallelotope = parallelotope.predict
_update_parallelotope = parallelotope.update
_predict_box = box.predict
_meet_box = box.meet_box


@kernel
def predict(
    c: Vector, T: Matrix, lower: Vector, upper: Vector,
    A: Matrix, B: Matrix, u: Vector, G: Matrix, widths: Vector,
    new_c: Vector, new_T: Matrix, new_lower: Vector, new_upper: Vector, work: Scratch,
) -> int:  # fmt: skip
    """Time update of both sets, then each tightens the other. Returns 0 or ``OVERFLOW``."""
    status = _predict_box(lower, upper, A, B, u, G, widths, new_lower, new_upper, work)
    if status != 0:
        return status
    status = _predict_parallelotope(c, T, A, B, u, G, widths, STRIPS, new_c, new_T, work)
    if status != 0:
        return status
    # the exact hull of the moved parallelotope is at hand: tighter than the hull of what encloses it
    _shrink_box(new_lower, new_upper, work.vectors[BUNDLE], work.vectors[BUNDLE + 1])
    return _tighten_each_other(new_c, new_T, new_lower, new_upper, work)


@kernel
def update(
    c: Vector, T: Matrix, lower: Vector, upper: Vector, C: Matrix, y: Vector, r: Vector,
    new_c: Vector, new_T: Matrix, new_lower: Vector, new_upper: Vector, work: Scratch,
) -> int:  # fmt: skip
    """Data update of both sets with the strips ``|y − C x| ≤ r`` (NaN is no strip), then each tightens the other.

    Returns 0, ``OVERFLOW``, or k + 1 where the strip of row k is proved to miss one of the sets.
    """
    n, m, last = c.size, y.size, 0
    for i in range(n):
        new_lower[i], new_upper[i] = lower[i], upper[i]
    for k in range(m):
        if not math.isnan(y[k]):
            last = k + 1
            if tighten(new_lower, new_upper, C[k], down(y[k] - r[k]), up(y[k] + r[k])) == EMPTY:
                return last
    status = _update_parallelotope(c, T, C, y, r, new_c, new_T, work)
    if status != 0 or last == 0:
        return status
    status = _tighten_each_other(new_c, new_T, new_lower, new_upper, work)
    return last if status > 0 else status


@kernel
def meet_box(
    c: Vector, T: Matrix, lower: Vector, upper: Vector, other_lower: Vector, other_upper: Vector,
    new_c: Vector, new_T: Matrix, new_lower: Vector, new_upper: Vector, work: Scratch,
) -> int:  # fmt: skip
    """Meet with a box. Returns 0, ``OVERFLOW``, or i + 1 where coordinate i is proved to leave nothing."""
    status = _meet_box(lower, upper, other_lower, other_upper, new_lower, new_upper)
    if status != 0:
        return status
    for i in range(c.size):
        new_c[i] = c[i]
        for j in range(c.size):
            new_T[i, j] = T[i, j]
    return _tighten_each_other(new_c, new_T, new_lower, new_upper, work)


@kernel
def _tighten_each_other(c: Vector, T: Matrix, lower: Vector, upper: Vector, work: Scratch) -> int:
    """Faces of the box to the parallelotope, then its hull and its faces to the box; in place."""
    status = cut_by_box(c, T, lower, upper, work)
    if status != 0:
        return status
    n = c.size
    hull_lower, hull_upper = work.vectors[BUNDLE], work.vectors[BUNDLE + 1]
    no_error = work.vectors[BUNDLE + 2]
    for i in range(n):
        no_error[i] = 0.0
    if not hull(c, T, no_error, hull_lower, hull_upper):
        return OVERFLOW
    status = _shrink_box(lower, upper, hull_lower, hull_upper)
    if status != 0:
        return status
    P, middle, reach = work.squares[BODY], work.vectors[BUNDLE], work.vectors[BUNDLE + 1]
    if faces(c, T, P, middle, reach, work.squares[FACTOR]):
        for k in range(n):
            if tighten(lower, upper, P[k], down(middle[k] - reach[k]), up(middle[k] + reach[k])) == EMPTY:
                return k + 1
    return 0


@kernel
def _shrink_box(lower: Vector, upper: Vector, other_lower: Vector, other_upper: Vector) -> int:
    """Meet with a box, in place; returns 0, or i + 1 where coordinate i leaves nothing."""
    for i in range(lower.size):
        lower[i] = max(lower[i], other_lower[i])
        upper[i] = min(upper[i], other_upper[i])
        if lower[i] > upper[i]:
            return i + 1
    return 0
