"""Fusion of supports of one step: intersection, or the relaxed one that survives lying sources."""

from __future__ import annotations

from collections.abc import Sequence

from lsu_mesh.errors import ModelError
from lsu_mesh.fusion.intersection import Fusion
from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.supports.support import Support


def fuse(supports: Sequence[Support], policy: str = "intersect", faults: int = 0) -> Fusion:
    """``∩ supports`` (``"intersect"``), or the hull of all intersections of m − ``faults`` of them (``"relaxed"``).

    Parameters
    ----------
    supports:
        Sets of one step and one dimension, of any kinds; at least one.
    policy, faults:
        A name of :data:`lsu_mesh.fusion.policies.POLICIES`. ``"relaxed"`` holds the state as long as at most
        ``faults`` of the sources are wrong.

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
    return chosen.function(supports, faults)
