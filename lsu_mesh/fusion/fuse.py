"""Fusion of supports of one step: intersection, or the relaxed one that survives lying sources."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from lsu_mesh.errors import ModelError
from lsu_mesh.filters.point_rule import PointOption, point_rule
from lsu_mesh.fusion.intersection import Fusion
from lsu_mesh.fusion.point import Told, point_of
from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.supports.arrays import finite_array, frozen
from lsu_mesh.supports.support import Support


def fuse(
    supports: Sequence[Support],
    policy: str = "intersect",
    faults: int = 0,
    *,
    point: PointOption = "mean",
    points: Sequence[ArrayLike] | None = None,
) -> Fusion:
    """``∩ supports`` (``"intersect"``), or the hull of all intersections of m − ``faults`` of them (``"relaxed"``).

    Parameters
    ----------
    supports:
        Sets of one step and one dimension, of any kinds; at least one.
    policy, faults:
        A name of :data:`lsu_mesh.fusion.policies.POLICIES`. ``"relaxed"`` holds the state as long as at most
        ``faults`` of the sources are wrong.
    point, points:
        The rule of the fused point. ``"mean"``: nearest to the mean of the sources' ``points`` (n,), each weighted in
        each coordinate by the inverse square of its set's width; rejected sources do not count, and without points the
        sets' centres stand for them. ``"nearest"``: nearest to the centre of the bounds, ``"centre"``: that centre,
        which may lie outside.

    Raises
    ------
    InconsistentData
        The sets are proved to have no common point (``"intersect"``), or more than ``faults`` of them are wrong.
    ModelError
        No support, different dimensions, or an unknown policy.

    Copies, order and grouping of the sources do not matter, but for rounding: intersection is idempotent, commutative
    and associative.
    """
    chosen = POLICIES.get(policy)
    if chosen is None:
        names = " or ".join(f'"{name}"' for name in POLICIES)
        raise ModelError(f"policy must be {names}, it is {policy!r}")
    if not supports:
        raise ModelError("fusion needs at least one support, it has none")
    if faults and not chosen.takes_faults:
        names = " or ".join(f'"{other.name}"' for other in POLICIES.values() if other.takes_faults)
        raise ModelError(f'faults = {faults} needs policy = {names}; "{policy}" trusts every source')
    rule = point_rule(point)
    if points is not None and len(points) != len(supports):
        raise ModelError(f"points must be one per support, {len(supports)}; there are {len(points)}")
    fused = chosen.function(supports, faults)
    accepted = [i for i in range(len(supports)) if i not in fused.rejected]
    told = [_told(supports[i], None if points is None else points[i]) for i in accepted]
    return fused._replace(point=frozen(point_of(fused.support, fused.bounds, told, rule)))


def _told(support: Support, point: ArrayLike | None) -> Told:
    """A source's point, the centre of its set where it is not known, and its bounds."""
    lower, upper = support.bounds()
    return (0.5 * lower + 0.5 * upper if point is None else finite_array("points", point, (support.dim,))), lower, upper
