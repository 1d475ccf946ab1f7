"""Fits find the law that the points were made with."""

from __future__ import annotations

import pytest

from lsu_mesh.experiments.mesh_speed.growth import exponent, fitted_line, projected


def test_a_line() -> None:
    line = fitted_line([(x, 3.0 + 0.5 * x) for x in (6.0, 9.0, 13.0, 17.0)])
    assert (line.fixed, line.each) == pytest.approx((3.0, 0.5))
    assert line.at(53.0) == pytest.approx(29.5)


def test_an_exponent_is_that_of_the_upper_half() -> None:
    points = [(1.0, 7.0), (2.0, 7.0), (4.0, 16.0), (8.0, 64.0)]
    assert exponent(points) == pytest.approx(2.0)
    assert projected(points, 16.0) == pytest.approx(256.0)
    assert exponent(points[:3]) == pytest.approx(1.1926450779)


@pytest.mark.parametrize("points", [[], [(2.0, 1.0)], [(2.0, 1.0), (2.0, 3.0)]])
def test_one_point_has_no_law(points: list[tuple[float, float]]) -> None:
    for law in (fitted_line, exponent):
        with pytest.raises(ValueError, match="costs at two counts or more"):
            law(points)
