"""Zonotopes: Minkowski sums of line segments."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.kernels.zonotopes.zonotope import (
    absorb_box,
    parallelotope_volumes,
    zonotope_map,
    zonotope_radius,
    zonotope_support,
)
from lsu_mesh.supports.arrays import box_volume, finite_array, frozen, map_arguments
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.support import Support

MAX_SUM = 500_000
"""Determinants that :meth:`Zonotope.volume` is ready to sum."""


class Zonotope(Support):
    """``{c + G ξ : |ξ|∞ ≤ 1}``.

    Parameters
    ----------
    center:
        c, (n,).
    generators:
        G, (n, g); g = 0 is a point.

    Raises
    ------
    ModelError
        Names the array whose shape or numbers are wrong.
    """

    def __init__(self, center: ArrayLike, generators: ArrayLike) -> None:
        self._center = np.array(finite_array("center", center, (None,)))
        n = self._center.size
        if n == 0:
            raise ModelError("center must have at least one coordinate, it is empty")
        columns = np.asarray(generators)
        columns = np.zeros((n, 0)) if columns.size == 0 else columns
        self._generators = np.array(finite_array("generators", columns, (n, None)))

    @classmethod
    def of_arrays(cls, center: Vector, generators: Matrix) -> Zonotope:
        """A set of writable contiguous arrays that kernels made: no copy, no check."""
        made = cls.__new__(cls)
        made._center, made._generators = center, generators
        return made

    @property
    def dim(self) -> int:
        """n"""
        return int(self._center.size)

    @property
    def center(self) -> Vector:
        """c, (n,)"""
        return frozen(self._center.view())

    @property
    def generators(self) -> Matrix:
        """G, (n, g)"""
        return frozen(self._generators.view())

    def bounds(self) -> tuple[Vector, Vector]:
        """``c ± Σ_j |G_j|``, rounded outward."""
        radius = zonotope_radius(self._generators)
        lower, upper = self._center - radius, self._center + radius
        moved = radius > 0
        lower = np.where(moved, np.nextafter(lower, -np.inf), lower)
        upper = np.where(moved, np.nextafter(upper, np.inf), upper)
        return frozen(lower), frozen(upper)

    def volume(self) -> float:
        """``2ⁿ Σ |det G_S|`` over the n-subsets of columns; above 500 000 of them the volume of the interval hull."""
        if math.comb(self._generators.shape[1], self.dim) > MAX_SUM:
            return box_volume(*self.bounds())
        return float(parallelotope_volumes(self._generators))

    def support(self, d: ArrayLike) -> float:
        """``d'c + Σ_j |d'G_j|``, d (n,), rounded up."""
        return float(zonotope_support(self._center, self._generators, np.array(finite_array("d", d, (self.dim,)))))

    def contains(self, x: ArrayLike) -> bool:
        """``False`` only where a separating direction is proved."""
        return self.to_constrained_zonotope().contains(x)

    def is_empty(self) -> bool:
        """``False``: a zonotope holds its centre."""
        return False

    def vertices(self) -> Matrix:
        """Vertices (k, n), by refinement with support points."""
        return self.to_constrained_zonotope().vertices()

    def linear_map(self, R: ArrayLike, shift: ArrayLike | None = None) -> Zonotope:
        """``{R c + shift, R G}`` and the box of its rounding; R (k, n), shift (k,)."""
        matrix, offset = map_arguments(R, shift, self.dim)
        center, generators, slack = zonotope_map(matrix, self._center, self._generators, offset)
        generators, _ = absorb_box(generators, np.zeros((0, generators.shape[1])), slack)
        return Zonotope(center, generators)

    def minkowski_sum(self, other: Support) -> Support:
        """``{c + c₂, [G G₂]}`` and the box of its rounding; a constrained zonotope where ``other`` has constraints."""
        total = self.to_constrained_zonotope().minkowski_sum(other)
        return total if total.constraint_count else Zonotope(total.center, total.generators)

    def intersect(self, other: Support) -> ConstrainedZonotope:
        """``self ∩ other`` as a constrained zonotope."""
        return self.to_constrained_zonotope().intersect(other)

    def to_constrained_zonotope(self) -> ConstrainedZonotope:
        """The same set, without constraints; exact."""
        g = self._generators.shape[1]
        return ConstrainedZonotope.of_arrays(self._center, self._generators, np.zeros((0, g)), np.zeros(0))

    def __repr__(self) -> str:
        return f"Zonotope(dim={self.dim}, generators={self._generators.shape[1]})"
