"""How a cost grows with a count, and what that says of counts beyond those that were measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

Points = Sequence[tuple[float, float]]
"""``(count, cost)``, counts in ascending order."""


class Line(NamedTuple):
    """``cost = fixed + each · count``."""

    fixed: float
    each: float

    def at(self, count: float) -> float:
        """The cost at a count."""
        return self.fixed + self.each * count


def fitted_line(points: Points) -> Line:
    """The line of least squares; ``ValueError`` for fewer than two counts."""
    _need_two(points)
    each, fixed = np.polyfit([count for count, _ in points], [cost for _, cost in points], 1)
    return Line(float(fixed), float(each))


def exponent(points: Points) -> float:
    """p of ``cost ∝ count^p``, least squares of the logarithms over the upper half of the points, at least two of them.

    Small counts are dominated by what does not grow. ``ValueError`` for fewer than two counts.
    """
    _need_two(points)
    upper = list(points)[-max(2, math.ceil(len(points) / 2)) :]
    logarithms = np.log([[count, cost] for count, cost in upper])
    return float(np.polyfit(logarithms[:, 0], logarithms[:, 1], 1)[0])


def projected(points: Points, count: float) -> float:
    """The cost at a larger count: from the last point on by the exponent of the upper half."""
    last, cost = points[-1]
    return float(cost * (count / last) ** exponent(points))


def _need_two(points: Points) -> None:
    if len({count for count, _ in points}) < 2:
        raise ValueError(f"expected costs at two counts or more, found {len(points)}")
