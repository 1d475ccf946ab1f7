"""Boxes: exact where floating point is exact, outward elsewhere."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh import ModelError, Orthotope, Parallelotope, Zonotope

numbers = st.floats(-1e6, 1e6, allow_nan=False)
intervals = st.tuples(numbers, numbers).map(sorted)
boxes = st.lists(intervals, min_size=1, max_size=4).map(
    lambda pairs: Orthotope([p[0] for p in pairs], [p[1] for p in pairs])
)


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ([0.0, 2.0], [1.0, 1.0], r"must not exceed upper.*coordinate 1"),
        ([0.0], [1.0, 2.0], "shape"),
        ([0.0], [math.inf], "finite"),
        ([math.nan], [1.0], "finite"),
        ([], [], "at least one"),
    ],
)
def test_bad_bounds_are_refused(lower: list[float], upper: list[float], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        Orthotope(lower, upper)


def test_bounds_are_copies_that_cannot_be_written() -> None:
    given_lower = np.zeros(2)
    box = Orthotope(given_lower, np.ones(2))
    given_lower[0] = -5.0
    assert box.lower[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        box.bounds()[0][0] = 3.0


@given(boxes)
def test_center_and_half_widths_hold_the_box(box: Orthotope) -> None:
    for c, q, lo, hi in zip(box.center, box.half_widths, *box.bounds(), strict=True):
        assert Fraction(float(c)) - Fraction(float(q)) <= Fraction(float(lo))
        assert Fraction(float(c)) + Fraction(float(q)) >= Fraction(float(hi))


def test_a_flat_box_has_no_half_width_and_no_volume() -> None:
    box = Orthotope([1.0, 0.3], [2.0, 0.3])
    assert box.half_widths[1] == 0.0
    assert box.volume() == 0.0
    assert box.log_volume() == -math.inf
    assert len(box.vertices()) == 2


def test_volume_vertices_and_membership_of_the_unit_cube() -> None:
    box = Orthotope(np.zeros(3), np.ones(3))
    assert box.volume() == 1.0
    assert {tuple(v) for v in box.vertices()} == set(itertools.product((0.0, 1.0), repeat=3))
    assert box.contains([1.0, 1.0, 1.0])
    assert not box.contains([1.0, 1.0, np.nextafter(1.0, 2.0)])


@given(boxes, st.data())
def test_the_support_function_is_the_largest_over_the_vertices_rounded_up(box: Orthotope, data: st.DataObject) -> None:
    d = np.array(data.draw(st.lists(numbers, min_size=box.dim, max_size=box.dim)))
    exact = max(
        sum((Fraction(a) * Fraction(b) for a, b in zip(v.tolist(), d.tolist(), strict=True)), Fraction(0))
        for v in box.vertices()
    )
    value = box.support(d)
    assert Fraction(value) >= exact
    assert value <= float(exact) + 1e-12 * (1 + float(np.abs(d) @ np.maximum(abs(box.lower), abs(box.upper))))


@given(st.data())
def test_the_sum_of_two_boxes_holds_the_sums_of_their_ends(data: st.DataObject) -> None:
    one = data.draw(boxes)
    other = data.draw(boxes.filter(lambda box: box.dim == one.dim))
    total = one.minkowski_sum(other)
    assert isinstance(total, Orthotope)
    for a, b, s in zip(one.lower.tolist(), other.lower.tolist(), total.lower.tolist(), strict=True):
        assert Fraction(s) <= Fraction(a) + Fraction(b)
        assert s >= np.nextafter(a + b, -np.inf)
    for a, b, s in zip(one.upper.tolist(), other.upper.tolist(), total.upper.tolist(), strict=True):
        assert Fraction(s) >= Fraction(a) + Fraction(b)


def test_boxes_meet_exactly() -> None:
    met = Orthotope([0.0, 0.0], [2.0, 2.0]).intersect(Orthotope([1.0, -1.0], [3.0, 1.0]))
    assert isinstance(met, Orthotope)
    np.testing.assert_array_equal(met.bounds(), [[1.0, 0.0], [2.0, 1.0]])


def test_boxes_that_do_not_meet_leave_a_set_that_is_proved_empty() -> None:
    assert Orthotope([0.0], [1.0]).intersect(Orthotope([2.0], [3.0])).is_empty()
    assert not Orthotope([0.0], [1.0]).is_empty()


def test_boxes_of_other_spaces_are_refused() -> None:
    with pytest.raises(ModelError, match="dimension 1 and 2"):
        Orthotope([0.0], [1.0]).intersect(Orthotope([0.0, 0.0], [1.0, 1.0]))


def test_conversions_hold_the_box_and_cost_nothing() -> None:
    box = Orthotope([-1.0, 0.1], [1.0, 0.7])
    for other in (box.to_parallelotope(), box.to_constrained_zonotope()):
        lower, upper = other.bounds()
        assert (lower <= box.lower).all()
        assert (upper >= box.upper).all()
        np.testing.assert_allclose(other.bounds(), box.bounds(), rtol=1e-12, atol=1e-12)


def test_an_invertible_map_gives_a_parallelotope_and_a_singular_one_a_zonotope() -> None:
    box = Orthotope([0.0, 0.0], [1.0, 2.0])
    assert isinstance(box.linear_map([[1.0, 1.0], [0.0, 1.0]], [5.0, 0.0]), Parallelotope)
    flat = box.linear_map([[1.0, 1.0], [1.0, 1.0]])
    assert isinstance(flat, Zonotope)
    np.testing.assert_allclose(flat.bounds(), [[0.0, 0.0], [3.0, 3.0]], atol=1e-12)
    np.testing.assert_allclose(box.linear_map([[1.0, -1.0]]).bounds(), [[-2.0], [1.0]], atol=1e-12)
