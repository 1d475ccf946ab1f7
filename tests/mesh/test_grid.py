"""The grid in integer nanoseconds, against exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.grid import Grid

NS = 10**9
dts = st.one_of(
    st.sampled_from(
        [Fraction(1, 30), Fraction(1, 50), Fraction(1, 1001), Fraction(2), Fraction("0.02"), Fraction(1, NS)]
    ),
    st.fractions(min_value=Fraction(1, 10**6), max_value=1000, max_denominator=10**7),
)
starts = st.integers(-(2**61), 2**61)
moments = st.integers(-(2**61), 2**61)


def brute_step(grid: Grid, t: int) -> int:
    """The smallest k with t ≤ t_k, by bisection over the definition."""
    low, high = -1, 1
    while grid.time_of(low) >= t:
        low *= 2
    while grid.time_of(high) < t:
        high *= 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if grid.time_of(middle) < t else (low, middle)
    return high


@given(start=starts, dt=dts, k=st.integers(-(10**6), 10**6))
@example(start=1, dt=Fraction(3, 2 * NS), k=1)
@example(start=1, dt=Fraction(3, 2 * NS), k=3)
@example(start=1, dt=Fraction(3, 2 * NS), k=-1)
def test_a_step_is_the_rounded_exact_time(start: int, dt: Fraction, k: int) -> None:
    grid = Grid(start, dt)
    assert grid.time_of(k) == start + round(k * dt * NS), "halves to the even one"
    assert abs(grid.time_of(k) - start - k * dt * NS) <= Fraction(1, 2)
    assert grid.step_of(grid.time_of(k)) == k
    assert grid.distance(grid.time_of(k)) == 0


@given(start=starts, dt=dts, t=moments)
@example(start=0, dt=Fraction(1, NS), t=3)
@example(start=0, dt=Fraction(3, 2 * NS), t=5)
def test_a_moment_belongs_to_the_step_whose_interval_holds_it(start: int, dt: Fraction, t: int) -> None:
    grid = Grid(start, dt)
    k = grid.step_of(t)
    assert k == brute_step(grid, t)
    assert grid.time_of(k - 1) < t <= grid.time_of(k)
    near = min((abs(t - grid.time_of(j)), j) for j in (k - 1, k))
    assert (grid.distance(t), grid.nearest_step(t)) == near


@given(start=starts, dt=dts, t=st.lists(moments, max_size=8), k=st.lists(st.integers(-(10**6), 10**6), max_size=8))
def test_arrays_are_what_single_moments_are(start: int, dt: Fraction, t: list[int], k: list[int]) -> None:
    grid, times = Grid(start, dt), np.array(t, dtype=np.int64)
    assert grid.times_of(np.array(k, dtype=np.int64)).tolist() == [grid.time_of(j) for j in k]
    assert grid.steps_of(times).tolist() == [grid.step_of(one) for one in t]
    assert grid.nearest_steps(times).tolist() == [grid.nearest_step(one) for one in t]
    assert grid.distances(times).tolist() == [grid.distance(one) for one in t]


def test_thirty_hertz_does_not_drift() -> None:
    grid = Grid(0, Fraction(1, 30))
    assert grid.time_of(30 * 86400) == 86400 * NS
    assert Grid(0, Fraction("0.0333")).time_of(30 * 86400) != 86400 * NS


def test_a_float_time_is_on_the_grid_where_its_interval_holds_a_step() -> None:
    grid = Grid(1_600_120_070 * NS, Fraction(1, 50))
    assert grid.is_on_grid(grid.time_of(7) + 119, 119)
    assert not grid.is_on_grid(grid.time_of(7) + 120, 119)
    assert not grid.is_on_grid(grid.time_of(7) - 1)


def test_a_grid_that_nanoseconds_cannot_count_is_refused() -> None:
    with pytest.raises(ModelError, match="below a nanosecond"):
        Grid(0, Fraction(1, 2 * NS))
    with pytest.raises(ModelError, match="146 years"):
        Grid(0, Fraction(10**10))
    with pytest.raises(ModelError, match="146 years"):
        Grid(2**62, Fraction(1))


@given(st.integers(-(10**6), 10**6), st.fractions(Fraction(1, 10**9), 100, max_denominator=10**12))
def test_a_time_is_the_fraction_rounded_half_to_even(k: int, dt: Fraction) -> None:
    assert Grid(7, dt).time_of(k) == 7 + round(k * dt * 10**9)
