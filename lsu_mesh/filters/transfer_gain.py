"""The course of a transfer into a filter, and its gain, measured on interval hulls or on the sets themselves."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, get_args

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import Filter, GainOf
from lsu_mesh.filters.last_met import holds
from lsu_mesh.supports.support import Support

MAX_EXACT_VOLUME = 3
"""States up to which volumes of supports are compared: above, enumerating vertices costs too much."""
SETTLED = 1e-9
"""Nats: strips of a set are met again until a sweep gains less."""
MAX_SWEEPS = 4
FLAT = 1e-12
"""A side below this share of its coordinate's size, or a volume below this share of the hull's, is rounding."""


class Gain(NamedTuple):
    """``nats``, and whose volumes were compared."""

    nats: float
    of: GainOf


class SizeBefore(NamedTuple):
    """How large a filter's set was, for :meth:`gain`."""

    hull: tuple[Vector, Vector]
    log_volume: float
    """Of the support; ``-inf`` where the hull counts: that was asked for, there are too many states, or it is flat."""

    @classmethod
    def of(cls, filter: Filter, gain: GainOf) -> SizeBefore:
        """The size now."""
        is_exact = gain == "support" and filter.model.state_count <= MAX_EXACT_VOLUME
        hull = filter.bounds()
        return cls(hull, log_volume(filter.support, hull) if is_exact else -math.inf)

    def gain(self, filter: Filter) -> Gain:
        """What has been gained since, never negative."""
        if self.log_volume > -math.inf:
            after = log_volume(filter.support, filter.bounds())
            if after > -math.inf:
                return Gain(max(0.0, self.log_volume - after), "support")
        return Gain(hull_gain(self.hull, filter.bounds()), "hull")


def conditioned(filter: Filter, support: Support, gain: GainOf | None, transfer: Callable[[Support], float]) -> float:
    """A whole transfer: nothing where the set holds the last one met, else ``transfer``, which is then remembered.

    Returns the gain by the measure that is asked for; with ``None`` what ``transfer`` itself returns.
    """
    if gain is not None and gain not in get_args(GainOf):
        raise ModelError(f'gain must be "support", "hull" or None, it is {gain!r}')
    met = filter.last_met if filter.skips_met else None
    if met is not None and met.dim == support.dim and holds(support, met):
        return 0.0
    before = None if gain is None else SizeBefore.of(filter, gain)
    nats = transfer(support)
    filter.last_met = support
    return nats if before is None else before.gain(filter).nats


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


def log_volume(support: Support, bounds: tuple[Vector, Vector]) -> float:
    """``ln vol`` of a set with these bounds (n,), (n,); ``-inf`` where it is flat but for rounding."""
    lower, upper = bounds
    widths = upper - lower
    if not (widths > FLAT * np.maximum(np.abs(lower), np.abs(upper))).all():
        return -math.inf
    found = support.log_volume()
    return found if found > float(np.log(widths).sum()) + math.log(FLAT) else -math.inf
