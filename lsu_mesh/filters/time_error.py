"""What an unknown error of a measurement's time costs: strips that are true of the state at the nominal time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.validation import input_interval
from lsu_mesh.kernels.discretisation.step_charges import course, output_drift
from lsu_mesh.model import ContinuousModel, LSUModel
from lsu_mesh.supports.orthotope import Orthotope

MAX_PIECES = 256
"""So many pieces an error is cut into at most, so that ``‖A‖`` times a piece is at most ½."""


def state_box(
    flow: ContinuousModel, lower: Vector, upper: Vector, error_ns: int, u: ArrayLike | Orthotope | None = None
) -> Orthotope | None:
    """A box that holds x(s) for all ``|s − t| ≤ error_ns``, from the box [lower, upper] (n,) of x(t).

    u (p,): the input, or the hull of *every* input that acts in ``[t − e, t + e]``. ``None`` where no box was found:
    the error is far too long for the model.

    By Picard: ``X ⊕ [−e, e] (A T + B u + a + N box(rho)) ⊆ T``, in pieces where ``e ‖A‖`` is large; met with the
    domain, which holds at every moment.
    """
    if error_ns < 0:
        raise ModelError(f"the error of a time must not be negative, it is {error_ns} ns")
    rates, center, half_widths, seconds = flow.rates, *input_interval(u, flow.input_count), error_ns / 1e9
    pieces = max(1, math.ceil(2.0 * seconds * float(np.abs(rates.A).sum(axis=1).max())))
    if pieces > MAX_PIECES:
        return None
    low, high = np.array(lower), np.array(upper)
    center, half_widths = _with_offset(rates, center, half_widths)
    piece = math.nextafter(seconds / pieces, math.inf) if error_ns else 0.0
    for _ in range(pieces):
        if not course(*flow.arrays, piece, center, half_widths, low, high):
            return None
    if rates.domain is not None:
        met = np.maximum(low, rates.domain.lower), np.minimum(high, rates.domain.upper)
        if (met[0] <= met[1]).all():
            low, high = met
    return Orthotope(low, high)


def time_widening(
    flow: ContinuousModel,
    outputs: LSUModel,
    lower: Vector,
    upper: Vector,
    error_ns: int,
    u: ArrayLike | Orthotope | None = None,
) -> Vector | None:
    """By how much each strip (m,) must be widened where the time of y is known to ``error_ns`` only.

    ``e · max |C_i (A x + B u + a + N w)|`` over the :func:`state_box`; C is that of ``outputs``. The widened strip is a
    true statement on x(t) at the nominal t. Where D ≠ 0 update with the hull of the inputs as a box besides. ``None``
    where there is no such box: subdivide, or leave the data out.
    """
    if error_ns == 0:
        return np.zeros(outputs.output_count)
    box = state_box(flow, lower, upper, error_ns=error_ns, u=u)
    if box is None:
        return None
    center, half_widths = _with_offset(flow.rates, *input_interval(u, flow.input_count))
    drift = np.empty(outputs.output_count)
    seconds = math.nextafter(error_ns / 1e9, math.inf)
    output_drift(
        np.array(outputs.C), *flow.arrays, seconds, center, half_widths,
        np.array(box.lower), np.array(box.upper), drift,
    )  # fmt: skip
    return drift


def _with_offset(rates: LSUModel, center: Vector, half_widths: Vector) -> tuple[Vector, Vector]:
    if rates.a is None:
        return center, half_widths
    return np.append(center, 1.0), np.append(half_widths, 0.0)
