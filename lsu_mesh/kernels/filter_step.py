"""One step of each family of filters: the single place where single step, loop and bank come together.

A state is a matrix with rows of length n: ``BOX`` lower, upper; ``PARALLELOTOPE`` c, then the n rows of T, and where a
box is carried beside it, which it takes nothing from, lower, upper; ``BUNDLE`` c, the n rows of T, lower, upper.
``option`` is, for ``BOX``, ``MEET`` or 0, and for ``PARALLELOTOPE`` the kind of time update
(``kernels/parallelotopes/parallelotope.py``), in both with ``TIES`` or without. All families and actions share one
compiled function: each further one would compile everything below it once more.
"""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.parallelotopes import box, parallelotope
from lsu_mesh.kernels.parallelotopes.bundle import shrink, tighten_all, tighten_each_other
from lsu_mesh.kernels.parallelotopes.parallelotope import STRIPS, cut_all
from lsu_mesh.kernels.parallelotopes.strip_update import hull, middle
from lsu_mesh.kernels.runtime.compile import inlined, kernel
from lsu_mesh.kernels.runtime.linear_algebra import log_abs_determinant
from lsu_mesh.kernels.runtime.scratch import BUNDLE as BUNDLE_ROW
from lsu_mesh.kernels.runtime.scratch import FACTOR, IDENTITY, Scratch, row, square

BOX = 0
PARALLELOTOPE = 1
BUNDLE = 2

MEET = 1
"""Option of ``BOX``: the hull is met with the prediction."""
TIES = 8
"""Option of ``BOX`` and ``PARALLELOTOPE``: a strip of data takes the place of an own one of equal width."""

UPDATE = 0
PREDICT = 1
MEET_BOX = 2
"""Actions, in the order of a step; the last one after a prediction, where the model has a domain."""

LOG_2 = math.log(2.0)

_update_box, _predict_box, _predict_parallelotope = box.update, box.predict, parallelotope.predict
_keep_constants = box.keep_constants
_output_of_box, _output_of_parallelotope, _volume_of_box = (
    box.predict_output,
    parallelotope.predict_output,
    box.volume,
)


@kernel
def advance(
    action: int, family: int, option: int, S: Matrix,
    P: Matrix, first: Vector, second: Vector,
    A: Matrix, B: Matrix, u: Vector, G: Matrix, widths: Vector,
    new: Matrix, work: Scratch,
) -> int:  # fmt: skip
    """``new`` ← S after one action; S is kept, ``new`` is spoilt where the status is not 0.

    ``UPDATE``: ``S ∩ {|first − P x| ≤ second}``, rows in order, NaN is no strip. ``MEET_BOX``: ``S ∩ [first,
    second]``. ``PREDICT``: ``A S + B u ⊕ G diag(widths)[−1,1]^q``. What an action does not need is not read. Returns
    0, negative on overflow, or k + 1 where the strip of row (the face of coordinate) k is proved to leave nothing.
    """
    if action == UPDATE and all_missing(first):
        copy(S, new)
        return 0
    n = S.shape[1]
    box_row = 0 if family == BOX else n + 1
    boxed = family == PARALLELOTOPE and S.shape[0] > n + 1
    status = 0
    if family != PARALLELOTOPE or boxed:
        status = _advance_box(
            action, option, family != BOX, S[box_row : box_row + 2], P, first, second,
            A, B, u, G, widths, new[box_row : box_row + 2], work,
        )  # fmt: skip
    if status != 0 or family == BOX:
        return status
    c, T = new[0], new[1 : n + 1]
    rows, low, high, interval = P, first, second, action != UPDATE
    if interval:
        rows = square(work, n, IDENTITY)
    if action == PREDICT:
        time_update = option & ~TIES if family == PARALLELOTOPE else STRIPS
        status = _predict_parallelotope(S[0], S[1 : n + 1], A, B, u, G, widths, time_update, c, T, work)
        low, high = row(work, n, BUNDLE_ROW), row(work, n, BUNDLE_ROW + 1)
        if status == 0 and (boxed or family == BUNDLE):  # the hull of the image is exact: tighter than that of the set
            status = shrink(new[n + 1], new[n + 2], low, high)
        if status != 0 or (time_update != STRIPS and not boxed):
            return status
    else:
        time_update = STRIPS
        copy(S[0 : n + 1], new[0 : n + 1])
    if status == 0 and time_update == STRIPS and (family == PARALLELOTOPE or action == UPDATE):
        ties = family == PARALLELOTOPE and action == UPDATE and option & TIES != 0
        status = cut_all(c, T, rows, low, high, interval, ties, work)
    if status != 0 or (family == PARALLELOTOPE and not boxed):
        return status
    if boxed:
        return _meet_hull(c, T, new[n + 1], new[n + 2], work)
    return tighten_each_other(c, T, new[n + 1], new[n + 2], work)


