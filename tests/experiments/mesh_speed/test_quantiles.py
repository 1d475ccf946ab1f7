"""Quantiles are samples, and so many samples do not exceed them."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh.experiments.mesh_speed.quantiles import quantile, quantiles

samples = st.lists(st.floats(0.0, 1e6), min_size=1, max_size=300)


def oracle(values: list[float], permille: int) -> float:
    """By definition: the smallest value that at least the share of all values does not exceed."""
    share = Fraction(permille, 1000)
    return min(value for value in values if Fraction(sum(other <= value for other in values), len(values)) >= share)


@given(samples, st.sampled_from((1, 10, 333, 500, 990, 999, 1000)))
def test_a_quantile_is_what_its_definition_says(values: list[float], permille: int) -> None:
    assert quantile(sorted(values), permille) == oracle(values, permille)


@given(samples)
def test_all_of_them_in_any_order(values: list[float]) -> None:
    found = quantiles(values)
    expected = (oracle(values, 500), oracle(values, 990), oracle(values, 999))
    assert (found.p50, found.p99, found.p999) == expected
    assert (found.samples, found.largest) == (len(values), max(values))


def test_ranks_are_exact_where_floating_point_is_not() -> None:
    """0.999 · 3000 is above 2997 in floating point."""
    assert quantile(range(1, 3001), 999) == 2997
    assert quantile(range(1, 1001), 999) == 999
    assert quantile(range(1, 1000), 999) == 999


def test_nothing_has_no_quantile() -> None:
    with pytest.raises(ValueError, match="no samples"):
        quantiles([])
    with pytest.raises(ValueError, match="permille: expected 1 … 1000, found 0"):
        quantile([1.0], 0)
