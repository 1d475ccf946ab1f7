"""The gain of a transfer, measured on interval hulls."""

from __future__ import annotations

import math

import numpy as np

from lsu_mesh.array_types import Vector


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
