"""Constrained zonotopes: every operation against half-spaces, HiGHS and exact rationals."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from lsu_mesh import ConstrainedZonotope, InconsistentData, ModelError, Orthotope, Parallelotope, Zonotope
from lsu_mesh.supports.exact import Membership

TRIANGLE = ConstrainedZonotope([0.0, 0.0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0.5, 0.5, -1.0]], [-0.5])
"""``|x|∞ ≤ 1`` and ``ξ₃ = (x₁ + x₂ + 1)/2 ≤ 1``: the triangle's cut corner is ``x₁ + x₂ > 1``, and ``x₁ + x₂ ≥ −3``."""


def _random_set(rng: np.random.Generator, n: int, g: int, m: int) -> ConstrainedZonotope:
    A = rng.normal(size=(m, g))
    return ConstrainedZonotope(rng.normal(size=n), rng.normal(size=(n, g)), A, A @ rng.uniform(-0.8, 0.8, g))


def _highs_maximum(z: ConstrainedZonotope, d: np.ndarray) -> float:
    rows = z.A if z.constraint_count else None
    answer = linprog(-(d @ z.generators), A_eq=rows, b_eq=z.b if rows is not None else None, bounds=(-1, 1))
    return float(d @ z.center - answer.fun)


def test_a_known_set() -> None:
    lower, upper = TRIANGLE.bounds()
    assert lower == pytest.approx([-1.0, -1.0], abs=1e-13)
    assert upper == pytest.approx([1.0, 1.0], abs=1e-13)
    assert TRIANGLE.support([1.0, 1.0]) == pytest.approx(1.0, abs=1e-13)
    assert TRIANGLE.volume() == pytest.approx(4.0 - 0.5, rel=1e-9)
    assert len(TRIANGLE.vertices()) == 5
    assert TRIANGLE.contains([0.5, 0.5])
    assert not TRIANGLE.contains([0.5, 0.5 + 1e-9])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_support_and_bounds_equal_highs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z = _random_set(rng, int(rng.integers(1, 5)), int(rng.integers(1, 12)), int(rng.integers(0, 5)))
    d = rng.normal(size=z.dim)
    scale = np.abs(d) @ (np.abs(z.center) + np.abs(z.generators).sum(axis=1))
    assert abs(z.support(d) - _highs_maximum(z, d)) <= 1e-9 * scale
    low, high = z.ranges(np.vstack([d, -d]))
    assert high[0] == pytest.approx(z.support(d), abs=1e-12 * scale)
    assert low[1] == pytest.approx(-high[0], abs=1e-12 * scale)
    for i, (lower, upper) in enumerate(zip(*z.bounds(), strict=True)):
        axis = np.eye(z.dim)[i]
        assert abs(upper - _highs_maximum(z, axis)) <= 1e-9 * scale / np.abs(d).min()
        assert abs(lower + _highs_maximum(z, -axis)) <= 1e-9 * scale / np.abs(d).min()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_contains_agrees_with_exact_membership(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z = _random_set(rng, 2, 6, 2)
    corner = z.vertices()[0]
    for x in (z.vertices().mean(axis=0), corner, z.center + 3 * (corner - z.center), rng.normal(size=2) * 3):
        exact = z.membership(x)
        if not z.contains(x):
            assert exact is Membership.OUTSIDE
        elif exact is Membership.OUTSIDE:  # undecided by floating point: then it is very near
            nearest = x + (z.vertices().mean(axis=0) - x) * 1e-9
            assert z.membership(nearest) is Membership.INSIDE


def test_membership_is_exact() -> None:
    third = Fraction(1, 3)
    assert TRIANGLE.membership([third, 1 - third]) is Membership.INSIDE
    assert TRIANGLE.membership([third, 1 - third + Fraction(1, 10**30)]) is Membership.OUTSIDE


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_operations_keep_exact_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z = _random_set(rng, 2, 5, 1)
    w = _random_set(rng, 2, 4, 1)
    R, shift = rng.normal(size=(3, 2)), rng.normal(size=3)
    x, other = z.vertices()[0], w.vertices()[0]
    if z.membership(x) is Membership.OUTSIDE or w.membership(other) is Membership.OUTSIDE:
        x, other = z.vertices().mean(axis=0), w.vertices().mean(axis=0)
    exact_x, exact_w = [Fraction(v) for v in x.tolist()], [Fraction(v) for v in other.tolist()]
    image = [
        Fraction(s) + sum(Fraction(a) * v for a, v in zip(row, exact_x, strict=True))
        for row, s in zip(R.tolist(), shift.tolist(), strict=True)
    ]
    assert z.linear_map(R, shift).membership(image) is Membership.INSIDE
    total = [a + b for a, b in zip(exact_x, exact_w, strict=True)]
    assert z.minkowski_sum(w).membership(total) is Membership.INSIDE
    around = Parallelotope(x, np.array([[1.0, 0.3], [0.2, 1.0]]))
    assert z.intersect(around).membership(exact_x) is Membership.INSIDE
    P = rng.normal(size=(1, 2))
    strip = z.meet_strips(P, P @ x, np.abs(P) @ np.abs(x) * 1e-12 + 1e-12)
    assert strip.membership(exact_x) is Membership.INSIDE


def test_intersection_equals_that_of_half_spaces() -> None:
    met = TRIANGLE.intersect(Zonotope([1.0, 0.0], [[0.75, 0.0], [0.0, 0.25]]))
    expected = ConvexHull([[0.25, -0.25], [0.25, 0.25], [0.75, 0.25], [1.0, 0.0], [1.0, -0.25]])
    assert met.volume() == pytest.approx(expected.volume, rel=1e-9)
    assert len(met.vertices()) == 5


def test_a_set_proved_empty_says_so_everywhere() -> None:
    empty = TRIANGLE.intersect(Orthotope([0.7, 0.7], [1.0, 1.0]))
    assert empty.is_empty()
    assert empty.volume() == 0.0
    assert empty.vertices().shape == (0, 2)
    assert not empty.contains([0.8, 0.8])
    with pytest.raises(InconsistentData, match="proved to be empty"):
        empty.bounds()


def test_sets_that_touch_are_not_empty() -> None:
    touching = TRIANGLE.intersect(Orthotope([0.5, 0.5], [1.0, 1.0]))
    assert not touching.is_empty()
    assert touching.contains([0.5, 0.5])
    lower, upper = touching.bounds()
    assert lower == pytest.approx([0.5, 0.5], abs=1e-12)
    assert upper == pytest.approx([0.5, 0.5], abs=1e-12)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_volume_of_random_polytopes(n: int) -> None:
    """Against the vertices of the same half-spaces, found by brute force over HiGHS support points."""
    rng = np.random.default_rng(n)
    z = ConstrainedZonotope(np.zeros(n), np.eye(n), np.zeros((0, n)), []).meet_strips(
        rng.normal(size=(3, n)), rng.normal(size=3) * 0.2, np.full(3, 0.5)
    )
    directions = rng.normal(size=(3000, n))
    points = np.array([_farthest(z, d) for d in directions[: 300 * n]])
    assert z.volume() == pytest.approx(ConvexHull(points).volume, rel=1e-6)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_volume_of_a_cut_box(n: int) -> None:
    """``|Σ x_i| ≤ t`` cuts two corners of t = n − 1: simplices of volume 1/n! each."""
    box = ConstrainedZonotope(np.zeros(n), np.eye(n), np.zeros((0, n)), [])
    cut = box.meet_strips(np.ones((1, n)), [0.0], [n - 1.0])
    assert cut.volume() == pytest.approx(2.0**n - 2 / math.factorial(n), rel=1e-8)


def test_above_dimension_six_the_volume_is_that_of_the_hull() -> None:
    box = ConstrainedZonotope(np.zeros(7), np.eye(7), np.zeros((0, 7)), [])
    assert box.meet_strips(np.ones((1, 7)), [0.0], [6.0]).volume() == pytest.approx(2.0**7)


def _farthest(z: ConstrainedZonotope, d: np.ndarray) -> np.ndarray:
    answer = linprog(-(d @ z.generators), A_eq=z.A, b_eq=z.b, bounds=(-1, 1))
    return np.asarray(z.center + z.generators @ answer.x)


def test_the_nearest_point_is_the_center_where_that_is_inside() -> None:
    assert TRIANGLE.nearest_to_center() == pytest.approx([0.0, 0.0], abs=1e-12)
    away = TRIANGLE.meet_strips([[1.0, 0.0]], [0.8], [0.1])
    point = away.nearest_to_center()
    assert point[0] == pytest.approx(0.7, abs=1e-12)
    assert away.contains(point)


def test_without_generators_or_constraints() -> None:
    point = ConstrainedZonotope([1.0, 2.0], [], [], [])
    assert point.bounds()[0] == pytest.approx([1.0, 2.0], abs=1e-15)
    assert point.contains([1.0, 2.0])
    assert not point.contains([1.0, 2.1])
    assert point.volume() == 0.0
    assert point.vertices() == pytest.approx(np.array([[1.0, 2.0]]))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.0], [[1.0]], [[1.0, 2.0]], [0.0]), "A must have shape any × 1"),
        (([0.0], [[1.0]], [[1.0]], [0.0, 1.0]), "b must have shape 1"),
        (([0.0, 0.0], [[1.0]], [], []), "generators must have shape 2"),
        (([0.0], [[np.inf]], [], []), "generators must hold finite numbers"),
        (([], [], [], []), "center must have at least one coordinate"),
    ],
)
def test_a_wrong_array_is_named(arguments: tuple[object, ...], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        ConstrainedZonotope(*arguments)  # type: ignore[arg-type]


def test_dimensions_must_agree() -> None:
    with pytest.raises(ModelError, match="same dimension"):
        TRIANGLE.intersect(Orthotope([0.0], [1.0]))