@inlined
def _meet_hull(c: Vector, T: Matrix, lower: Vector, upper: Vector, work: Scratch) -> int:
    """The box beside a parallelotope, met with its hull; 0, or k + 1 where coordinate k leaves nothing."""
    n = c.size
    low, high, no_error = row(work, n, BUNDLE_ROW), row(work, n, BUNDLE_ROW + 1), row(work, n, BUNDLE_ROW + 2)
    for i in range(n):
        no_error[i] = 0.0
    hull(c, T, no_error, low, high)
    return shrink(lower, upper, low, high)


@inlined
def _advance_box(
    action: int, option: int, in_bundle: bool, S: Matrix, P: Matrix, first: Vector, second: Vector,
    A: Matrix, B: Matrix, u: Vector, G: Matrix, widths: Vector, new: Matrix, work: Scratch,
) -> int:  # fmt: skip
    """:func:`advance` for a box, S (2, n); in a bundle the data strips tighten it one by one."""
    if action == PREDICT:
        status = _predict_box(S[0], S[1], A, B, u, G, widths, new[0], new[1], work)
        _keep_constants(S[0], S[1], A, B, u, G, widths, new[0], new[1])
        return status
    if action == UPDATE and not in_bundle:
        return _update_box(S[0], S[1], P, first, second, option & MEET != 0, option & TIES != 0, new[0], new[1], work)
    copy(S, new)
    if action == UPDATE:
        return tighten_all(new[0], new[1], P, first, second)
    return shrink(new[0], new[1], first, second)


@inlined
def all_missing(y: Vector) -> bool:
    """Whether no strip is given: without data nothing changes, also where two sets could tighten each other."""
    given = 0
    for i in range(y.size):
        given += 0 if math.isnan(y[i]) else 1
    return given == 0


@inlined
def copy(source: Matrix, target: Matrix) -> None:
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@kernel
def predict_output(
    family: int, S: Matrix, C: Matrix, r: Vector, lower: Vector, upper: Vector, point: Vector, work: Scratch
) -> None:
    """Interval of ``C x + v``; of a bundle the meet of both its sets' intervals, with the middle as the point."""
    n = S.shape[1]
    if family == BOX:
        _output_of_box(S[0], S[1], C, r, lower, upper, point)
        return
    _output_of_parallelotope(S[0], S[1 : n + 1], C, r, lower, upper, point)
    boxed = family == PARALLELOTOPE and S.shape[0] > n + 1
    if family == BUNDLE or boxed:
        for k in range(C.shape[0]):
            low, high, mid = (
                row(work, 1, n * BUNDLE_ROW),
                row(work, 1, n * BUNDLE_ROW + 1),
                row(work, 1, n * BUNDLE_ROW + 2),
            )
            _output_of_box(S[n + 1], S[n + 2], C[k : k + 1], r[k : k + 1], low, high, mid)
            lower[k], upper[k] = max(lower[k], low[0]), min(upper[k], high[0])
            point[k] = min(max(point[k], lower[k]), upper[k]) if boxed else middle(lower[k], upper[k])


@kernel
def describe(family: int, S: Matrix, point: Vector, lower: Vector, upper: Vector, work: Scratch) -> float:
    """Fills point estimate and interval hull, each (n,), and returns the volume (of a bundle the smaller of both)."""
    n = S.shape[1]
    if family == PARALLELOTOPE:
        no_error = row(work, n, BUNDLE_ROW)
        for i in range(n):
            no_error[i] = 0.0
        hull(S[0], S[1 : n + 1], no_error, lower, upper)
        boxed = S.shape[0] > n + 1
        for i in range(n):
            if boxed:
                lower[i], upper[i] = S[n + 1, i], S[n + 2, i]
            point[i] = min(max(S[0, i], lower[i]), upper[i])
        return volume_of(S[1 : n + 1], square(work, n, FACTOR))
    first = 0 if family == BOX else n + 1
    for i in range(n):
        lower[i], upper[i] = S[first, i], S[first + 1, i]
        point[i] = middle(lower[i], upper[i])
    size = _volume_of_box(lower, upper)
    return size if family == BOX else min(size, volume_of(S[1 : n + 1], square(work, n, FACTOR)))


@kernel
def log_volume(family: int, S: Matrix, work: Scratch) -> float:
    """Logarithm of the volume that :func:`describe` returns, without overflow; ``-inf`` for a flat set."""
    n = S.shape[1]
    logarithm = math.inf
    if family != PARALLELOTOPE:
        first = 0 if family == BOX else n + 1
        logarithm = 0.0
        for i in range(n):
            width = S[first + 1, i] - S[first, i]
            logarithm += math.log(width) if width > 0.0 else -math.inf
    if family != BOX:
        logarithm = min(logarithm, log_abs_determinant(S[1 : n + 1], square(work, n, FACTOR)) + n * LOG_2)
    return logarithm


@kernel
def volume_of(T: Matrix, factor: Matrix) -> float:
    """``2ⁿ |det T|``; factor (n, n) is scratch."""
    return math.exp(log_abs_determinant(T, factor) + T.shape[0] * LOG_2)
