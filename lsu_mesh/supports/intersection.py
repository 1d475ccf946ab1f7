"""The intersection of sets of any kinds, kept as its parts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.supports.arrays import frozen
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.support import Support


class Intersection(Support):
    """``∩ parts``, at least one part, all of one dimension.

    Raises
    ------
    ModelError
        Where there is no part or the dimensions differ.

    Operations that need one body use the joint constrained zonotope, in which the parts are exact but for a rounded
    difference of centres.
    """

    def __init__(self, parts: Sequence[Support]) -> None:
        self.parts = tuple(parts)
        if not self.parts:
            raise ModelError("an intersection needs at least one part, it has none")
        dims = [part.dim for part in self.parts]
        if len(set(dims)) > 1:
            raise ModelError(f"all parts must have the same dimension, they have {dims}")

    @cached_property
    def _joint(self) -> ConstrainedZonotope:
        joint = self.parts[0].to_constrained_zonotope()
        for part in self.parts[1:]:
            joint = joint.intersect(part)
        return joint

    @cached_property
    def _bounds(self) -> tuple[Vector, Vector]:
        lower, upper = self._joint.bounds()
        for part in self.parts:
            part_lower, part_upper = part.bounds()
            lower, upper = np.maximum(lower, part_lower), np.minimum(upper, part_upper)
        if (lower > upper).any():
            raise InconsistentData("the intersection is proved to be empty: it has no bounds")
        return frozen(lower), frozen(upper)

    @property
    def dim(self) -> int:
        """n"""
        return self.parts[0].dim

    @property
    def center(self) -> Vector:
        """Centre of the interval hull, (n,)."""
        lower, upper = self.bounds()
        return 0.5 * lower + 0.5 * upper

    def bounds(self) -> tuple[Vector, Vector]:
        """Hull of the joint set met with every part's bounds; ``InconsistentData`` where it is proved empty."""
        return self._bounds

    def volume(self) -> float:
        """Volume of the joint polytope, see :meth:`ConstrainedZonotope.volume`."""
        return self._joint.volume()

    def contains(self, x: ArrayLike) -> bool:
        """``False`` only where a part is proved to exclude x (n,)."""
        return all(part.contains(x) for part in self.parts)

    def support(self, d: ArrayLike) -> float:
        """``max {d'x}`` over the joint set, not above any part's; d (n,), rounded up."""
        return min(self._joint.support(d), *(part.support(d) for part in self.parts))

    def vertices(self) -> Matrix:
        """Vertices (k, n) of the joint polytope."""
        return self._joint.vertices()

    def linear_map(self, R: ArrayLike, shift: ArrayLike | None = None) -> ConstrainedZonotope:
        """Image of the joint set; R (k, n), shift (k,)."""
        return self._joint.linear_map(R, shift)

    def minkowski_sum(self, other: Support) -> ConstrainedZonotope:
        """Sum of the joint set and ``other``."""
        return self._joint.minkowski_sum(other)

    def intersect(self, other: Support) -> Intersection:
        """The intersection with one part more, or with the parts of another intersection."""
        return Intersection((*self.parts, *(other.parts if isinstance(other, Intersection) else (other,))))

    def is_empty(self) -> bool:
        """``True`` only with a proof: bounds of the parts that miss each other, or a verified Farkas ray."""
        try:
            self.bounds()
        except InconsistentData:
            return True
        return False

    def to_constrained_zonotope(self) -> ConstrainedZonotope:
        """The joint constrained zonotope: n constraints for each part after the first."""
        return self._joint

    def __repr__(self) -> str:
        return f"Intersection({list(self.parts)!r})"
