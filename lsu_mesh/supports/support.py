"""The contract that every set fulfils."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector

if TYPE_CHECKING:
    from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
    from lsu_mesh.supports.orthotope import Orthotope


class Support(ABC):
    """A bounded convex set in ℝⁿ: the support of a uniform density.

    Sets are immutable; every operation returns a new set that *contains* the exact result, rounding included.
    """

    @property
    @abstractmethod
    def dim(self) -> int:
        """Dimension n of the space."""

    @property
    @abstractmethod
    def center(self) -> Vector:
        """A point (n,) that represents the set; for a constrained zonotope the centre of its generators' box."""

    @abstractmethod
    def bounds(self) -> tuple[Vector, Vector]:
        """Interval hull ``(lower, upper)``, each (n,), rounded outward."""

    @abstractmethod
    def volume(self) -> float:
        """n-dimensional volume; 0 for a flat set."""

    @abstractmethod
    def contains(self, x: ArrayLike) -> bool:
        """Whether x (n,) may lie in the set: ``False`` only where exclusion is proved."""

    @abstractmethod
    def support(self, d: ArrayLike) -> float:
        """Support function ``max {d'x : x in the set}``, d (n,), rounded up."""

    @abstractmethod
    def vertices(self) -> Matrix:
        """Vertices (k, n) of the set in floating point, for drawing and measuring; no order is promised.

        ``ModelError`` where a box or parallelotope has more than 2^16, or another set spans more than 8 dimensions. A
        set with thousands of vertices in five or more dimensions yields those of an inner approximation.
        """

    @abstractmethod
    def linear_map(self, R: ArrayLike, shift: ArrayLike | None = None) -> Support:
        """Image ``{R x + shift}``, R (k, n), shift (k,)."""

    @abstractmethod
    def minkowski_sum(self, other: Support) -> Support:
        """``{x + z : x in self, z in other}``, or a set that contains it."""

    @abstractmethod
    def intersect(self, other: Support) -> Support:
        """``self ∩ other``, or a set that contains it."""

    @abstractmethod
    def is_empty(self) -> bool:
        """``True`` only where emptiness is proved."""

    @abstractmethod
    def to_constrained_zonotope(self) -> ConstrainedZonotope:
        """The same set as a constrained zonotope (rounding outward where a half-width has to be computed)."""

    def interval_hull(self) -> Orthotope:
        """The smallest box known to hold the set, rounded outward."""
        from lsu_mesh.supports.orthotope import Orthotope

        return Orthotope(*self.bounds())

    def log_volume(self) -> float:
        """Natural logarithm of :meth:`volume`; ``-inf`` for a flat set."""
        volume = self.volume()
        return math.log(volume) if volume > 0 else -math.inf
