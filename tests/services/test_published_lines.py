"""Lines of text as measurements: what is read exactly, and what is refused with its remedy."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import pytest
from lsu_mesh_services.client import WrongValue
from lsu_mesh_services.published_lines import LineReader, Reading

OUTPUTS = ("x", "y")


def readings(*lines: str, outputs: tuple[str, ...] = OUTPUTS, key: str = "y") -> list[Reading]:
    reader = LineReader(key)
    return [reading for line in lines for reading in reader.readings(line, outputs)]


@pytest.mark.parametrize(
    ("line", "values", "time", "more"),
    [
        ("1.5\n", Decimal("1.5"), None, {}),
        ("-3", -3, None, {}),
        ("[1.1, null]", [Decimal("1.1"), None], None, {}),
        ("null", None, None, {}),
        ('{"time": 1700000000.123456789, "y": [1, 2]}', [1, 2], Decimal("1700000000.123456789"), {}),
        ('{"time": "now", "x": 0.1}', {"x": Decimal("0.1")}, "now", {}),
        ('{"x": 1, "y": 2}', {"x": 1, "y": 2}, None, {}),
        ('{"y": 2}', {"y": 2}, None, {}),
        ('{"time_ns": 1700000000123456789, "time_error": 0.1, "x": 1}', {"x": 1}, None,
         {"time_ns": 1700000000123456789, "time_error": Decimal("0.1")}),
    ],
)  # fmt: skip
def test_json(line: str, values: Any, time: Any, more: dict[str, Any]) -> None:
    assert readings(line) == [Reading(values, time, more)]


def test_the_list_of_all_values_has_the_key_of_the_message() -> None:
    assert readings('{"y": 1.5}', outputs=("gauge",)) == [Reading(Decimal("1.5"))]
    assert readings('{"u": [1]}', outputs=("0",), key="u") == [Reading([1])]


def test_csv_with_a_header_that_comes_again() -> None:
    lines = ("time,y,x", "1700000000.123456789,1.1,", "", "time,y,x", "now,2,3", ",4,5")
    assert readings(*lines) == [
        Reading({"y": Decimal("1.1"), "x": None}, "1700000000.123456789"),
        Reading({"y": Decimal(2), "x": Decimal(3)}, "now"),
        Reading({"y": Decimal(4), "x": Decimal(5)}, None),
    ]


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_other_delimiters(delimiter: str) -> None:
    lines = (f"time_ns{delimiter}x", f"12{delimiter}1.5")
    assert readings(*lines) == [Reading({"x": Decimal("1.5")}, None, {"time_ns": 12})]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (("1.5.2",), "'1.5.2' cannot be read; expected a number"), (("[1, 2",), "cannot be read"),
        (("1 2",), "a CSV header first"), (("time,z",), "unknown column 'z'; known are time"),
        (("x,x",), "'x' stands there twice"), (("x,y", "1"), "1 cells, the header has 2: x, y"),
        (("x", "1,5"), "2 cells, the header has 1"), (("x", "1_5"), "x = '1_5' is no number"),
        (("x", "nan"), "x = 'nan' is no number"), (("[NaN]",), "give null where nothing was measured"),
        (('{"x": 1, "x": 2}',), "'x' stands twice"), (('{"time_ns": 1.5, "x": 1}',), "whole number"),
        (("{" * 5000,), "cannot be read"), (("9" * 5000,), "cannot be read"),
    ],
    ids=lambda value: str(value)[:40],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_with_what_was_expected(lines: tuple[str, ...], words: str) -> None:
    with pytest.raises(WrongValue) as refusal:
        readings(*lines)
    assert words in str(refusal.value)


def test_a_reader_goes_on_after_a_bad_header() -> None:
    reader = LineReader("y")
    with pytest.raises(WrongValue):
        list(reader.readings("speed", OUTPUTS))
    assert list(reader.readings("x,y", OUTPUTS)) == []
    assert list(reader.readings("1,2", OUTPUTS)) == [Reading({"x": Decimal(1), "y": Decimal(2)})]
