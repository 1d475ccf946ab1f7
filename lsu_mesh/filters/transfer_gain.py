"""The gain of a transfer, measured on interval hulls or on the sets themselves."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import get_args

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import Filter, GainOf

MAX_EXACT_VOLUME = 3
"""States up to which volumes of supports are compared: above, enumerating vertices costs too much."""


def measured(filter: Filter, gain: GainOf | None, transfer: Callable[[], float]) -> float:
    """What a transfer gains, in nats: as it says itself, or by volumes of supports or hulls before and after.

    A support that is flat before or after counts by its hull, without the sides that had no width.
    """
    if gain is None:
        return transfer()
    if gain not in get_args(GainOf):
        raise ModelError(f'gain must be "support", "hull" or None, it is {gain!r}')
    hull, exact = filter.bounds(), gain == "support" and filter.model.state_count <= MAX_EXACT_VOLUME
    before = filter.support.log_volume() if exact else -math.inf
    transfer()
    if before > -math.inf:
        after = filter.support.log_volume()
        if after > -math.inf:
            return max(0.0, before - after)
    return hull_gain(hull, filter.bounds())


def hull_gain(before: tuple[Vector, Vector], after: tuple[Vector, Vector]) -> float:
    """``ln vol(before) − ln vol(after)`` of two boxes (lower, upper), in nats, not below 0.

    Coordinates that had no width before do not count; ``inf`` where a width has vanished.
    """
    had = before[1] > before[0]
    widths = (before[1] - before[0])[had]
    left = (after[1] - after[0])[had]
    if (left <= 0).any():
        return math.inf
    return max(0.0, float(np.sum(np.log(widths) - np.log(left))))
