"""Parallelotopes against their vertices and exact rationals."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import ModelError, Orthotope, Parallelotope
from lsu_mesh.supports.exact import Membership, parallelotope_membership


def random_body(seed: int, n: int) -> Parallelotope:
    rng = np.random.default_rng(seed)
    return Parallelotope(rng.normal(size=n), rng.normal(size=(n, n)))


def exact_point(body: Parallelotope, xi: list[Fraction]) -> list[Fraction]:
    return [
        Fraction(c) + sum((Fraction(t) * v for t, v in zip(row, xi, strict=True)), Fraction(0))
        for c, row in zip(body.center.tolist(), body.generators.tolist(), strict=True)
    ]


seeds = st.integers(0, 2**32 - 1)
dims = st.integers(1, 5)


def test_shapes_are_checked() -> None:
    with pytest.raises(ModelError, match="generators must have shape 2 × 2"):
        Parallelotope([0.0, 0.0], np.ones((2, 3)))
    with pytest.raises(ModelError, match="finite"):
        Parallelotope([math.nan], [[1.0]])


@given(seeds, dims)
def test_bounds_and_support_function_hold_the_exact_corners(seed: int, n: int) -> None:
    body, rng = random_body(seed, n), np.random.default_rng(seed)
    lower, upper = body.bounds()
    d = rng.normal(size=n)
    for _ in range(4):
        x = exact_point(body, [Fraction(int(v)) for v in rng.choice([-1, 1], n)])
        assert all(Fraction(a) <= v <= Fraction(z) for a, v, z in zip(lower.tolist(), x, upper.tolist(), strict=True))
        value = sum((Fraction(a) * v for a, v in zip(d.tolist(), x, strict=True)), Fraction(0))
        assert value <= Fraction(body.support(d))
    corners = body.vertices()
    np.testing.assert_allclose(lower, corners.min(axis=0), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(upper, corners.max(axis=0), rtol=1e-12, atol=1e-12)
    assert body.support(d) == pytest.approx((corners @ d).max(), abs=1e-12)


@given(seeds, dims)
def test_volume_is_the_determinant(seed: int, n: int) -> None:
    body = random_body(seed, n)
    assert body.volume() == pytest.approx(2**n * abs(np.linalg.det(body.generators)), rel=1e-9)
    assert body.log_volume() == pytest.approx(math.log(body.volume()), abs=1e-9)


@settings(deadline=None)
@given(seeds, dims)
def test_membership_is_decided_at_the_last_bit(seed: int, n: int) -> None:
    """A point is in or out as exact arithmetic says, however near to a face it lies."""
    body, rng = random_body(seed, n), np.random.default_rng(seed)
    corner = body.center + body.generators @ rng.choice([-1.0, 1.0], n)
    for x in (corner, np.nextafter(corner, body.center), np.nextafter(corner, 2 * corner - body.center)):
        exact = parallelotope_membership(body.center, body.generators, x)
        assert body.contains(x) == (exact is Membership.INSIDE)
    assert body.contains(body.center)
    assert not body.contains(body.center + 1.001 * (corner - body.center))


def test_membership_in_flat_bodies() -> None:
    flat = Parallelotope([0.0, 1.0], [[1.0, 0.0], [0.0, 0.0]])
    assert flat.contains([0.5, 1.0])
    assert not flat.contains([0.5, np.nextafter(1.0, 2.0)])
    dependent = Parallelotope([0.0, 0.0], [[1.0, 1.0], [1.0, 1.0]])
    assert dependent.contains([1.5, 1.5])
    assert not dependent.contains([1.5, 1.4])
    assert not dependent.contains([2.5, 2.5])
    assert dependent.volume() == 0.0


@settings(deadline=None)
@given(seeds, dims)
def test_an_image_holds_the_exact_images(seed: int, n: int) -> None:
    body, rng = random_body(seed, n), np.random.default_rng(seed)
    R, shift = rng.normal(size=(n, n)), rng.normal(size=n)
    image = body.linear_map(R, shift)
    assert isinstance(image, Parallelotope)
    x = exact_point(body, [Fraction(int(v)) for v in rng.choice([-1, 1], n)])
    mapped = [
        sum((Fraction(a) * v for a, v in zip(row, x, strict=True)), Fraction(s))
        for row, s in zip(R.tolist(), shift.tolist(), strict=True)
    ]
    assert parallelotope_membership(image.center, image.generators, mapped) is Membership.INSIDE
    np.testing.assert_allclose(image.generators, R @ body.generators, rtol=1e-6, atol=1e-9)


@given(seeds, dims)
def test_the_faces_as_strips_hold_the_corners(seed: int, n: int) -> None:
    body = random_body(seed, n)
    strips = body.strips()
    assert strips is not None
    P, y, r = strips
    gaps = np.abs(y - body.vertices() @ P.T) - r
    assert gaps.max() <= 1e-9
    np.testing.assert_allclose(r, 1.0, rtol=1e-6)


def test_a_flat_body_has_no_faces_to_offer() -> None:
    assert Parallelotope([0.0, 0.0], [[1.0, 1.0], [1.0, 1.0]]).strips() is None


def test_mixed_sums_and_meets_hold_both_operands() -> None:
    body, box = random_body(1, 3), Orthotope([-0.1] * 3, [0.2] * 3)
    total = body.minkowski_sum(box)
    np.testing.assert_allclose(np.subtract(*total.bounds()[::-1]), np.subtract(*body.bounds()[::-1]) + 0.3, rtol=1e-9)
    met = body.intersect(Orthotope(body.center - 0.1, body.center + 0.1))
    assert met.contains(body.center)
    assert (met.bounds()[1] <= body.center + 0.1 + 1e-9).all()
    assert body.intersect(Orthotope([50.0] * 3, [60.0] * 3)).is_empty()
