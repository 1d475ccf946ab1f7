"""One step of each family of filters, by its number: the single place where single step, loop and bank come together.

A state is a matrix with rows of length n: ``BOX`` lower, upper; ``PARALLELOTOPE`` c, then the n rows of T; ``BUNDLE`` c, the
n rows of T, lower, upper. ``option`` is, for ``BOX``, whether the hull is met with the prediction, and for ``PARALLELOTOPE``
the kind of time update (``kernels/parallelotope.py``).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels import box, bundle, parallelotope
from lsu_mesh.kernels.compile import kernel
from lsu_mesh.kernels.linear_algebra import log_abs_determinant
from lsu_mesh.kernels.scratch import BUNDLE as BUNDLE_ROW
from lsu_mesh.kernels.scratch import FACTOR, Scratch
from lsu_mesh.kernels.strip import hull, middle

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]

BOX = 0
PARALLELOTOPE = 1
BUNDLE = 2

LOG_2 = math.log(2.0)

_box_update, _box_predict, _box_meet, _box_output, _box_volume = (
    box.update, box.predict, box.meet_box, box.predict_output, box.volume,
)  # fmt: skip
_update, _predict, _meet, _output = (
    parallelotope.update, parallelotope.predict, parallelotope.meet_box, parallelotope.predict_output,
)  # fmt: skip
_bundle_update, _bundle_predict, _bundle_meet = bundle.update, bundle.predict, bundle.meet_box


def state_rows(family: int, n: int) -> int:
    """Rows of a state of n coordinates."""
    return {BOX: 2, PARALLELOTOPE: n + 1, BUNDLE: n + 3}[family]


@kernel
def update(family: int, option: int, S: Matrix, C: Matrix, y: Vector, r: Vector, new: Matrix, work: Scratch) -> int:
    """Data update ``new ← S ∩ {|y − C x| ≤ r}``; S is kept. Status: 0, negative (overflow), or k + 1 (row k misses)."""
    n = S.shape[1]
    if family == BOX:
        return _box_update(S[0], S[1], C, y, r, option != 0, new[0], new[1], work)
    if family == PARALLELOTOPE:
        return _update(S[0], S[1 : n + 1], C, y, r, new[0], new[1 : n + 1], work)
    return _bundle_update(
        S[0], S[1 : n + 1], S[n + 1], S[n + 2], C, y, r,
        new[0], new[1 : n + 1], new[n + 1], new[n + 2], work,
    )  # fmt: skip


@kernel
def predict(
    family: int, option: int, S: Matrix, A: Matrix, B: Matrix, u: Vector, G: Matrix, widths: Vector,
    new: Matrix, work: Scratch,
) -> int:  # fmt: skip
    """Time update ``new ← A S + B u ⊕ G diag(widths)[−1,1]^q``; S is kept. Status: 0 or negative (overflow)."""
    n = S.shape[1]
    if family == BOX:
        return _box_predict(S[0], S[1], A, B, u, G, widths, new[0], new[1], work)
    if family == PARALLELOTOPE:
        return _predict(S[0], S[1 : n + 1], A, B, u, G, widths, option, new[0], new[1 : n + 1], work)
    return _bundle_predict(
        S[0], S[1 : n + 1], S[n + 1], S[n + 2], A, B, u, G, widths,
        new[0], new[1 : n + 1], new[n + 1], new[n + 2], work,
    )  # fmt: skip


@kernel
def meet_box(family: int, S: Matrix, lower: Vector, upper: Vector, new: Matrix, work: Scratch) -> int:
    """``new ← S ∩ [lower, upper]``; S is kept. Status: 0, negative (overflow), or i + 1 (nothing in coordinate i)."""
    n = S.shape[1]
    if family == BOX:
        return _box_meet(S[0], S[1], lower, upper, new[0], new[1])
    if family == PARALLELOTOPE:
        return _meet(S[0], S[1 : n + 1], lower, upper, new[0], new[1 : n + 1], work)
    return _bundle_meet(
        S[0], S[1 : n + 1], S[n + 1], S[n + 2], lower, upper,
        new[0], new[1 : n + 1], new[n + 1], new[n + 2], work,
    )  # fmt: skip


@kernel
def predict_output(
    family: int, S: Matrix, C: Matrix, r: Vector, lower: Vector, upper: Vector, point: Vector, work: Scratch
) -> None:
    """Interval of ``C x + v``; of a bundle the meet of both its sets' intervals, with the middle as the point."""
    n = S.shape[1]
    if family == BOX:
        _box_output(S[0], S[1], C, r, lower, upper, point)
    else:
        _output(S[0], S[1 : n + 1], C, r, lower, upper, point)
    if family == BUNDLE:
        for k in range(C.shape[0]):
            of_box = work.vectors[BUNDLE_ROW, 0:1], work.vectors[BUNDLE_ROW + 1, 0:1], work.vectors[BUNDLE_ROW + 2, 0:1]
            _box_output(S[n + 1], S[n + 2], C[k : k + 1], r[k : k + 1], of_box[0], of_box[1], of_box[2])
            lower[k], upper[k] = max(lower[k], of_box[0][0]), min(upper[k], of_box[1][0])
            point[k] = middle(lower[k], upper[k])


@kernel
def describe(family: int, S: Matrix, point: Vector, lower: Vector, upper: Vector, work: Scratch) -> float:
    """Fills point estimate and interval hull, each (n,), and returns the volume (of a bundle the smaller of both)."""
    n = S.shape[1]
    if family == PARALLELOTOPE:
        no_error = work.vectors[BUNDLE_ROW]
        for i in range(n):
            no_error[i] = 0.0
        hull(S[0], S[1 : n + 1], no_error, lower, upper)
        for i in range(n):
            point[i] = S[0, i]
        return volume_of(S[1 : n + 1], work.squares[FACTOR])
    first = 0 if family == BOX else n + 1
    for i in range(n):
        lower[i], upper[i] = S[first, i], S[first + 1, i]
        point[i] = middle(lower[i], upper[i])
    size = _box_volume(lower, upper)
    return size if family == BOX else min(size, volume_of(S[1 : n + 1], work.squares[FACTOR]))


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
        logarithm = min(logarithm, log_abs_determinant(S[1 : n + 1], work.squares[FACTOR]) + n * LOG_2)
    return logarithm


@kernel
def volume_of(T: Matrix, factor: Matrix) -> float:
    """``2ⁿ |det T|``; factor (n, n) is scratch."""
    return math.exp(log_abs_determinant(T, factor) + T.shape[0] * LOG_2)
