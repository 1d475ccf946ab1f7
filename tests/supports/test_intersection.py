"""Intersections kept as their parts."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import (
    ConstrainedZonotope,
    InconsistentData,
    Intersection,
    ModelError,
    Orthotope,
    Parallelotope,
    Zonotope,
)

BOX = Orthotope([-1.0, -1.0], [1.0, 1.0])
DIAMOND = Parallelotope([0.0, 0.0], [[0.75, 0.75], [0.75, -0.75]])  # |x| + |y| ≤ 1.5
OCTAGON = Intersection([BOX, DIAMOND])


def test_the_octagon() -> None:
    assert OCTAGON.volume() == pytest.approx(4.0 - 4 * 0.125, rel=1e-9)
    assert len(OCTAGON.vertices()) == 8
    assert OCTAGON.support([1.0, 1.0]) == pytest.approx(1.5, abs=1e-12)
    assert OCTAGON.support([1.0, 0.0]) == pytest.approx(1.0, abs=1e-12)
    assert OCTAGON.contains([0.75, 0.75])
    assert not OCTAGON.contains([0.9, 0.9])
    assert not OCTAGON.contains([1.1, 0.0])
    assert OCTAGON.center == pytest.approx([0.0, 0.0], abs=1e-12)
    assert not OCTAGON.is_empty()


def test_bounds_are_never_wider_than_any_part() -> None:
    third = Zonotope([0.9, 0.0], [[0.3], [0.3]])
    met = Intersection([BOX, DIAMOND, third])
    lower, upper = met.bounds()
    for part in (BOX, DIAMOND, third):
        assert (lower >= part.bounds()[0]).all()
        assert (upper <= part.bounds()[1]).all()
    assert upper == pytest.approx([1.0, 0.1], abs=1e-12)


def test_order_copies_and_grouping_do_not_matter() -> None:
    rng = np.random.default_rng(4)
    parts = [
        BOX,
        DIAMOND,
        ConstrainedZonotope([0.1, 0.0], rng.normal(size=(2, 5)), rng.normal(size=(1, 5)), [0.1]),
    ]
    reference = Intersection(parts).bounds()
    nested = Intersection([Intersection(parts[:2]), parts[2], parts[0], DIAMOND])
    for other in (Intersection(parts[::-1]), nested, Intersection(parts[:1]).intersect(Intersection(parts[1:]))):
        assert np.abs(np.subtract(other.bounds(), reference)).max() <= 1e-12


def test_disjoint_parts_are_proved_empty() -> None:
    by_box = Intersection([BOX, Orthotope([2.0, 0.0], [3.0, 1.0])])
    by_program = Intersection([DIAMOND, Orthotope([0.9, 0.9], [1.0, 1.0])])
    for empty in (by_box, by_program):
        assert empty.is_empty()
        with pytest.raises(InconsistentData, match="proved to be empty"):
            empty.bounds()


def test_maps_and_sums_are_those_of_the_joint_set() -> None:
    assert OCTAGON.linear_map([[1.0, 1.0]]).bounds()[1] == pytest.approx([1.5], abs=1e-12)
    assert OCTAGON.minkowski_sum(BOX).bounds()[1] == pytest.approx([2.0, 2.0], abs=1e-12)
    assert OCTAGON.to_constrained_zonotope().volume() == pytest.approx(3.5, rel=1e-9)


def test_wrong_parts_are_refused() -> None:
    with pytest.raises(ModelError, match="at least one part"):
        Intersection([])
    with pytest.raises(ModelError, match="same dimension"):
        Intersection([BOX, Orthotope([0.0], [1.0])])
