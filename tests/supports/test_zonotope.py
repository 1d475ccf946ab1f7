"""Zonotopes: bounds, volume, membership and algebra."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from lsu_mesh import ConstrainedZonotope, ModelError, Orthotope, Zonotope

HEXAGON = Zonotope([1.0, -1.0], [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5]])


def test_bounds_are_the_row_sums() -> None:
    lower, upper = HEXAGON.bounds()
    assert lower == pytest.approx([-0.5, -2.5], abs=1e-14)
    assert upper == pytest.approx([2.5, 0.5], abs=1e-14)
    assert (lower <= [-0.5, -2.5]).all()
    assert (upper >= [2.5, 0.5]).all()


def test_bounds_of_a_point_are_exact() -> None:
    lower, upper = Zonotope([0.1, 0.2], np.zeros((2, 0))).bounds()
    assert (lower == [0.1, 0.2]).all()
    assert (upper == [0.1, 0.2]).all()


def test_volume_and_vertices_agree_with_the_convex_hull() -> None:
    corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T @ HEXAGON.generators.T + HEXAGON.center
    hull = ConvexHull(corners)
    assert HEXAGON.volume() == pytest.approx(hull.volume, rel=1e-12)
    vertices = HEXAGON.vertices()
    assert len(vertices) == 6
    assert ConvexHull(vertices).volume == pytest.approx(hull.volume, rel=1e-12)


def test_the_volume_of_many_generators_is_that_of_the_hull() -> None:
    G = np.random.default_rng(0).normal(size=(6, 40))
    zonotope = Zonotope(np.zeros(6), G)
    lower, upper = zonotope.bounds()
    assert zonotope.volume() == pytest.approx(np.prod(upper - lower))


@pytest.mark.parametrize(("x", "inside"), [([2.4, 0.4], True), ([2.4, -2.4], False), ([1.0, -1.0], True)])
def test_contains(x: list[float], inside: bool) -> None:
    assert HEXAGON.contains(x) == inside


def test_support_function() -> None:
    assert HEXAGON.support([1.0, 1.0]) == pytest.approx(3.0, abs=1e-13)
    assert HEXAGON.support([1.0, 1.0]) >= 3.0


def test_algebra_keeps_the_class_where_it_can() -> None:
    assert isinstance(HEXAGON.linear_map([[2.0, 0.0]]), Zonotope)
    total = HEXAGON.minkowski_sum(Orthotope([-1.0, -1.0], [1.0, 1.0]))
    assert isinstance(total, Zonotope)
    assert total.bounds()[1] == pytest.approx([3.5, 1.5])
    constrained = ConstrainedZonotope([0.0, 0.0], np.eye(2), [[1.0, 1.0]], [0.0])
    assert isinstance(HEXAGON.minkowski_sum(constrained), ConstrainedZonotope)
    met = HEXAGON.intersect(Orthotope([0.0, -1.0], [5.0, 5.0]))
    assert met.bounds()[0] == pytest.approx([0.0, -1.0])
    assert not HEXAGON.is_empty()


def test_a_wrong_array_is_named() -> None:
    with pytest.raises(ModelError, match="generators must have shape 2"):
        Zonotope([0.0, 0.0], np.eye(3))
    with pytest.raises(ModelError, match="center must hold finite numbers"):
        Zonotope([np.nan], [[1.0]])
    with pytest.raises(ModelError, match="center must have at least one coordinate"):
        Zonotope([], [])


def test_the_arrays_cannot_be_changed_from_outside() -> None:
    with pytest.raises(ValueError, match="read-only"):
        HEXAGON.center[0] = 5.0
    G = np.eye(2)
    zonotope = Zonotope([0.0, 0.0], G)
    G[0, 0] = 7.0
    assert zonotope.generators[0, 0] == 1.0
