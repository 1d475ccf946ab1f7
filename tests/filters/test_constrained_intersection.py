"""A constrained zonotope met with other sets: the oracle is HiGHS on the inequalities of all sets."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh.filters.constrained_intersection import joined, strips_of
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support

UNIT = (-np.ones(2), np.ones(2))
LONG = Parallelotope([3.0e5, 3.0e5], np.array([[1e6, -0.1], [1e6, 0.1]]))
"""A strip around the diagonal, a million long, that holds the origin."""
SLANTED = Parallelotope([0.5, 0.0], [[1.0, 0.25], [0.0, 0.5]])
SLANTED_STRIPS = [([[1.0, -0.5], [0.0, 2.0]], [0.5, 0.0], [1.0, 1.0])]


def square() -> ConstrainedZonotope:
    """``[−1, 1]²`` cut by ``|x_1 + x_2| ≤ 1.5``."""
    return Orthotope(*UNIT).to_constrained_zonotope().meet_strips([[1.0, 1.0]], [0.0], [1.5])


def strip_bounds(strips: list[tuple[list[list[float]], list[float], list[float]]]) -> tuple[np.ndarray, np.ndarray]:
    """Interval hull of an intersection of strips by HiGHS."""
    P = np.vstack([np.array(rows) for rows, _, _ in strips])
    y, r = np.concatenate([s[1] for s in strips]), np.concatenate([s[2] for s in strips])
    A, b = np.vstack([P, -P]), np.concatenate([y + r, r - y])
    lower, upper = np.empty(2), np.empty(2)
    for i in range(2):
        for sign, out in ((1.0, lower), (-1.0, upper)):
            answer = linprog(sign * np.eye(2)[i], A_ub=A, b_ub=b, bounds=(None, None), method="highs")
            assert answer.status == 0
            out[i] = sign * answer.fun
    return lower, upper


SQUARE_STRIPS = [([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], [0.0, 0.0, 0.0], [1.0, 1.0, 1.5])]
LONG_STRIPS = [([[-5.0, 5.0]], [0.0], [1.0])]


@pytest.mark.parametrize(
    ("other", "strips", "rows"),
    [
        (Orthotope([-2.0, -0.5], [2.0, 0.25]), [([[0.0, 1.0]], [-0.125], [0.375])], 1),
        (SLANTED, SLANTED_STRIPS, 2),
        (LONG, LONG_STRIPS, 1),
        (Intersection([Orthotope([0.0, -5.0], [5.0, 5.0]), LONG]), [([[1.0, 0.0]], [2.5], [2.5]), *LONG_STRIPS], 2),
    ],
    ids=["box", "parallelotope", "long", "bundle"],
)
def test_only_strips_that_cut_are_added_and_bounds_are_exact(other: Support, strips: list, rows: int) -> None:  # type: ignore[type-arg]
    body = joined(square().arrays, UNIT, other, None)
    met = ConstrainedZonotope.of_arrays(*body)
    assert met.constraint_count == square().constraint_count + rows
    expected = strip_bounds([*SQUARE_STRIPS, *strips])
    np.testing.assert_allclose(met.bounds(), expected, rtol=0, atol=1e-8)
    assert (met.bounds()[0] <= expected[0] + 1e-15).all()


def test_a_set_inside_the_other_keeps_its_arrays() -> None:
    body = square().arrays
    assert joined(body, UNIT, Orthotope([-1.0, -1.0], [1.0, 1.0]), None) is body
    assert joined(body, UNIT, Intersection([Orthotope([-3.0, -3.0], [3.0, 3.0])]), None) is body


def test_a_flat_parallelotope_is_met_by_its_edges() -> None:
    flat = Parallelotope([0.25, 0.0], [[0.0, 0.0], [0.5, 0.0]])
    assert strips_of(flat) is None
    met = ConstrainedZonotope.of_arrays(*joined(square().arrays, UNIT, flat, None))
    np.testing.assert_allclose(met.bounds(), ([0.25, -0.5], [0.25, 0.5]), rtol=0, atol=1e-12)


def test_a_complex_set_is_met_by_its_box() -> None:
    rng = np.random.default_rng(3)
    complex_set = ConstrainedZonotope([0.5, 0.5], 0.02 * rng.standard_normal((2, 30)), np.zeros((0, 30)), [])
    met = ConstrainedZonotope.of_arrays(*joined(square().arrays, UNIT, complex_set, 8))
    assert met.generator_count == square().generator_count + 2
    np.testing.assert_allclose(met.bounds(), complex_set.bounds(), rtol=0, atol=1e-9)


def test_strips_hold_what_they_stand_for() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        body = Parallelotope(rng.standard_normal(2), rng.standard_normal((2, 2)) * 10.0 ** rng.uniform(-3, 3, 2))
        found = strips_of(body)
        assert found is not None
        P, y, r = found
        corners = body.vertices()
        assert (np.abs(y - corners @ P.T) <= r * (1 + 1e-12) + 1e-300).all()
        assert (np.abs(y - corners @ P.T).max(axis=0) >= r * (1 - 1e-6)).all()


def test_a_wide_source_changes_nothing_and_a_long_one_cuts_exactly() -> None:
    model = LSUModel(np.eye(2), None, np.eye(2), 0.1, 0.1)
    engine = LSUCZ(model, Orthotope(*UNIT), max_generators=6, max_constraints=2)
    before = engine.snapshot()
    assert engine.condition(Orthotope([-9.0, -9.0], [9.0, 9.0])) == 0.0
    assert engine.snapshot()._replace(met=None) == before
    assert engine.condition(LONG) == 0.0, "the diagonal strip leaves the hull"
    np.testing.assert_allclose(engine.support.ranges([[-1.0, 1.0]]), ([-0.2], [0.2]), rtol=0, atol=1e-8)


def test_a_set_at_the_end_of_all_numbers_leaves_x_as_it_is() -> None:
    far, own = (ConstrainedZonotope([sign * 1.5e308, 0.0], np.eye(2), np.zeros((0, 2)), []) for sign in (-1, 1))
    body = own.arrays
    assert joined(body, own.bounds(), far, None) is body
