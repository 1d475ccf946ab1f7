"""Constrained zonotopes: any bounded polytope, closed under maps, sums and intersections."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.kernels.linear_programs.safe_maxima import open_program
from lsu_mesh.kernels.linear_programs.vertex_enumeration import split_triangles
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_sets, meet_strips
from lsu_mesh.kernels.zonotopes.zonotope import absorb_box, add_centers, zonotope_map, zonotope_radius
from lsu_mesh.supports.arrays import box_volume, finite_array, frozen, map_arguments
from lsu_mesh.supports.exact import Membership
from lsu_mesh.supports.exact_program import exact_solution
from lsu_mesh.supports.linear_programs import is_proved_empty, safe_maxima
from lsu_mesh.supports.polytope import Polytope, enumerate_polytope
from lsu_mesh.supports.support import Support

MAX_POINTS = 2000
"""Vertices that are looked for in one go in three dimensions; those beyond are found in rounds."""
MAX_EXACT_VOLUME = 6
"""Dimension up to which :meth:`ConstrainedZonotope.volume` is that of the exact polytope."""


class ConstrainedZonotope(Support):
    """``{c + G ξ : |ξ|∞ ≤ 1, A ξ = b}``.

    Parameters
    ----------
    center:
        c, (n,).
    generators:
        G, (n, g); g = 0 is a point.
    A, b:
        (m, g) and (m,); m = 0 is a zonotope.

    Raises
    ------
    ModelError
        Names the array whose shape or numbers are wrong.

    The arrays are copied and read as exact numbers. Source: Scott et al. 2016; P2023, eq. (7).
    """

    def __init__(self, center: ArrayLike, generators: ArrayLike, A: ArrayLike, b: ArrayLike) -> None:
        self._center = np.array(finite_array("center", center, (None,)))
        n = self._center.size
        if n == 0:
            raise ModelError("center must have at least one coordinate, it is empty")
        self._generators = np.array(finite_array("generators", _two_dimensional(generators, n), (n, None)))
        g = self._generators.shape[1]
        self._A = np.array(finite_array("A", _two_dimensional(A, None, g), (None, g)))
        self._b = np.array(finite_array("b", b, (self._A.shape[0],)))
        self._bounds: tuple[Vector, Vector] | None = None

    @classmethod
    def of_arrays(cls, center: Vector, generators: Matrix, A: Matrix, b: Vector) -> ConstrainedZonotope:
        """A set of writable contiguous arrays that kernels made: no copy, no check."""
        made = cls.__new__(cls)
        made._center, made._generators, made._A, made._b = center, generators, A, b
        made._bounds = None
        return made

    @property
    def dim(self) -> int:
        """n"""
        return int(self._center.size)

    @property
    def center(self) -> Vector:
        """c, (n,): the centre of the generators' box; it need not lie in the set."""
        return frozen(self._center.view())

    @property
    def generators(self) -> Matrix:
        """G, (n, g)"""
        return frozen(self._generators.view())

    @property
    def A(self) -> Matrix:
        """Constraint matrix (m, g)."""
        return frozen(self._A.view())

    @property
    def b(self) -> Vector:
        """Constraint sides (m,)."""
        return frozen(self._b.view())

    @property
    def arrays(self) -> tuple[Vector, Matrix, Matrix, Vector]:
        """(c, G, A, b) for kernels; not to be written."""
        return self._center, self._generators, self._A, self._b

    @property
    def generator_count(self) -> int:
        """g"""
        return int(self._generators.shape[1])

    @property
    def constraint_count(self) -> int:
        """m"""
        return int(self._b.size)

    def bounds(self) -> tuple[Vector, Vector]:
        """Interval hull by 2n linear programs with safe dual bounds; ``InconsistentData`` on a set proved empty."""
        if self._bounds is None:
            maxima = safe_maxima(np.vstack([self._generators, -self._generators]), self._A, self._b)
            n = self.dim
            upper = np.nextafter(self._center + maxima.values[:n], np.inf)
            lower = np.nextafter(self._center - maxima.values[n:], -np.inf)
            if maxima.empty or (lower > upper).any():
                raise InconsistentData("the set is proved to be empty: it has no bounds")
            self._bounds = frozen(lower), frozen(upper)
        return self._bounds

    def support(self, d: ArrayLike) -> float:
        """``max {d'x}``, d (n,), by one linear program with a safe dual bound; rounded up."""
        direction = finite_array("d", d, (self.dim,))
        return float(self.ranges(direction[None, :])[1][0])

    def ranges(self, P: ArrayLike) -> tuple[Vector, Vector]:
        """``min`` and ``max`` of ``P_i x`` for each row of P (k, n): (k,), (k,), rounded outward."""
        rows, offset = map_arguments(P, None, self.dim)
        middle, objectives, slack = zonotope_map(rows, self._center, self._generators, offset)
        maxima = safe_maxima(np.vstack([objectives, -objectives]), self._A, self._b).values
        k = rows.shape[0]
        upper = np.nextafter(np.nextafter(middle + maxima[:k], np.inf) + slack, np.inf)
        lower = np.nextafter(np.nextafter(middle - maxima[k:], -np.inf) - slack, -np.inf)
        return lower, upper

    def contains(self, x: ArrayLike) -> bool:
        """``False`` only where a separating direction is proved by a Farkas ray of ``G ξ = x − c, A ξ = b``."""
        point = np.array(finite_array("x", x, (self.dim,)))
        rows, sides = self._system(point)
        return not is_proved_empty(rows, sides)

    def membership(self, x: Sequence[float | Fraction]) -> Membership:
        """``INSIDE`` or ``OUTSIDE``, proved in exact rational arithmetic; x (n,) may hold fractions. Milliseconds."""
        exact = [Fraction(entry) for entry in x]
        rows, sides = self._system(np.array([float(entry) for entry in exact]))
        g = self.generator_count
        near = safe_maxima(np.zeros((1, rows.shape[1])), rows, sides).points[0, :g]
        A = [[Fraction(a) for a in row] for row in (*self._generators.tolist(), *self._A.tolist())]
        b = [entry - Fraction(c) for entry, c in zip(exact, self._center.tolist(), strict=True)]
        b += [Fraction(side) for side in self._b.tolist()]
        found = exact_solution(A, b, near.tolist())
        return Membership.OUTSIDE if found is None else Membership.INSIDE

    def _system(self, point: Vector) -> tuple[Matrix, Vector]:
        """Rows and sides of ``A ξ = b``, ``G ξ = x − c``, with slack for the rounded difference."""
        n = self.dim
        _, rows, sides = meet_sets(*self.arrays, point, np.zeros((n, 0)), np.zeros((0, 0)), np.zeros(0))
        return rows, sides

    def is_empty(self) -> bool:
        """``True`` only with a verified Farkas ray of ``A ξ = b, |ξ|∞ ≤ 1``."""
        return is_proved_empty(self._A, self._b)

    def volume(self) -> float:
        """Volume of the exact polytope up to dimension 6; of the interval hull beyond it, or with too many faces."""
        if self.is_empty():
            return 0.0
        exact = self._polytope().volume if self.dim <= MAX_EXACT_VOLUME else math.nan
        return box_volume(*self.bounds()) if math.isnan(exact) else exact

    def vertices(self) -> Matrix:
        """Vertices (k, n) by refinement with support points; (0, n) for a set proved empty."""
        return self._polytope().vertices

    def nearest_to_center(self) -> Vector:
        """The point (n,) of the set with the least ``max_i |x_i − c_i| / Σ_j |G_ij|`` (P2023, Method 2).

        One linear program over ξ, the distance ``t = (1 + τ)/2`` and slacks ``s = 1 + σ`` of
        ``± (G ξ)_i / radius_i − t + s_i = 0``.
        """
        n, g, m = self.dim, self.generator_count, self.constraint_count
        radius = zonotope_radius(self._generators)
        scaled = self._generators / np.where(radius > 0, radius, 1.0)[:, None]
        A = np.zeros((m + 2 * n, g + 1 + 2 * n))
        A[:m, :g] = self._A
        A[m : m + n, :g], A[m + n :, :g] = scaled, -scaled
        A[m:, g] = -0.5
        A[m:, g + 1 :] = np.eye(2 * n)
        objective = np.zeros((1, g + 1 + 2 * n))
        objective[0, g] = -1.0
        xi = safe_maxima(objective, A, np.concatenate([self._b, np.full(2 * n, -0.5)])).points[0, :g]
        return self._center + self._generators @ xi

    def _polytope(self) -> Polytope:
        if self.is_empty():
            return Polytope(np.zeros((0, self.dim)), 0.0)
        exact = enumerate_polytope(self._offsets, self.dim, self._surface)
        return Polytope(self._center + exact.vertices, exact.volume)

    def _surface(self, M: Matrix, origin: Vector, corners: Matrix) -> Matrix:
        """Vertices ``M G ξ − origin`` (k, 3) of a solid, from the corners of an inscribed simplex."""
        _, program = open_program(self._A, self._b)
        return split_triangles(program, M @ self._generators, origin, corners, MAX_POINTS)

    def _offsets(self, directions: Matrix) -> Matrix:
        """Points ``G ξ`` farthest in the directions (k, n): floating-point answers, for drawing and measuring."""
        points = safe_maxima(directions @ self._generators, self._A, self._b).points
        return points @ self._generators.T

    def linear_map(self, R: ArrayLike, shift: ArrayLike | None = None) -> ConstrainedZonotope:
        """``{R c + shift, R G, A, b}`` (P2023 (11)) and the box of its rounding; R (k, n), shift (k,)."""
        matrix, offset = map_arguments(R, shift, self.dim)
        center, generators, slack = zonotope_map(matrix, self._center, self._generators, offset)
        generators, A = absorb_box(generators, self._A, slack)
        return ConstrainedZonotope.of_arrays(center, generators, A, self._b)

    def minkowski_sum(self, other: Support) -> ConstrainedZonotope:
        """``{[G G₂], c + c₂, blockdiag(A, A₂), [b; b₂]}`` (P2023 (12)) and the box of its rounding."""
        _same_dimension(self, other)
        added = other.to_constrained_zonotope()
        center, slack = add_centers(self._center, added._center)
        g = self.generator_count
        A = np.zeros((self.constraint_count + added.constraint_count, g + added.generator_count))
        A[: self.constraint_count, :g] = self._A
        A[self.constraint_count :, g:] = added._A
        generators, A = absorb_box(np.hstack([self._generators, added._generators]), A, slack)
        return ConstrainedZonotope.of_arrays(center, generators, A, np.concatenate([self._b, added._b]))

    def intersect(self, other: Support) -> ConstrainedZonotope:
        """``Z ∩ Y`` (P2023 (13), R = I): n constraints more; what is proved empty says so in :meth:`is_empty`."""
        _same_dimension(self, other)
        met = other.to_constrained_zonotope()
        arrays = meet_sets(
            self._center, self._generators, self._A, self._b, met._center, met._generators, met._A, met._b
        )
        return ConstrainedZonotope.of_arrays(self._center, *arrays)

    def meet_strips(self, P: ArrayLike, middle: ArrayLike, radius: ArrayLike) -> ConstrainedZonotope:
        """``{x ∈ Z : |P_i x − middle_i| ≤ radius_i}``, P (k, n), middle (k,) with NaN for no strip, radius (k,) ≥ 0."""
        rows = np.array(finite_array("P", P, (None, self.dim)))
        k = rows.shape[0]
        half = np.array(finite_array("radius", radius, (k,)))
        centers: NDArray[np.float64] = np.array(middle, dtype=np.float64).reshape(k)
        arrays = meet_strips(self._center, self._generators, self._A, self._b, rows, centers, half)
        return ConstrainedZonotope.of_arrays(self._center, *arrays)

    def to_constrained_zonotope(self) -> ConstrainedZonotope:
        """The set itself."""
        return self

    def __repr__(self) -> str:
        size = f"generators={self.generator_count}, constraints={self.constraint_count}"
        return f"ConstrainedZonotope(dim={self.dim}, {size})"


def _two_dimensional(value: ArrayLike, rows: int | None, columns: int | None = None) -> ArrayLike:
    """An empty list stands for a matrix without columns or without rows."""
    array = np.asarray(value)
    if array.size == 0 and array.ndim < 2:
        return np.zeros((0 if rows is None else rows, 0 if columns is None else columns))
    return value


def _same_dimension(one: Support, other: Support) -> None:
    if one.dim != other.dim:
        raise ModelError(f"both sets must have the same dimension, they have {one.dim} and {other.dim}")
