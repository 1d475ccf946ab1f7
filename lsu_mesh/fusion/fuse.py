"""Fusion of supports of one step: intersection, or the relaxed one that survives lying sources."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.supports.arrays import frozen
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.support import Support

Vector = NDArray[np.float64]


class Fusion(NamedTuple):
    """What the sources know together.

    ``support`` holds the state; ``bounds`` (lower, upper) is its interval hull met with the bounds of every accepted
    source; ``point`` is the centre of the bounds; ``rejected`` are indices of sources that were left out.
    """

    support: Support
    bounds: tuple[Vector, Vector]
    point: Vector
    rejected: tuple[int, ...]


def fuse(supports: Sequence[Support], policy: str = "intersect", faults: int = 0) -> Fusion:
    """``∩ supports`` (``"intersect"``), or the hull of all intersections of m − ``faults`` of them (``"relaxed"``).

    Parameters
    ----------
    supports:
        Sets of one step and one dimension, of any kinds; at least one.
    policy, faults:
        ``"relaxed"`` holds the state as long as at most ``faults`` of the sources are wrong.

    Raises
    ------
    InconsistentData
        The sets are proved to have no common point (``"intersect"``), or more than ``faults`` of them are wrong.
    ModelError
        No support, different dimensions, or an unknown policy.

    Copies, order and grouping of the sources do not matter, but for rounding: intersection is idempotent, commutative
    and associative.
    """
    if policy not in ("intersect", "relaxed"):
        raise ModelError(f'policy must be "intersect" or "relaxed", it is {policy!r}')
    if not supports:
        raise ModelError("fusion needs at least one support, it has none")
    if faults and policy == "intersect":
        raise ModelError(f'faults = {faults} needs policy = "relaxed"; "intersect" trusts every source')
    if policy == "relaxed" and faults:
        from lsu_mesh.fusion.relaxed import fuse_relaxed

        return fuse_relaxed(supports, faults)
    return fuse_all(supports)


def fuse_all(supports: Sequence[Support]) -> Fusion:
    """``∩ supports``; a single source keeps its class. ``InconsistentData`` where it is proved empty."""
    joint = Intersection(supports)
    try:
        lower, upper = joint.bounds()
    except InconsistentData as error:
        raise InconsistentData("the supports are proved to have no common point") from error
    support = supports[0] if len(supports) == 1 else joint.to_constrained_zonotope()
    return Fusion(support, (lower, upper), frozen(0.5 * lower + 0.5 * upper), ())


def meet_bounds(supports: Sequence[Support]) -> tuple[Vector, Vector]:
    """``(max of the lower, min of the upper)`` bounds, (n,) each, exact; they may cross."""
    bounds = [support.bounds() for support in supports]
    return np.max([low for low, _ in bounds], axis=0), np.min([high for _, high in bounds], axis=0)
