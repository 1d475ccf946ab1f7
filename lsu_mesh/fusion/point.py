"""The point of a fused set: the mean of its sources' points, moved into the set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.supports.nearest_point import nearest_point
from lsu_mesh.supports.support import Support

Told = tuple[Vector, Vector, Vector]
"""Point, lower and upper bounds (n,) of a source."""


def point_of(support: Support, bounds: tuple[Vector, Vector], sources: Sequence[Told], rule: PointRule) -> Vector:
    """The point (n,) of a set with these bounds, in both unless the rule is ``"centre"``.

    ``"mean"``: its target is the mean of the sources' points, see :func:`weighted_mean`; without sources, and by the
    rule ``"nearest"``, the centre of the bounds.
    """
    lower, upper = bounds
    centre = np.asarray(lower + 0.5 * (upper - lower))
    if rule == "centre":
        return centre
    target = weighted_mean(sources) if rule == "mean" and sources else centre
    return nearest_point(support, target, lower, upper)


def weighted_mean(sources: Sequence[Told]) -> Vector:
    """``Σ_s m_s / w_s² / Σ_s 1 / w_s²`` in each coordinate, w_s the width of a source; one without width counts alone.

    Sums go in the order of the sources; of several without width the first counts.
    """
    mean = np.empty(sources[0][0].size)
    for i in range(mean.size):
        widths = [float(upper[i] - lower[i]) for _, lower, upper in sources]
        points = [float(point[i]) for point, _, _ in sources]
        smallest = min(widths)
        if smallest <= 0.0:
            mean[i] = points[widths.index(smallest)]
            continue
        weights = [(smallest / width) ** 2 for width in widths]
        total, weight = 0.0, 0.0
        for share, point in zip(weights, points, strict=True):
            total, weight = total + share * point, weight + share
        mean[i] = total / weight
    return mean
