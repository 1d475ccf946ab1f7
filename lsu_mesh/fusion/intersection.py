"""The intersection of supports of one step, exact before it is squeezed into one class."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.fusion.stack import NO_LIMITS, Families
from lsu_mesh.supports.arrays import frozen
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.support import Support


class Fusion(NamedTuple):
    """What the sources know together.

    ``support`` holds the state; ``bounds`` (lower, upper) is its interval hull met with the bounds of every accepted
    source; ``point`` is the centre of the bounds, in which :func:`~lsu_mesh.fusion.fuse` puts that
    by its rule; ``rejected`` are indices of sources that were left out.
    """

    support: Support
    bounds: tuple[Vector, Vector]
    point: Vector
    rejected: tuple[int, ...]


def fuse_all(supports: Sequence[Support]) -> Fusion:
    """``∩ supports``; a single source keeps its class. ``InconsistentData`` where it is proved empty."""
    return fuse_family(supports, families_of(supports), tuple(range(len(supports))))


def families_of(supports: Sequence[Support]) -> Families:
    """The stacks of families of supports, without limits. ``ModelError`` where the supports differ in dimension."""
    return Families(None, [(part, part.bounds()) for part in Intersection(supports).parts], NO_LIMITS)


def fuse_family(supports: Sequence[Support], families: Families, family: tuple[int, ...]) -> Fusion:
    """``∩`` of the supports with these indices. ``InconsistentData`` where it is proved empty."""
    settled = families.settled(family)
    if settled is None:
        raise InconsistentData("the supports are proved to have no common point")
    lower, upper = settled.lower, settled.upper
    support = supports[family[0]] if len(family) == 1 else ConstrainedZonotope.of_arrays(*settled.body)
    return Fusion(support, (frozen(lower), frozen(upper)), frozen(0.5 * lower + 0.5 * upper), ())


def meet_bounds(supports: Sequence[Support]) -> tuple[Vector, Vector]:
    """``(max of the lower, min of the upper)`` bounds, (n,) each, exact; they may cross."""
    bounds = [support.bounds() for support in supports]
    return np.max([low for low, _ in bounds], axis=0), np.min([high for _, high in bounds], axis=0)
