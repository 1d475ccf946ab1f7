"""Bodies for drawing: right vertices, edges and faces, for every kind of set, flat or not."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lsu_mesh_services.recording.set_geometry import SetGeometry, body, hull_body, project, rectangle
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from lsu_mesh.mesh.messages import SupportMessage
from lsu_mesh.mesh.sets import to_message
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope

CUBE = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def corners(drawn: SetGeometry) -> set[tuple[float, ...]]:
    """Distinct corners of the triangles."""
    return {tuple(point) for point in np.round(drawn.triangles.reshape(-1, 3), 9) + 0.0}


def enclosed_volume(drawn: SetGeometry) -> float:
    """Volume by the divergence theorem: right only if all triangles are there and wound outward."""
    a, b, c = np.moveaxis(drawn.triangles, 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def test_a_box_has_eight_corners_and_twelve_edges() -> None:
    drawn = body(Orthotope([0, 1, 2], [1, 3, 5]))
    assert corners(drawn) == set(itertools.product((0.0, 1.0), (1.0, 3.0), (2.0, 5.0)))
    assert enclosed_volume(drawn) == pytest.approx(6.0)
    assert drawn.edges.shape == (12, 2, 3)
    assert sorted(np.linalg.norm(drawn.edges[:, 1] - drawn.edges[:, 0], axis=1)) == pytest.approx(
        [1, 1, 1, 1] + [2] * 4 + [3] * 4
    )


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_a_parallelepiped_is_wound_outward_whatever_the_sign_of_its_edges(mirrored: float) -> None:
    generators = np.array([[mirrored, 0.3, 0.0], [0.0, 0.5, 0.2], [0.1, 0.0, 2.0]])
    drawn = body(Parallelotope([1, 2, 3], generators))
    assert enclosed_volume(drawn) == pytest.approx(8 * abs(np.linalg.det(generators)))
    expected = [1, 2, 3] + CUBE @ generators.T
    assert corners(drawn) == {tuple(point) for point in np.round(expected, 9) + 0.0}
    outward = np.einsum("ij,ij->i", drawn.normals, drawn.triangles[:, 0] - np.array([1, 2, 3]))
    assert (outward > 0).all()


def test_the_edges_of_a_cut_cube_leave_out_the_diagonals_of_its_faces() -> None:
    cut = Orthotope([-1] * 3, [1] * 3).intersect(Orthotope([-2] * 3, [0.5, 2, 2]))
    drawn = body(Intersection([cut.to_constrained_zonotope(), Orthotope([-1] * 3, [1] * 3)]))
    assert corners(drawn) == set(itertools.product((-1.0, 0.5), (-1.0, 1.0), (-1.0, 1.0)))
    assert len(drawn.edges) == 12
    assert enclosed_volume(drawn) == pytest.approx(6.0)


@given(st.integers(0, 2**32 - 1), st.integers(4, 40))
def test_the_hull_of_points_has_their_volume_and_touches_only_them(seed: int, count: int) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [1.0, 1e-3, 50.0] + [5.0, 1e3, -2.0]
    drawn = hull_body(points)
    centered = drawn._replace(triangles=drawn.triangles - points.mean(axis=0))
    assert enclosed_volume(centered) == pytest.approx(ConvexHull(points).volume, rel=1e-6)
    assert corners(drawn) <= {tuple(point) for point in np.round(points, 9) + 0.0}
    assert np.isfinite(drawn.normals).all()
    assert np.linalg.norm(drawn.normals, axis=1) == pytest.approx(np.ones(len(drawn.normals)))


@pytest.mark.parametrize(
    ("support", "triangles", "edges"),
    [
        (Orthotope([1, 1, 1], [1, 1, 1]), None, 12),  # a point as a box of no size
        (Zonotope([1, 1, 1], np.zeros((3, 0))), 0, 1),
        (Zonotope([0, 0, 0], [[1.0], [2.0], [0.0]]), 0, 1),  # a segment
        (Zonotope([0, 0, 0], [[1.0, 0.0], [2.0, 1.0], [0.0, 1.0]]), 2, 4),  # a parallelogram
        (ConstrainedZonotope([0, 0, 0], np.eye(3), [[1.0, 1.0, 1.0]], [0.0]), 4, 6),  # a hexagon
        (ConstrainedZonotope([0, 0, 0], np.eye(3), [[1.0, 1.0, 1.0]], [3.0]), 0, 1),  # one corner
        (ConstrainedZonotope([0, 0, 0], np.eye(3), [[1.0, 1.0, 1.0]], [4.0]), 0, 0),  # empty
        (Zonotope([3], [[0.5, 0.25]]), 0, 1),
        (Orthotope([1, 2], [3, 5]), 2, 4),
        (Parallelotope([1, 2], [[1.0, 1.0], [0.0, 0.0]]), 0, 1),
    ],
)
def test_flat_and_small_sets(support: Support, triangles: int | None, edges: int) -> None:
    drawn = body(support)
    assert triangles is None or len(drawn.triangles) == triangles
    assert len(drawn.edges) == edges
    assert np.isfinite(drawn.triangles).all()
    assert np.isfinite(drawn.normals).all()
    lower, upper = (np.zeros(0), np.zeros(0)) if support.is_empty() else support.bounds()
    if edges:
        found = drawn.edges.reshape(-1, 3)[:, : support.dim]
        assert found.min(axis=0) == pytest.approx(lower, abs=1e-9)
        assert found.max(axis=0) == pytest.approx(upper, abs=1e-9)


@pytest.mark.parametrize("thickness", [10.0**-e for e in range(0, 20, 3)])
def test_ever_thinner_sets_stay_drawable(thickness: float) -> None:
    frame = np.linalg.qr(np.arange(9.0).reshape(3, 3) + np.eye(3))[0]
    drawn = hull_body(CUBE @ np.diag([1.0, 1.0, thickness]) @ frame.T + 10)
    assert np.isfinite(drawn.normals).all()
    assert len(drawn.edges) >= 4
    spread = np.ptp(drawn.edges.reshape(-1, 3) @ frame, axis=0)
    assert spread[:2] == pytest.approx([2, 2], rel=1e-6)


def sets_in_five_dimensions() -> list[SupportMessage]:
    rng = np.random.default_rng(5)
    center, square, wide = rng.normal(size=5), rng.normal(size=(5, 5)), rng.normal(size=(5, 8))
    A = rng.normal(size=(2, 8))
    constrained = ConstrainedZonotope(center, wide, A, A @ rng.uniform(-0.5, 0.5, 8))
    box = Orthotope(center - 1, center + 1)
    return [
        to_message(one)
        for one in (
            box,
            Parallelotope(center, square),
            Zonotope(center, wide),
            constrained,
            Intersection([constrained, box]),
        )
    ]


@pytest.mark.parametrize("message", sets_in_five_dimensions(), ids=lambda message: type(message).__name__)
@pytest.mark.parametrize("axes", [(0, 1, 2), (4, 0, 3), (2, 1), (3,)])
def test_projection_is_exact(message: SupportMessage, axes: tuple[int, ...]) -> None:
    """Support functions agree: max d'Px over the set is max (P'd)'x."""
    from lsu_mesh.mesh.sets import to_support

    whole, projected = to_support(message), project(message, axes)
    assert projected.dim == len(axes)
    vertices = projected.vertices()
    for direction in np.random.default_rng(1).normal(size=(20, len(axes))):
        lifted: NDArray[np.float64] = np.zeros(5)
        lifted[list(axes)] = direction
        assert (vertices @ direction).max() == pytest.approx(whole.support(lifted), rel=1e-6, abs=1e-6)


def test_a_bar_is_a_rectangle() -> None:
    drawn = rectangle(-1.0, 2.0, 0.5, 0.1)
    assert corners(drawn) == {(-1.0, 0.4, 0.0), (2.0, 0.4, 0.0), (2.0, 0.6, 0.0), (-1.0, 0.6, 0.0)}
    assert len(drawn.edges) == 4
