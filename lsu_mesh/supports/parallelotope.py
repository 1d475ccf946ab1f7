"""The parallelotope, support of LSUP."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.kernels import filter_step
from lsu_mesh.kernels.parallelotopes import parallelotope, strip_update
from lsu_mesh.kernels.parallelotopes.enclosure import enclose_along_edges
from lsu_mesh.kernels.runtime import linear_algebra
from lsu_mesh.kernels.runtime.scratch import scratch
from lsu_mesh.supports.arrays import corners_are_few, finite_array, frozen
from lsu_mesh.supports.exact import Membership, parallelotope_membership
from lsu_mesh.supports.support import Support

if TYPE_CHECKING:
    from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
    from lsu_mesh.supports.zonotope import Zonotope


class Parallelotope(Support):
    """``{c + T ξ : |ξ|∞ ≤ 1}``; center c (n,), generators T (n, n), singular T (a flat set) is legal.

    Raises ``ModelError`` where shapes do not fit or entries are not finite. Source: Lainová et al. 2019, eq. (7).
    """

    def __init__(self, center: ArrayLike, generators: ArrayLike) -> None:
        self._center = np.array(finite_array("center", center, (None,)))
        n = self._center.size
        if n == 0:
            raise ModelError("a parallelotope needs at least one coordinate")
        self._generators = np.array(finite_array("generators", generators, (n, n)))

    @classmethod
    def trusted(cls, center: Vector, generators: Matrix) -> Parallelotope:
        """A parallelotope of arrays that are known to be right and are never written again; nothing is checked."""
        body = cls.__new__(cls)
        body._center, body._generators = center, generators
        return body

    @property
    def dim(self) -> int:
        return int(self._center.size)

    @property
    def center(self) -> Vector:
        return frozen(self._center.view())

    @property
    def generators(self) -> Matrix:
        """Edges T (n, n), one per column, half as long as the edges of the body."""
        return frozen(self._generators.view())

    def bounds(self) -> tuple[Vector, Vector]:
        lower, upper = np.empty(self.dim), np.empty(self.dim)
        strip_update.hull(self._center, self._generators, np.zeros(self.dim), lower, upper)
        return lower, upper

    def volume(self) -> float:
        return filter_step.volume_of(self._generators, np.empty_like(self._generators))

    def log_volume(self) -> float:
        factor = np.empty_like(self._generators)
        return linear_algebra.log_abs_determinant(self._generators, factor) + self.dim * math.log(2.0)

    def contains(self, x: ArrayLike) -> bool:
        point = finite_array("x", x, (self.dim,))
        lower, upper = self.bounds()
        if (point < lower).any() or (point > upper).any():
            return False
        verdict = parallelotope_membership(self._center, self._generators, point)
        if verdict is Membership.UNDECIDED:
            return self.to_constrained_zonotope().contains(point)
        return verdict is Membership.INSIDE

    def support(self, d: ArrayLike) -> float:
        direction = np.array(finite_array("d", d, (self.dim,)))
        g = np.empty(self.dim)
        s, error, spread = strip_update.project(self._center, self._generators, np.zeros(self.dim), direction, g)
        return float(np.nextafter(np.nextafter(s + spread, np.inf) + error, np.inf))

    def vertices(self) -> Matrix:
        corners_are_few(self.dim)
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=self.dim)))
        return np.unique(self._center + signs @ self._generators.T, axis=0)

    def linear_map(self, R: ArrayLike, shift: ArrayLike | None = None) -> Support:
        matrix = finite_array("R", R, (None, self.dim))
        if matrix.shape[0] == self.dim:
            mapped = self._square_map(np.array(matrix), shift)
            if mapped is not None:
                return mapped
        return self.to_zonotope().linear_map(matrix, shift)

    def _square_map(self, R: Matrix, shift: ArrayLike | None) -> Parallelotope | None:
        """The image along the edges R T, ``None`` where these do not span the space."""
        n = self.dim
        offset = np.zeros(n) if shift is None else np.array(finite_array("shift", shift, (n,)))
        c, T, delta = np.empty(n), np.empty((n, n)), np.empty(n)
        parallelotope.image(self._center, self._generators, R, np.eye(n), offset, c, T, delta)
        if enclose_along_edges(T, T, np.zeros(0), delta, scratch(n, 0)):
            return Parallelotope(c, T)
        return None

    def strips(self) -> tuple[Matrix, Vector, Vector] | None:
        """The faces: P ≈ T⁻¹ (n, n), y, r (n,) with ``|y − P x| ≤ r`` in the set; ``None`` where T is singular."""
        n = self.dim
        P, y, r = np.empty((n, n)), np.empty(n), np.empty(n)
        found = parallelotope.faces(self._center, self._generators, P, y, r, np.empty((n, n)))
        return (P, y, r) if found else None

    def minkowski_sum(self, other: Support) -> Support:
        return self.to_zonotope().minkowski_sum(other)

    def intersect(self, other: Support) -> Support:
        return self.to_constrained_zonotope().intersect(other)

    def is_empty(self) -> bool:
        return False

    def to_zonotope(self) -> Zonotope:
        """The same set as a zonotope."""
        from lsu_mesh.supports.zonotope import Zonotope

        return Zonotope(self._center, self._generators)

    def to_constrained_zonotope(self) -> ConstrainedZonotope:
        from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope

        no_rows = np.zeros((0, self._generators.shape[1]))
        return ConstrainedZonotope.of_arrays(self._center, self._generators, no_rows, np.zeros(0))

    def __repr__(self) -> str:
        return f"Parallelotope(center={self._center.tolist()}, generators={self._generators.tolist()})"
