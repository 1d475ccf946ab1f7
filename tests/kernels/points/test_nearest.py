"""The nearest point of a parallelotope in a box, beside linear programs by HiGHS and exact membership."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh import Parallelotope
from lsu_mesh.kernels.points.nearest import nearest_point
from lsu_mesh.kernels.points.room import room
from lsu_mesh.supports.exact import Membership, parallelotope_membership


def programs(c: np.ndarray, T: np.ndarray, lower: np.ndarray, upper: np.ndarray, m: np.ndarray) -> tuple[float, float]:
    """The least ``max |x − m|/q``, and the least ``Σ |x − m|/q`` at that largest distance."""
    n, q, faces = c.size, 0.5 * (upper - lower), np.linalg.inv(T)
    zero, one, eye = np.zeros((n, n)), np.ones((n, 1)), np.eye(n)
    body = np.block([[faces, zero, 0 * one], [-faces, zero, 0 * one]])
    ends = np.block([[np.diag(1 / q), -eye, 0 * one], [-np.diag(1 / q), -eye, 0 * one], [zero, eye, -one]])
    sides = np.concatenate([1 + faces @ c, 1 - faces @ c, m / q, -m / q, np.zeros(n)])
    limits = [*zip(lower, upper, strict=True), *[(0.0, None)] * (n + 1)]
    rows = np.vstack([body, ends])
    first = linprog(np.r_[np.zeros(2 * n), 1.0], A_ub=rows, b_ub=sides, bounds=limits)
    limits[-1] = (0.0, first.fun * (1 + 1e-9) + 1e-12)
    second = linprog(np.r_[np.zeros(n), np.ones(n), 0.0], A_ub=rows, b_ub=sides, bounds=limits)
    return float(first.fun), float(second.fun)


@pytest.mark.parametrize("seed", range(150))
def test_it_is_the_optimum_and_lies_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 1 + seed % 5
    c, T = rng.normal(size=n), rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-3, 1, n)
    low, high = Parallelotope(c, T).bounds()
    lower, upper = (
        low + (high - low) * rng.uniform(0, 0.4, n),
        high - (high - low) * rng.uniform(0, 0.4, n),
    )
    target = rng.uniform(lower, upper)
    point = target.copy()
    assert nearest_point(c, T, lower, upper, point, room(n))
    assert ((lower <= point) & (point <= upper)).all()
    assert parallelotope_membership(c, T, point) is Membership.INSIDE
    largest, total = programs(c, T, lower, upper, target)
    distances = np.abs(point - target) / (0.5 * (upper - lower))
    assert distances.max() == pytest.approx(largest, abs=1e-7)
    assert distances.sum() == pytest.approx(total, abs=1e-5)


def test_a_target_inside_stays() -> None:
    point = np.array([0.2, -0.1])
    assert nearest_point(np.zeros(2), np.eye(2), -np.ones(2), np.ones(2), point, room(2))
    assert point.tolist() == [0.2, -0.1]


def test_a_flat_coordinate_is_fixed() -> None:
    """An edge of no length: the coordinate is that of the centre, exactly, and the others are still the nearest."""
    c, T = np.array([0.1, 0.3, -0.7]), np.array([[0.5, 0.2, 0.0], [0.0, 0.0, 0.0], [0.1, 0.9, 0.0]])
    lower, upper = Parallelotope(c, T).bounds()
    point = np.array([c[0] + 0.6, 0.3, c[2] - 0.9])
    assert nearest_point(c, T, lower, upper, point, room(3))
    assert point[1] == 0.3
    assert parallelotope_membership(c, T, point) is Membership.INSIDE


@pytest.mark.parametrize("thickness", [1e-3, 1e-9, 1e-12, 1e-15, 1e-30, 0.0])
def test_thin_sets_hold_their_point(thickness: float) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        basis = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        c, T = rng.normal(size=3), basis * np.array([1.0, 0.7, thickness])
        lower, upper = Parallelotope(c, T).bounds()
        point = rng.uniform(lower, upper)
        assert nearest_point(c, T, lower, upper, point, room(3))
        assert Parallelotope(c, T).contains(point)


def test_numbers_that_are_not_finite_prove_nothing() -> None:
    point = np.array([0.5, 0.5])
    T = np.array([[np.nan, 0.0], [0.0, 1.0]])
    nearest_point(np.zeros(2), T, -np.ones(2), np.ones(2), point, room(2))
    assert point.tolist() == [0.0, 0.0]
