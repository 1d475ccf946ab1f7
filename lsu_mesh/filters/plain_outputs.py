"""Data of outputs with feedthrough, offsets and periods as the plain strips ``|y − C x| ≤ r`` that filters cut with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Flags, Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import OutputPrediction
from lsu_mesh.filters.inconsistency import strip_contradiction
from lsu_mesh.filters.validation import KernelModel, half_width_vector, input_interval, output_vector
from lsu_mesh.kernels import plain_outputs as kernels
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

Image = Callable[[Matrix], tuple[Vector, Vector]]
"""Bounds (m,), (m,) of ``C x`` over a filter's set."""


def plain_strips(
    model: LSUModel,
    arrays: KernelModel,
    y: ArrayLike,
    r: ArrayLike | None,
    u: ArrayLike | Orthotope | None,
    image: Image,
    is_strict: bool = True,
) -> tuple[Vector, Vector]:
    """y (m,), NaN for no strip, and r (m,) of the strips ``|y − C x| ≤ r`` that the data y (m,) are.

    ``y − d − D u`` with its rounding in r, and the multiples of the periods that can be. A plain model gives y and r
    back, bit by bit.

    Raises
    ------
    InconsistentData
        An output with a period is proved to miss the set for every multiple; only where ``is_strict``, else the
        nearest is taken.
    """
    values = output_vector(y, model.output_count)
    widths = half_width_vector("r", r, arrays.r)
    if model.has_plain_outputs:
        return values, widths
    shift, spread = _shift(model, u, is_asked=~np.isnan(values))
    period = np.zeros(values.size) if model.period is None else np.array(model.period)
    low, high = image(arrays.C) if period.any() else (np.zeros(values.size), np.zeros(values.size))
    plain_y, plain_r = np.empty_like(values), np.empty_like(values)
    low, high = np.array(low), np.array(high)
    missed = kernels.plain_strips(values, widths, shift, spread, period, low, high, plain_y, plain_r)
    if missed and is_strict:
        raise strip_contradiction(model.outputs, low, high, y=np.where(period > 0, plain_y, np.nan), r=plain_r)
    return plain_y, plain_r


def shifted(prediction: OutputPrediction, model: LSUModel, u: ArrayLike | Orthotope | None) -> OutputPrediction:
    """An interval of ``C x + v`` as one of ``y = C x + D u + d + v``."""
    if model.D is None and model.d is None:
        return prediction
    kernels.shifted_interval(*prediction, *_shift(model, u, is_asked=np.ones(model.output_count, dtype=bool)))
    return prediction


def widened(low: Vector, high: Vector, r: Vector) -> tuple[Vector, Vector]:
    """``[low − r, high + r]`` (m,), rounded outward where r > 0."""
    lower = np.where(r > 0, np.nextafter(low - r, -np.inf), low)
    return lower, np.where(r > 0, np.nextafter(high + r, np.inf), high)


def _shift(model: LSUModel, u: ArrayLike | Orthotope | None, is_asked: Flags) -> tuple[Vector, Vector]:
    """``D u + d`` (m,) and what is not known of it; u may be left out where no output that is asked for sees it."""
    m = model.output_count
    d = np.zeros(m) if model.d is None else np.array(model.d)
    shift, spread = np.empty(m), np.empty(m)
    if model.D is None or (u is None and not model.D[is_asked].any()):
        D, center, half_widths = np.zeros((m, 0)), np.zeros(0), np.zeros(0)
    elif u is None:
        raise ModelError("D ≠ 0: an output depends on the input; give u, or an Orthotope that holds it")
    else:
        D = np.array(model.D)
        center, half_widths = input_interval(u, model.input_count)
    kernels.output_shift(D, d, center, half_widths, shift, spread)
    return shift, spread
