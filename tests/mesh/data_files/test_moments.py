"""``start_time`` and ``dt`` as a configuration may write them."""

from __future__ import annotations

from datetime import date, datetime, timedelta, timezone
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.data_files.moments import exact_dt, start_time_ns

NS = 10**9


@pytest.mark.parametrize(
    ("value", "ns", "unit"),
    [
        (0, 0, "s"),
        (100.5, 100_500_000_000, "s"),
        (-3, -3 * NS, "s"),
        (1600120070.25, 1_600_120_070_250_000_000, "s"),
        ("1600120070.123456789", 1_600_120_070_123_456_789, "s"),
        (1600120070250, 1_600_120_070_250_000_000, "ms"),
        (1600120070123456789, 1_600_120_070_123_456_789, "ns"),
        ("2020-09-14T21:47:50.5Z", 1_600_120_070_500_000_000, ""),
        (datetime(2020, 9, 14, 21, 47, 50, 500_000), 1_600_120_070_500_000_000, ""),
        (datetime(2020, 9, 14, 23, 47, 50, tzinfo=timezone(timedelta(hours=2))), 1_600_120_070 * NS, ""),
        (date(2020, 9, 14), 1_600_041_600 * NS, ""),
    ],
)
def test_a_start_time_is_exact(value: object, ns: int, unit: str) -> None:
    assert start_time_ns(value) == (ns, unit)


@pytest.mark.parametrize("value", [True, None, "yesterday", "2020-13-01", [1], 1e300, datetime(1700, 1, 1)])
def test_a_start_time_that_is_none_is_refused(value: object) -> None:
    with pytest.raises(ModelError, match=r"expected seconds, or a moment|beyond ±146 years"):
        start_time_ns(value)


@given(st.decimals(min_value="0.000001", max_value=1000, places=6))
def test_a_dt_is_the_decimal_that_is_written(value: object) -> None:
    assert exact_dt(str(value)) == Fraction(str(value))
    assert exact_dt(float(str(value))) == Fraction(str(value))


@pytest.mark.parametrize(("value", "dt"), [("1/30", Fraction(1, 30)), (2, Fraction(2)), (0.1, Fraction(1, 10))])
def test_a_dt_may_be_a_fraction(value: object, dt: Fraction) -> None:
    assert exact_dt(value) == dt


@pytest.mark.parametrize("value", [0, -1.0, "1/0", "fast", True, None, float("inf"), float("nan")])
def test_a_dt_that_is_none_is_refused(value: object) -> None:
    with pytest.raises(ModelError, match="expected"):
        exact_dt(value)
