"""What LSU-CZ knows: a constrained zonotope, and a box beside it."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.density import Density
from lsu_mesh.filters.lagged_states import StackedStep, body_of, with_newest
from lsu_mesh.filters.validation import KernelModel
from lsu_mesh.kernels.parallelotopes.box import keep_constants
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_strips
from lsu_mesh.kernels.zonotopes.time_update import predict_constrained
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.reduction import Body, Limits
from lsu_mesh.supports.support import Support

GENERATORS, GENERATORS_PER_STATE = 20, 3
"""Generators of a set at least, and for each state, where the user states no limit."""


class Held(NamedTuple):
    """What the filter knows: the state lies in the set with arrays ``body`` = (c, G, A, b) and in [lower, upper].

    With a lag that is the stacked state of the last steps, the newest first (``lagged_states.py``).
    """

    body: Body
    lower: Vector
    upper: Vector
    is_hull: bool
    """Whether the box is the meet with the interval hull of the set already."""
    density: Density | None = None
    """Beside the set, for the point estimate; ``None`` in a set on the way: it then keeps the one in force."""
    met: Support | None = None
    """The set that was met last, where nothing has come since."""


def checked_limits(
    n: int, lag: int, max_generators: int | None, max_constraints: int | None, *, reduces: bool
) -> Limits:  # fmt: skip
    """The limits that the options of a filter with n states stand for; ``ModelError`` where one of them is wrong."""
    if lag < 0:
        raise ModelError(f"lag must not be negative, it is {lag}")
    least = n * (lag + 1)
    if max_generators is not None and max_generators < least:
        number = "the number of states" if not lag else f"the states of {lag + 1} steps"
        raise ModelError(f"max_generators must be at least {least}, {number}, it is {max_generators}")
    if max_constraints is not None and max_constraints < 0:
        raise ModelError(f"max_constraints must not be negative, it is {max_constraints}")
    if max_generators is None:
        max_generators = max(GENERATORS, GENERATORS_PER_STATE * n) + n * lag
    return Limits(max_generators, max_constraints) if reduces else Limits(None, None)


def advanced(
    body: Body, lower: Vector, upper: Vector, arrays: KernelModel, step: StackedStep, *, u: Vector, widths: Vector
) -> Held | None:
    """The time update of a set and its box, or of stacks of them; ``None`` where numbers outgrow double precision."""
    box = np.array([lower, upper])  # one compiled kernel serves, whether or not the bounds may be written
    finite, body, low, high = predict_constrained(body, box[0], box[1], step.R, step.B, u, step.G, widths)
    n = len(arrays.A)
    keep_constants(box[0, :n], box[1, :n], arrays.A, arrays.B, u, arrays.G, widths, low[:n], high[:n])
    return Held(body, low, high, is_hull=False) if finite else None


def within(held: Held, domain: Orthotope) -> Held:
    """Meet with the domain; only coordinates in which the set exceeds it cost a generator and a constraint."""
    c, G, A, b = held.body
    n = domain.dim
    lower, upper = np.maximum(held.lower[:n], domain.lower), np.minimum(held.upper[:n], domain.upper)
    exceeded = (held.lower[:n] < domain.lower) | (held.upper[:n] > domain.upper)
    body = held.body
    if exceeded.any():
        low, high = ConstrainedZonotope.of_arrays(*body_of(body, 0, n)).bounds()
        exceeded &= (low < domain.lower) | (high > domain.upper)
        middle = np.where(exceeded, domain.center, np.nan)
        body = (c, *meet_strips(c, G, A, b, np.eye(n, c.size), middle, np.array(domain.half_widths)))
    if (lower > upper).any() or ConstrainedZonotope.of_arrays(*body).is_empty():
        raise InconsistentData("the prediction is proved to miss the domain")
    return Held(body, with_newest(held.lower, lower), with_newest(held.upper, upper), is_hull=False)


def log_size(body: Body, widths: Vector) -> float:
    """Σ log of a set's widths along the axes and their diagonals, axes in units of ``widths`` (n,)."""
    scaled = np.diag(1.0 / np.where(widths > 0, widths, 1.0))
    first, second = _pairs(widths.size)
    directions = np.vstack([scaled, scaled[first] + scaled[second], scaled[first] - scaled[second]])
    low, high = ConstrainedZonotope.of_arrays(*body).ranges(directions)
    return float(np.log(np.maximum(high - low, np.finfo(np.float64).tiny)).sum())


@functools.cache
def _pairs(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(n, 1)
