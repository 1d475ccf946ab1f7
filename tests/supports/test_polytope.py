"""Vertices and volume from support points, for round, thin and flat sets."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh.supports.polytope import enumerate_polytope


def _support_points_of(vertices: np.ndarray):  # type: ignore[no-untyped-def]
    return lambda directions: vertices[np.argmax(directions @ vertices.T, axis=1)]


def _same_points(one: np.ndarray, other: np.ndarray) -> bool:
    return len(one) == len(other) and all(np.abs(other - point).max(axis=1).min() < 1e-9 for point in one)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_a_skewed_box(n: int) -> None:
    rng = np.random.default_rng(n)
    T = rng.normal(size=(n, n))
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * n)).reshape(n, -1).T @ T.T
    exact = enumerate_polytope(_support_points_of(corners), n)
    assert exact.volume == pytest.approx(2.0**n * abs(np.linalg.det(T)), rel=1e-9)
    assert _same_points(exact.vertices, corners)


@pytest.mark.parametrize("thickness", [1e-3, 1e-6, 1e-9])
def test_a_thin_set_keeps_its_volume(thickness: float) -> None:
    corners = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-thickness, thickness])).reshape(3, -1).T
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    exact = enumerate_polytope(_support_points_of(corners @ turn.T), 3)
    assert exact.volume == pytest.approx(8 * thickness, rel=1e-5)
    assert len(exact.vertices) == 8


@pytest.mark.parametrize("flat_axes", [1, 2, 3])
def test_a_flat_set_has_vertices_and_no_volume(flat_axes: int) -> None:
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    corners[:, :flat_axes] = 0.3
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    exact = enumerate_polytope(_support_points_of(corners @ turn.T), 3)
    assert exact.volume == 0.0
    assert len(exact.vertices) == 2 ** (3 - flat_axes)
