"""The reduction of a stack: every exact point stays in it, and its hull is that of HiGHS before the reduction."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from lsu_mesh.kernels.linear_programs.safe_maxima import EMPTY, TIGHT
from lsu_mesh.kernels.zonotopes.stack_reduction import reduce_stack, settle_stack
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.exact import Membership


def _set_and_point(seed: int) -> tuple[tuple[np.ndarray, ...], np.ndarray, list[Fraction]]:
    """(c, G, A, b), a ξ that fulfils ``A ξ = b`` exactly, and the exact point ``c + G ξ``."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 4)), int(rng.integers(1, 9))
    g = n + m + int(rng.integers(0, 8))
    xi = rng.choice([-1.0, 1.0], size=g) if seed % 2 else rng.integers(-16, 17, size=g) / 16.0
    A = rng.integers(-8, 9, size=(m, g)) / 8.0
    A[rng.random(A.shape) < 0.3] = 0.0
    c, G = rng.normal(size=n), rng.normal(size=(n, g)) * 10.0 ** rng.integers(-6, 7, size=(n, 1))
    point = [
        Fraction(s) + sum(Fraction(a) * Fraction(x) for a, x in zip(row, xi.tolist(), strict=True))
        for s, row in zip(c.tolist(), G.tolist(), strict=True)
    ]
    return (c, G, A, A @ xi), xi, point


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_set_keeps_an_exact_point_within_the_limits(seed: int) -> None:
    body, _, point = _set_and_point(seed)
    n, g = body[1].shape
    rng = np.random.default_rng(seed)
    limits = (-1 if seed % 5 == 0 else int(rng.integers(n, g + 1)), -1 if seed % 7 == 0 else int(rng.integers(0, 4)))
    status, maxima, reduced = settle_stack(*body, *limits)
    assert status != EMPTY
    assert limits[0] < 0 or reduced[1].shape[1] <= limits[0]
    assert limits[1] < 0 or reduced[2].shape[0] <= limits[1]
    assert ConstrainedZonotope.of_arrays(*reduced).membership(point) is Membership.INSIDE
    for i in range(n):
        assert Fraction(float(body[0][i])) + Fraction(float(maxima[i])) >= point[i]
        assert Fraction(float(body[0][i])) - Fraction(float(maxima[n + i])) <= point[i]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_ranges_that_hold_the_point_keep_it(seed: int) -> None:
    body, xi, point = _set_and_point(seed)
    n, g = body[1].shape
    rng = np.random.default_rng(seed)
    low = np.maximum(-1.0, xi - rng.random(g) * rng.choice([0.0, 1.0], size=g))
    high = np.minimum(1.0, xi + rng.random(g))
    reduced = reduce_stack(*body, low, high, int(rng.integers(n, g + 1)), int(rng.integers(0, 4)))
    assert ConstrainedZonotope.of_arrays(*reduced).membership(point) is Membership.INSIDE


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_hull_is_that_of_highs(seed: int) -> None:
    (c, G, A, b), _, _ = _set_and_point(seed)
    n = c.size
    status, maxima, _ = settle_stack(c, G, A, b, n, 0)
    assert status == TIGHT
    for d, value in zip(np.concatenate((G, -G)), maxima, strict=True):
        size = np.abs(d).sum()  # HiGHS has absolute tolerances
        assert abs(value / size + linprog(-d / size, A_eq=A, b_eq=b, bounds=(-1, 1)).fun) <= 1e-8


def test_an_empty_set_is_proved_so() -> None:
    c, G, A, b = np.zeros(1), np.array([[1.0, 0.0]]), np.array([[1.0, 0.5], [1.0, -0.5]]), np.array([1.0, -0.75])
    assert settle_stack(c, G, A, b, 1, 0)[0] == EMPTY


def test_the_same_set_gives_the_same_bits() -> None:
    body = _set_and_point(12)[0]
    once, again = (settle_stack(*(np.array(part) for part in body), 4, 1) for _ in range(2))
    assert once[1].tobytes() == again[1].tobytes()
    assert [part.tobytes() for part in once[2]] == [part.tobytes() for part in again[2]]
