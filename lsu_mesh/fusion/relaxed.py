"""The q-relaxed intersection: fusion that holds the state although some sources are wrong.

If at most q of m sources are wrong, the state lies in at least m − q of the sets, hence in one of the intersections of
m − q of them. The result is the hull of the union of *all* of these that are not proved empty (Jaulin 2009). The
largest consistent family alone is no guarantee: a wrong source that overlaps the others may join it and cut off the
state. For many sources the same is done coordinate by coordinate on the bounds (Marzullo 1984).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.fusion.intersection import Fusion, families_of, fuse_family
from lsu_mesh.supports.arrays import frozen
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Box = tuple[Vector, Vector]

MAX_FAMILIES = 256
"""Intersections that are formed at most; where there are more the coordinates are treated one by one."""


def fuse_relaxed(supports: Sequence[Support], faults: int) -> Fusion:
    """The hull of the union of all intersections of m − ``faults`` sources, for at most ``faults`` wrong ones.

    ``rejected`` are the sources that are *proved* wrong if no more than ``faults`` are: those in no non-empty
    intersection of m − ``faults`` sources. Raises ``InconsistentData`` where all intersections are proved empty,
    ``ModelError`` for a number of faults that leaves no source.
    """
    m = len(supports)
    if not 0 <= faults < m:
        raise ModelError(f"faults must be at least 0 and less than the number of sources, {m}; it is {faults}")
    bounds = [support.bounds() for support in supports]
    if math.comb(m, faults) > MAX_FAMILIES:
        return _fuse_coordinates(bounds, faults)
    consistent = _consistent_families(supports, bounds, m - faults)
    if not consistent:
        raise _too_many_faults(m, faults)
    named = frozenset(range(m)).difference(*(family for family, _ in consistent))
    rejected = tuple(sorted(named))
    if len(consistent) == 1:
        return consistent[0][1]._replace(rejected=rejected)
    lower = np.min([fusion.bounds[0] for _, fusion in consistent], axis=0)
    upper = np.max([fusion.bounds[1] for _, fusion in consistent], axis=0)
    return _boxed(lower, upper, rejected)


def _consistent_families(
    supports: Sequence[Support], bounds: Sequence[Box], size: int
) -> list[tuple[tuple[int, ...], Fusion]]:
    """All families of ``size`` sources whose intersection is not proved empty, with that intersection."""
    disjoint = _disjoint_pairs(bounds)
    families = families_of(supports)
    consistent = []
    for family in itertools.combinations(range(len(supports)), size):
        if any(pair in disjoint for pair in itertools.combinations(family, 2)):
            continue
        try:
            consistent.append((family, fuse_family(supports, families, family)))
        except InconsistentData:
            continue
    return consistent


def _disjoint_pairs(bounds: Sequence[Box]) -> set[tuple[int, int]]:
    """Pairs whose boxes have no point in common: a cheap proof that spares most programs."""
    return {
        (i, j)
        for i, j in itertools.combinations(range(len(bounds)), 2)
        if (bounds[i][0] > bounds[j][1]).any() or (bounds[j][0] > bounds[i][1]).any()
    }


def _fuse_coordinates(bounds: Sequence[Box], faults: int) -> Fusion:
    """Per coordinate, the hull of the points that lie in at least m − ``faults`` of the intervals."""
    lowers, uppers = np.array([b[0] for b in bounds]), np.array([b[1] for b in bounds])
    m, n = lowers.shape
    lower, upper = np.empty(n), np.empty(n)
    wrong: set[int] = set()
    for i in range(n):
        covered = _covered(lowers[:, i], uppers[:, i], m - faults)
        if not covered:
            raise _too_many_faults(m, faults)
        lower[i], upper[i] = covered[0][0], covered[-1][1]
        wrong.update(k for k in range(m) if all(lowers[k, i] > high or uppers[k, i] < low for low, high in covered))
    return _boxed(lower, upper, tuple(sorted(wrong)))


def _covered(lower: Vector, upper: Vector, enough: int) -> list[tuple[float, float]]:
    """The intervals, from left to right, whose points lie in at least ``enough`` of the closed [lower, upper]."""
    ends = sorted([(float(x), 0) for x in lower] + [(float(x), 1) for x in upper])  # at a tie, open before closing
    intervals: list[tuple[float, float]] = []
    count, start = 0, 0.0
    for x, closes in ends:
        if closes:
            if count == enough:
                intervals.append((start, x))
            count -= 1
        else:
            count += 1
            if count == enough:
                start = x
    return intervals


def _boxed(lower: Vector, upper: Vector, rejected: tuple[int, ...]) -> Fusion:
    box = Orthotope(lower, upper)
    return Fusion(box, (frozen(lower), frozen(upper)), frozen(0.5 * lower + 0.5 * upper), rejected)


def _too_many_faults(m: int, faults: int) -> InconsistentData:
    return InconsistentData(f"no {m - faults} of the {m} supports have a point in common: more than {faults} are wrong")
