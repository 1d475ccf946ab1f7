"""The orthotope (box), support of LSUO."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.kernels.runtime.rounding import EPSILON, UNDERFLOW
from lsu_mesh.supports.arrays import box_volume, corners_are_few, finite_array
from lsu_mesh.supports.support import Support

if TYPE_CHECKING:
    from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
    from lsu_mesh.supports.parallelotope import Parallelotope


class Orthotope(Support):
    """Box ``{x : lower ≤ x ≤ upper}``; lower, upper (n,), equal bounds are legal (a flat box).

    Raises ``ModelError`` where the bounds are not finite, differ in length or cross.
    Source: Lainová et al. 2019, eq. (8).
    """

    def __init__(self, lower: ArrayLike, upper: ArrayLike) -> None:
        self.lower = finite_array("lower", lower, (None,))
        self.upper = finite_array("upper", upper, (self.lower.size,))
        if self.lower.size == 0:
            raise ModelError("a box needs at least one coordinate")
        crossed = np.flatnonzero(self.lower > self.upper)
        if crossed.size:
            i = int(crossed[0])
            raise ModelError(f"lower must not exceed upper: [{self.lower[i]}, {self.upper[i]}] in coordinate {i}")

    @classmethod
    def trusted(cls, lower: Vector, upper: Vector) -> Orthotope:
        """A box of bounds that are known to be right and are never written again; nothing is checked or copied."""
        box = cls.__new__(cls)
        box.lower, box.upper = lower.view(), upper.view()
        box.lower.setflags(write=False)
        box.upper.setflags(write=False)
        return box

    @property
    def dim(self) -> int:
        return int(self.lower.size)

    @property
    def center(self) -> Vector:
        return 0.5 * self.lower + 0.5 * self.upper

    @property
    def half_widths(self) -> Vector:
        """q (n,) with ``[center − q, center + q] ⊇ [lower, upper]``; exact where the box is flat or symmetric."""
        center = self.center
        reach = np.maximum(self.upper - center, center - self.lower)
        exact = (reach <= 0) | (self.upper == -self.lower)
        return np.where(exact, reach, reach + (reach * EPSILON + UNDERFLOW))

    def bounds(self) -> tuple[Vector, Vector]:
        return self.lower, self.upper

    def volume(self) -> float:
        return box_volume(self.lower, self.upper)

    def log_volume(self) -> float:
        widths = self.upper - self.lower
        return float(np.log(widths).sum()) if (widths > 0).all() else -np.inf

    def contains(self, x: ArrayLike) -> bool:
        point = finite_array("x", x, (self.dim,))
        return bool((self.lower <= point).all() and (point <= self.upper).all())

    def support(self, d: ArrayLike) -> float:
        direction = finite_array("d", d, (self.dim,))
        products = direction * np.where(direction > 0, self.upper, self.lower)
        error = (self.dim + 3) * EPSILON * np.abs(products).sum() + UNDERFLOW
        return float(products.sum() + error)

    def vertices(self) -> Matrix:
        pairs = [(lo,) if lo == hi else (lo, hi) for lo, hi in zip(self.lower, self.upper, strict=True)]
        corners_are_few(sum(len(pair) > 1 for pair in pairs))
        return np.array(list(itertools.product(*pairs)))

    def linear_map(self, R: ArrayLike, shift: ArrayLike | None = None) -> Support:
        return self.to_parallelotope().linear_map(R, shift)

    def minkowski_sum(self, other: Support) -> Support:
        if isinstance(other, Orthotope):
            _same_dimension(self, other)
            lower, upper = self.lower + other.lower, self.upper + other.upper
            return Orthotope(
                np.where(_sum_is_exact(self.lower, other.lower, lower), lower, np.nextafter(lower, -np.inf)),
                np.where(_sum_is_exact(self.upper, other.upper, upper), upper, np.nextafter(upper, np.inf)),
            )
        return self.to_constrained_zonotope().minkowski_sum(other)

    def intersect(self, other: Support) -> Support:
        if isinstance(other, Orthotope):
            _same_dimension(self, other)
            lower, upper = np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper)
            if (lower <= upper).all():
                return Orthotope(lower, upper)
        return self.to_constrained_zonotope().intersect(other)

    def is_empty(self) -> bool:
        return False

    def to_parallelotope(self) -> Parallelotope:
        """The box as a parallelotope with axis-parallel edges, half-widths rounded up."""
        from lsu_mesh.supports.parallelotope import Parallelotope

        return Parallelotope(self.center, np.diag(self.half_widths))

    def to_constrained_zonotope(self) -> ConstrainedZonotope:
        from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope

        edges = np.diag(self.half_widths)
        return ConstrainedZonotope.of_arrays(self.center, edges, np.zeros((0, self.dim)), np.zeros(0))

    def __repr__(self) -> str:
        return f"Orthotope(lower={self.lower.tolist()}, upper={self.upper.tolist()})"


def _sum_is_exact(a: Vector, b: Vector, total: Vector) -> np.ndarray:
    """Whether ``a + b`` was rounded, by Knuth's exact error term."""
    rest = total - a
    error = (a - (total - rest)) + (b - rest)
    return np.asarray(error == 0.0)


def _same_dimension(one: Support, other: Support) -> None:
    if one.dim != other.dim:
        raise ModelError(f"sets of dimension {one.dim} and {other.dim} do not lie in one space")
