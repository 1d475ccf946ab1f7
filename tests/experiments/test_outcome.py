"""Tables and checks of experiments: what they print."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from lsu_mesh.experiments.outcome import Check, Column, Table, percent

TABLE = Table(
    "t", "A title", (Column("name"), Column("width", ".2f"), Column("n")), [("a", 1.0, 3), ("bc", math.inf, 12)]
)


def test_markdown_aligns_numbers_to_the_right() -> None:
    assert TABLE.markdown().splitlines() == [
        "A title", "", "| name | width | n |", "| :-- | --: | --: |", "| a | 1.00 | 3 |", "| bc | ∞ | 12 |",
    ]  # fmt: skip


def test_the_plain_table_has_columns_of_equal_width() -> None:
    assert TABLE.plain().splitlines() == ["A title", "name  width   n", "a      1.00   3", "bc        ∞  12"]


def test_files_hold_unrounded_numbers() -> None:
    assert TABLE.csv() == "name,width,n\na,1.0,3\nbc,inf,12\n"
    assert TABLE.records()[1] == {"name": "bc", "width": None, "n": 12}


@pytest.mark.parametrize(("share", "shown"), [(1.0, 100.0), (0.999999, 99.99), (0.5, 50.0), (0.0, 0.0)])
def test_a_hundred_per_cent_is_exactly_that(share: float, shown: float) -> None:
    assert percent(share) == shown


def test_a_check_says_whether_it_is_met() -> None:
    assert str(Check("width", 0.5, 0.4)) == "NOT MET: width = 0.5 (at most 0.4)"
    assert str(Check("inside", 1.0, 1.0, "at least")) == "met: inside = 1 (at least 1)"
    assert not Check("inside", math.nan, 1.0, "at least").is_met


def test_records_hold_no_number_of_numpy_and_none_that_json_does_not_know() -> None:
    row = ("a", np.float64(1.5), np.int64(3), np.bool_(True), math.nan)
    table = Table("t", "A title", tuple(map(Column, "abcde")), [row])
    (record,) = table.records()
    assert json.loads(json.dumps(record, allow_nan=False)) == {"a": "a", "b": 1.5, "c": 3, "d": True, "e": None}
    checks = [Check("width", np.float64(0.5), np.float64(0.4)), Check("width", math.nan, 1.0)]
    found = [json.loads(json.dumps(check.record(), allow_nan=False)) for check in checks]
    assert [(one["measured"], one["met"]) for one in found] == [(0.5, False), (None, False)]
