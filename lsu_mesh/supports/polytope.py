"""Vertices and volume of a bounded convex set that is known by its support points.

Refinement: the convex hull of the known points is an inner approximation; each of its facets is either confirmed by the
support point in the direction of its normal or gives a new vertex. For a polytope this ends with its vertices.
It works in coordinates in which a large inscribed simplex is the unit simplex, so thin sets are as easy as round ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

SupportPoints = Callable[[Matrix], Matrix]
"""Directions (k, n) → a point of the set (k, n) that is farthest in each."""
Surface = Callable[[Matrix, Vector, Matrix], Matrix]
"""``(M, origin, corners)`` → vertices ``M x − origin`` (k, 3) of a solid, from the corners of an inscribed simplex."""

FLAT = 1e-11
"""A width below this share of the largest width counts as none."""
CONFIRMED = 1e-9
"""A facet is confirmed when no point lies farther than this, in units of the inscribed simplex."""
MAX_VERTICES = 6_000
"""Where more are found the enumeration stops: in dimension five and six a small set can have millions."""
MAX_FACETS = 400_000
"""Facets of all rounds together at which it stops too: some seconds of work, whatever the set."""
MAX_DIMENSION = 8
"""Sets that span more dimensions are not enumerated: their simplest hulls have too many facets."""


class Polytope(NamedTuple):
    """Vertices (k, n) and the n-dimensional volume: 0 for a flat set, NaN where the enumeration was stopped."""

    vertices: Matrix
    volume: float


def enumerate_polytope(support_points: SupportPoints, n: int, surface: Surface | None = None) -> Polytope:
    """The polytope whose support points are given; n ≥ 1. ``surface`` may find most vertices of a solid in one go.

    Raises ``ModelError`` where the set spans more than eight dimensions.
    """
    points, simplex = _inscribed_simplex(support_points, n)
    k = simplex.shape[0] - 1
    if k > MAX_DIMENSION:
        raise ModelError(
            f"the vertices of a set are enumerated up to dimension {MAX_DIMENSION}, it spans {k}: "
            "project it first, as in support.linear_map([[1, 0, …], [0, 1, …]])"
        )
    if k == 0:
        return Polytope(points[simplex], 0.0)
    origin = points[simplex[0]]
    edges = (points[simplex[1:]] - origin).T
    inverse = np.linalg.pinv(edges)
    local = (points - origin) @ inverse.T
    if k == 1:
        ends = [int(local[:, 0].argmin()), int(local[:, 0].argmax())]
        length = float(local[ends[1], 0] - local[ends[0], 0]) * float(np.linalg.norm(edges))
        return Polytope(points[ends], length if n == 1 else 0.0)
    if k == 3 and surface is not None:
        local = surface(inverse, inverse @ origin, local[simplex])
        points = origin + local @ edges.T
    else:
        distinct = _distinct(local, np.empty((0, k)))
        points, local = points[distinct], local[distinct]
    points, indices, volume = _refine(support_points, points, local, inverse=inverse, origin=origin)
    with np.errstate(over="ignore"):  # a volume may be too large for a double
        scale = abs(float(np.linalg.det(edges))) if k == n else 0.0
    return Polytope(points[indices], volume * scale)


def _inscribed_simplex(support_points: SupportPoints, n: int) -> tuple[Matrix, NDArray[np.int64]]:
    """Support points and the indices of k + 1 of them that span the set's affine hull, far from degenerate."""
    axes = np.vstack([np.eye(n), -np.eye(n)])
    points = support_points(axes)
    spans = points[:n] - points[n:]
    widest = int(np.abs(np.diag(spans)).argmax())
    largest = float(np.abs(np.diag(spans)).max())
    chosen = [n + widest]
    basis: list[Vector] = []
    while len(basis) < n and largest > 0.0:
        residual = _orthogonal_to(points - points[chosen[0]], basis)
        far = np.einsum("ij,ij->i", residual, residual)
        best = int(far.argmax())
        if math.sqrt(far[best]) <= 1e-3 * largest:
            points = np.vstack([points, support_points(_complement(basis, n))])
            residual = _orthogonal_to(points - points[chosen[0]], basis)
            far = np.einsum("ij,ij->i", residual, residual)
            best = int(far.argmax())
        distance = math.sqrt(far[best])
        if distance <= FLAT * largest:
            break
        chosen.append(best)
        basis.append(residual[best] / distance)
    return points, np.array(chosen)


def _orthogonal_to(vectors: Matrix, basis: list[Vector]) -> Matrix:
    for _ in range(2):  # twice is enough for full orthogonality
        for unit in basis:
            vectors = vectors - np.outer(vectors @ unit, unit)
    return vectors


def _complement(basis: list[Vector], n: int) -> Matrix:
    """An orthonormal basis of the complement, each direction with both signs."""
    if not basis:
        return np.vstack([np.eye(n), -np.eye(n)])
    _, _, right = np.linalg.svd(np.array(basis))
    rest = right[len(basis) :]
    return np.vstack([rest, -rest])


def _refine(
    support_points: SupportPoints, points: Matrix, local: Matrix, inverse: Matrix, origin: Vector
) -> tuple[Matrix, NDArray[np.int64], float]:
    asked: set[tuple[float, ...]] = set()
    seen = 0
    while True:
        hull = _convex_hull(local)
        seen += len(hull.equations)
        facets = {tuple(row) for row in np.round(hull.equations, 9).tolist()} - asked
        if not facets:
            break
        planes = np.array(sorted(facets))
        found = support_points(planes[:, :-1] @ inverse)
        found_local = (found - origin) @ inverse.T
        beyond = np.einsum("ij,ij->i", found_local, planes[:, :-1]) + planes[:, -1] > CONFIRMED
        # Every facet is asked once: where rounding alone puts its answer beyond it, asking again would never end.
        asked |= facets
        fresh = np.flatnonzero(beyond)[_distinct(found_local[beyond], local)]
        if fresh.size == 0:
            break
        if len(local) + fresh.size > MAX_VERTICES or seen + _facets_expected(hull, fresh.size) > MAX_FACETS:
            return points, np.asarray(hull.vertices, dtype=np.int64), math.nan
        points, local = np.vstack([points, found[fresh]]), np.vstack([local, found_local[fresh]])
    return points, np.asarray(hull.vertices, dtype=np.int64), float(hull.volume)


def _facets_expected(hull: ConvexHull, more: int) -> float:
    """Facets of the hull with so many vertices more, by the growth of random polytopes."""
    known = len(hull.vertices)
    return float(len(hull.equations) * ((known + more) / known) ** max(1.0, hull.points.shape[1] / 4))


def _convex_hull(points: Matrix) -> ConvexHull:
    """Qhull's hull, joggled only where merging nearly coplanar facets defeats it: for drawing and measuring."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except QhullError:
        return ConvexHull(points, qhull_options="QJ")


def _distinct(new: Matrix, known: Matrix) -> NDArray[np.int64]:
    """Indices of the new points that are farther than ``CONFIRMED`` from the known ones and from each other."""
    from scipy.spatial import KDTree

    if not len(new):
        return np.zeros(0, dtype=np.int64)
    repeated = {second for _, second in KDTree(new).query_pairs(CONFIRMED, p=np.inf)}
    if len(known):
        nearest, _ = KDTree(known).query(new, p=np.inf)
        repeated.update(np.flatnonzero(nearest <= CONFIRMED).tolist())
    return np.array([i for i in range(len(new)) if i not in repeated], dtype=np.int64)
