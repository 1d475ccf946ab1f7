"""From a set to triangles and edges in three coordinates; flat sets become polygons, segments or points.

For drawing only: floating point throughout, no promise of containment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Array, Indices
from lsu_mesh.mesh.messages import (
    ConstrainedZonotopeMessage,
    IntersectionMessage,
    OrthotopeMessage,
    SupportMessage,
)
from lsu_mesh.mesh.sets import to_support
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope

FLAT = 1e-9
"""A spread below this share of the largest counts as none."""
COPLANAR = 1e-6
"""Facets whose unit normals agree to this are one face, without an edge between them."""

_CORNERS = np.array([[(i >> axis) & 1 for axis in range(3)] for i in range(8)]) * 2.0 - 1.0
_FACES = np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])
_BOX_EDGES = np.array([[a, a | (1 << axis)] for a in range(8) for axis in range(3) if not a >> axis & 1])


class SetGeometry(NamedTuple):
    """Triangles (t, 3, 3), their normals (t, 3) and edges (e, 2, 3)."""

    triangles: Array
    normals: Array
    edges: Array


EMPTY = SetGeometry(np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 2, 3)))


def project(message: SupportMessage, axes: tuple[int, ...]) -> Support:
    """The exact projection of a set onto 1 to 3 coordinates ``axes``: rows are picked, nothing is rounded."""
    rows = list(axes)
    support = to_support(message)
    if isinstance(message, OrthotopeMessage):
        return Orthotope(np.array(message.lower)[rows], np.array(message.upper)[rows])
    if rows == list(range(support.dim)):
        return support
    if isinstance(message, ConstrainedZonotopeMessage | IntersectionMessage):
        joint = support.to_constrained_zonotope()
        return ConstrainedZonotope(joint.center[rows], joint.generators[rows], joint.A, joint.b)
    assert isinstance(support, Zonotope | Parallelotope)
    return Zonotope(support.center[rows], support.generators[rows])


def body(support: Support) -> SetGeometry:
    """Triangles and edges of a set of dimension 1, 2 or 3; missing coordinates are 0."""
    if isinstance(support, Orthotope) and support.dim == 3:
        half = 0.5 * (support.upper - support.lower)
        return _parallelepiped(support.lower + half, np.diag(half))
    if isinstance(support, Parallelotope) and support.dim == 3:
        return _parallelepiped(support.center, support.generators)
    vertices = support.vertices()
    return hull_body(np.pad(vertices, ((0, 0), (0, 3 - support.dim))))


def rectangle(lower: float, upper: float, middle: float, half_height: float) -> SetGeometry:
    """An interval as a bar ``[lower, upper]`` around the height ``middle``."""
    y0, y1 = middle - half_height, middle + half_height
    loop = np.array([[lower, y0, 0.0], [upper, y0, 0.0], [upper, y1, 0.0], [lower, y1, 0.0]])
    triangles = loop[[[0, 1, 2], [0, 2, 3]]]
    return SetGeometry(triangles, _normals(triangles), np.stack([loop, np.roll(loop, -1, axis=0)], axis=1))


def hull_body(points: Array) -> SetGeometry:
    """Triangles and edges of the convex hull of points (k, 3), flat or not."""
    if not len(points):
        return EMPTY
    center = points.mean(axis=0)
    # In the principal frame, stretched to unit spread, a thin set is as easy as a round one.
    _, spreads, frame = np.linalg.svd(points - center, full_matrices=False)
    if len(frame) == 3 and np.linalg.det(frame) < 0:
        frame[2] *= -1.0  # a reflection would turn every facet inside out
    rank = int((spreads > FLAT * max(spreads[0], FLAT * np.abs(points).max())).sum())
    while rank >= 2:
        local = (points - center) @ frame[:rank].T / spreads[:rank]
        found = _polyhedron(points, local) if rank == 3 else _polygon(points, local, frame[2])
        if found is not None:
            return found
        rank -= 1
    along = (points - center) @ frame[0]
    return EMPTY._replace(edges=points[[along.argmin(), along.argmax()]][None])


def _parallelepiped(center: Array, generators: Array) -> SetGeometry:
    corners = center + _CORNERS @ generators.T
    quads = corners[_FACES if np.linalg.det(generators) >= 0 else _FACES[:, ::-1]]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return SetGeometry(triangles, _normals(triangles), corners[_BOX_EDGES])


def _polyhedron(points: Array, local: Array) -> SetGeometry | None:
    hull = _qhull(local)
    if hull is None:
        return None
    corners = local[hull.simplices]
    winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flipped = np.einsum("ij,ij->i", winding, hull.equations[:, :3]) < 0
    simplices = hull.simplices.copy()
    simplices[flipped] = simplices[flipped][:, ::-1]
    triangles = points[simplices]
    return SetGeometry(triangles, _normals(triangles), points[_creases(hull)])


def _creases(hull: _Hull) -> Indices:
    """Pairs of points between facets that are not coplanar; neighbour j of a facet lies opposite its corner j."""
    normals = hull.equations[:, :3]
    facet, corner = np.nonzero(np.einsum("ik,ijk->ij", normals, normals[hull.neighbors]) < 1.0 - COPLANAR)
    once = facet < hull.neighbors[facet, corner]
    facet, corner = facet[once], corner[once]
    rows = np.arange(len(facet))[:, None]
    others = np.array([[1, 2], [0, 2], [0, 1]])[corner]
    return np.asarray(hull.simplices[facet][rows, others], dtype=np.int64)


def _polygon(points: Array, local: Array, normal: Array) -> SetGeometry | None:
    hull = _qhull(local)
    if hull is None:
        return None
    loop = points[hull.vertices]
    fan = np.stack([np.broadcast_to(loop[0], loop[2:].shape), loop[1:-1], loop[2:]], axis=1)
    edges = np.stack([loop, np.roll(loop, -1, axis=0)], axis=1)
    return SetGeometry(fan, np.broadcast_to(normal, (len(fan), 3)), edges)


class _Hull(NamedTuple):
    simplices: Indices
    neighbors: Indices
    equations: Array
    vertices: Indices


def _qhull(local: Array) -> _Hull | None:
    """The convex hull, ``None`` where the points are flat to Qhull's eyes."""
    from scipy.spatial import ConvexHull, QhullError

    if len(local) <= local.shape[1]:
        return None
    try:
        hull = ConvexHull(local)
    except QhullError:
        return None
    return _Hull(hull.simplices, hull.neighbors, hull.equations, hull.vertices)


def _normals(triangles: Array) -> Array:
    """Unit normals (t, 3); of a degenerate triangle the z axis, so that no NaN gets into the drawing."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    safe = lengths > 0
    return np.where(safe, normals / np.where(safe, lengths, 1.0), np.array([0.0, 0.0, 1.0]))
