"""The bundle of LSUPB: a parallelotope and a box, both of which hold the state, tighten each other.

Both are outer sets of the same state, so each may be met with any set that holds the other: the faces of the box are
offered to the parallelotope as strips, and the box is met with the hull of the parallelotope and with its faces. A
per-step minimum of the volume lets a parallelotope elongate over time; the box stops that.
"""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.parallelotopes.box import tighten
from lsu_mesh.kernels.parallelotopes.parallelotope import cut_all, faces
from lsu_mesh.kernels.parallelotopes.strip_update import EMPTY, OVERFLOW, hull
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel
from lsu_mesh.kernels.runtime.rounding import down, up
from lsu_mesh.kernels.runtime.scratch import BODY, BUNDLE, FACTOR, IDENTITY, Scratch, row, square


@inner
def tighten_each_other(c: Vector, T: Matrix, lower: Vector, upper: Vector, work: Scratch) -> int:
    """Faces of the box to the parallelotope, then its hull and its faces to the box; in place.

    Returns 0, ``OVERFLOW``, or k + 1 where both are proved to have no point in common.
    """
    n = c.size
    interval = n > 0  # always; a literal would compile cut_all a second time
    status = cut_all(c, T, square(work, n, IDENTITY), lower, upper, interval, not interval, work)
    if status != 0:
        return status
    hull_lower, hull_upper = row(work, n, BUNDLE), row(work, n, BUNDLE + 1)
    no_error = row(work, n, BUNDLE + 2)
    for i in range(n):
        no_error[i] = 0.0
    if not hull(c, T, no_error, hull_lower, hull_upper):
        return OVERFLOW
    status = shrink(lower, upper, hull_lower, hull_upper)
    if status != 0:
        return status
    P, middle, reach = square(work, n, BODY), row(work, n, BUNDLE), row(work, n, BUNDLE + 1)
    if faces(c, T, P, middle, reach, square(work, n, FACTOR)):
        return tighten_all(lower, upper, P, middle, reach)
    return 0


@kernel
def tighten_all(lower: Vector, upper: Vector, P: Matrix, y: Vector, r: Vector) -> int:
    """The box by the exact hull of its meet with each strip ``|y − P x| ≤ r`` in turn, in place; NaN is no strip.

    Returns 0, or k + 1 where the strip of row k is proved to miss the box.
    """
    for k in range(y.size):
        if not math.isnan(y[k]) and tighten(lower, upper, P[k], down(y[k] - r[k]), up(y[k] + r[k])) == EMPTY:
            return k + 1
    return 0


@inlined
def shrink(lower: Vector, upper: Vector, other_lower: Vector, other_upper: Vector) -> int:
    """Meet with a box, exact and in place; returns 0, or i + 1 where coordinate i leaves nothing."""
    status = 0
    for i in range(lower.size):
        lower[i] = max(lower[i], other_lower[i])
        upper[i] = min(upper[i], other_upper[i])
        if lower[i] > upper[i] and status == 0:
            status = i + 1
    return status
