"""Maps, sums and strips on plain arrays hold every exact point, decided in rationals."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from from_python import from_python
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh.kernels.zonotopes import constrained_zonotope
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_sets, meet_strips
from lsu_mesh.kernels.zonotopes.time_update import image_of_box, predict_constrained
from lsu_mesh.kernels.zonotopes.zonotope import (
    absorb_box,
    add_centers,
    parallelotope_volumes,
    zonotope_map,
    zonotope_radius,
    zonotope_support,
)
from lsu_mesh.supports.exact_program import exact_solution

absorb_rows = from_python(constrained_zonotope.absorb_rows)

Exact = list[Fraction]


def _exact(values: np.ndarray) -> Exact:
    return [Fraction(v) for v in np.asarray(values, dtype=float).ravel().tolist()]


def _image(M: np.ndarray, x: Exact) -> Exact:
    return [sum((Fraction(a) * v for a, v in zip(row, x, strict=True)), Fraction(0)) for row in M.tolist()]


def _plus(*vectors: Exact) -> Exact:
    return [sum(entries, Fraction(0)) for entries in zip(*vectors, strict=True)]


def _holds(c: np.ndarray, G: np.ndarray, A: np.ndarray, b: np.ndarray, x: Exact) -> bool:
    rows = [[Fraction(v) for v in row] for row in (*G.tolist(), *A.tolist())]
    sides = [v - s for v, s in zip(x, _exact(c), strict=True)] + _exact(b)
    return exact_solution(rows, sides, [0.5] * G.shape[1]) is not None


def _set_with_point(rng: np.random.Generator, n: int) -> tuple[tuple[np.ndarray, ...], Exact, np.ndarray]:
    """A constrained zonotope and ξ that fulfils its constraints exactly, often at a corner; the point ``c + G ξ``."""
    g, m = n + int(rng.integers(1, 4)), int(rng.integers(0, 3))
    xi = rng.choice([-1.0, 1.0], size=g) if rng.random() < 0.6 else rng.integers(-16, 17, size=g) / 16.0
    A = rng.integers(-8, 9, size=(m, g)) / 8.0
    c, G = rng.normal(size=n) * 10.0 ** rng.integers(-3, 4), rng.normal(size=(n, g))
    return (c, G, A, A @ xi), _plus(_exact(c), _image(G, _exact(xi))), xi


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_time_update_holds_the_exact_image(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    body, x, _ = _set_with_point(rng, n)
    R, B, N = rng.normal(size=(n, n)), rng.normal(size=(n, 1)), np.eye(n) if seed % 2 else rng.normal(size=(n, 2))
    widths = np.abs(rng.normal(size=N.shape[1])) * rng.choice([0.0, 1.0, 1e-12], size=N.shape[1])
    u = rng.normal(size=1)
    noise = [Fraction(w) * int(s) for w, s in zip(widths.tolist(), rng.choice([-1, 1], size=widths.size), strict=True)]
    exact = _plus(_image(R, x), _image(B, _exact(u)), _image(N, noise))
    floats = np.array([float(v) for v in x])
    lower, upper = np.nextafter(floats, -np.inf), np.nextafter(floats, np.inf)
    finite, moved, low, high = predict_constrained(body, lower, upper, R, B, u, N, widths)
    assert finite
    assert _holds(*moved, exact)
    assert all(Fraction(lo) <= v <= Fraction(hi) for lo, v, hi in zip(low.tolist(), exact, high.tolist(), strict=True))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_strips_that_hold_a_point_keep_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body, x, _ = _set_with_point(rng, 2)
    P = rng.normal(size=(2, 2))
    y = np.array([float(v) for v in _image(P, x)]) + rng.choice([-1.0, 0.0, 1.0], size=2) * rng.random(2)
    # the half-width that the exact point just needs, rounded up by no more than one unit
    r = np.array([float(abs(v - Fraction(s))) for v, s in zip(_image(P, x), y.tolist(), strict=True)])
    r = np.nextafter(r, np.inf)
    y[1] = np.nan if seed % 3 == 0 else y[1]
    c, G, A, b = body
    assert _holds(c, *meet_strips(c, G, A, b, P, y, r), x)


def test_a_strip_beside_the_set_leaves_nothing() -> None:
    c, G = np.zeros(2), np.eye(2)
    P, y, r = np.array([[1.0, 1.0]]), np.array([3.0]), np.array([0.5])
    G2, A, b = meet_strips(c, G, np.zeros((0, 2)), np.zeros(0), P, y, r)
    assert not any(_holds(c, G2, A, b, _exact(np.array(x))) for x in itertools.product([-1.0, 0.0, 1.0], repeat=2))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_intersection_keeps_common_points_and_only_those(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one, x, _ = _set_with_point(rng, 2)
    other, _, xi = _set_with_point(rng, 2)
    # the second set is moved until the exact point lies in it, up to the rounding of its centre that a diagonal takes
    target = np.array([float(v) for v in x]) - other[1] @ xi
    slack = np.abs(target) * 1e-14 + 1e-14 * np.abs(other[1]).sum(axis=1)
    G2, A2 = absorb_box(other[1], other[2], slack)
    arrays = meet_sets(*one, target, G2, A2, other[3])
    assert _holds(target, G2, A2, other[3], x)
    assert _holds(one[0], *arrays, x)
    beside = [v + Fraction(10) for v in x]
    if not _holds(*one, beside):
        assert not _holds(one[0], *arrays, beside)


def test_a_rounded_difference_of_centres_is_charged() -> None:
    """{0.1} is a corner of {1 + h ξ₁ + l ξ₂} with h + l = 1 − 0.1 exactly, while 1 − 0.1 is rounded up beyond that."""
    exact = 1 - Fraction(0.1)
    rounded = 1.0 - 0.1
    assert Fraction(rounded) > exact
    h = float(np.nextafter(rounded, 0.0))
    rest = float(exact - Fraction(h))
    assert Fraction(h) + Fraction(rest) == exact
    point = np.array([0.1])
    none = np.zeros((0, 2))
    arrays = meet_sets(
        point, np.zeros((1, 0)), np.zeros((0, 0)), np.zeros(0), np.ones(1), np.array([[h, rest]]), none, np.zeros(0)
    )
    assert _holds(point, *arrays, [Fraction(0.1)])


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_maps_sums_and_projections_are_rounded_outward(seed: int) -> None:
    rng = np.random.default_rng(seed)
    c, G, R = rng.normal(size=3), rng.normal(size=(3, 6)), rng.normal(size=(2, 3))
    xi, shift = rng.choice([-1.0, 1.0], size=6), rng.normal(size=2)
    x = _plus(_exact(c), _image(G, _exact(xi)))
    centre, generators, slack = zonotope_map(R, c, G, shift)
    generators, none = absorb_box(generators, np.zeros((0, 6)), slack)
    assert _holds(centre, generators, none, np.zeros(0), _plus(_image(R, x), _exact(shift)))
    radius = _exact(zonotope_radius(G))
    assert all(abs(v - s) <= q for v, s, q in zip(x, _exact(c), radius, strict=True))
    assert Fraction(float(zonotope_support(c, G, R[0]))) >= _image(R[:1], x)[0]
    low, high = image_of_box(R, c, c + np.abs(G[:, 0]))
    corner = np.where(rng.random(3) < 0.5, c, c + np.abs(G[:, 0]))
    assert all(Fraction(a) <= v <= Fraction(z) for a, v, z in zip(low, _image(R, _exact(corner)), high, strict=True))


def test_selecting_coordinates_costs_nothing() -> None:
    c, G = np.array([0.1, 0.2, 0.3]), np.array([[0.1, 0.7], [0.3, 0.3], [0.9, 0.2]])
    centre, generators, slack = zonotope_map(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]), c, G, np.zeros(2))
    assert (slack == 0).all()
    assert (centre == [-0.2, 0.1]).all()
    assert (generators == [[-0.3, -0.3], [0.1, 0.7]]).all()


@settings(max_examples=60, deadline=None)
@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_the_slack_of_a_sum_is_its_rounding_error(x: float, y: float) -> None:
    total, slack = add_centers(np.array([x]), np.array([y]))
    lost = abs(Fraction(x) + Fraction(y) - Fraction(float(total[0])))
    assert lost <= Fraction(float(slack[0])) <= lost * Fraction(1 + 1e-15) + Fraction(1e-300)


def test_slack_grows_a_private_column_or_adds_one() -> None:
    G, A = np.array([[2.0, 0.0, 1.0], [0.0, 0.0, 1.0]]), np.array([[0.0, -3.0, 1.0]])
    generators, columns = absorb_box(G, A, np.array([0.5, 0.25]))
    assert generators.shape == (2, 4)
    assert generators[0, 0] >= 2.5
    assert (generators[:, 3] == [0.0, 0.25]).all()
    assert (columns[:, :3] == A).all()
    generators, rows = absorb_rows(G, A, np.array([0.5]))
    assert rows.shape == (1, 3)
    assert rows[0, 1] <= -3.5
    generators, rows = absorb_rows(np.ones((2, 3)), A, np.array([0.5]))
    assert rows.shape == (1, 4)
    assert rows[0, 3] == 0.5
    assert (generators[:, 3] == 0).all()


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_volume_of_a_zonotope_is_the_sum_of_its_parallelotopes(n: int) -> None:
    rng = np.random.default_rng(n)
    G = rng.normal(size=(n, n + 2))
    expected = sum(abs(np.linalg.det(G[:, list(chosen)])) for chosen in itertools.combinations(range(n + 2), n))
    assert parallelotope_volumes(G) == pytest.approx(2.0**n * expected, rel=1e-10)
    assert parallelotope_volumes(G[:, : n - 1]) == 0.0
