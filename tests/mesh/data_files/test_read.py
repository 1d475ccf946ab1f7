"""What a text says, the arrays say: numbers by the nearest double, times by exact fractions."""

from __future__ import annotations

import math
import random
import string
import time
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from data_file_settings import ReadText, settings_of
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from lsu_mesh.mesh.data_files import DataFile, DataFileError, read
from lsu_mesh.mesh.data_files.float_times import float_ns, half_spacing_ns

NS = 10**9
reusing = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
often = settings(reusing, max_examples=200)
decimals = st.from_regex(r"[+-]?([0-9]{1,12}(\.[0-9]{0,12})?|\.[0-9]{1,12})([eE][+-]?[0-9])?", fullmatch=True).filter(
    str.isascii
)
words = st.sampled_from(["", "nan", "NaN", "NA", "N/A", "null", "None", "-"])


@reusing
@given(
    cells=st.lists(st.one_of(decimals, st.floats(allow_nan=False, allow_infinity=False).map(repr), words), min_size=1)
)
@example(cells=["9007199254740993", "0.1", "1e22", "2.2250738585072011e-308"])
def test_every_number_is_the_nearest_double_and_every_word_is_missing(read_text: ReadText, cells: list[str]) -> None:
    found = read_text("t,y\n" + "".join(f"{i},{cell}\n" for i, cell in enumerate(cells))).columns["y"]
    for cell, value in zip(cells, found.tolist(), strict=True):
        assert (
            math.isnan(value) if cell.lower() in ("", "nan", "na", "n/a", "null", "none", "-") else value == float(cell)
        )


@reusing
@given(cells=st.lists(decimals.filter(lambda text: abs(Fraction(text)) < 10**9), min_size=1))
@example(cells=["0.0000000005", "0.0000000015", "-0.0000000005", "1e3", "123456789.1234567891234"])
def test_decimal_times_are_exact(read_text: ReadText, cells: list[str]) -> None:
    data = read_text("t,line\n" + "".join(f"{cell},{i}\n" for i, cell in enumerate(cells)), time_unit="s")
    assert data.time_ns is not None
    by_line = dict(zip(data.columns["line"].tolist(), data.time_ns.tolist(), strict=True))
    assert [by_line[i] for i in range(len(cells))] == [round(Fraction(cell) * NS) for cell in cells]
    assert not data.time_half_ns.any()
    assert (np.diff(data.time_ns) >= 0).all()


@pytest.mark.parametrize(
    ("cell", "unit", "ns"),
    [
        ("1600120070.123456789", "s", 1600120070123456789),
        ("1600120070123.456789", "ms", 1600120070123456789),
        ("1600120070123456.789", "us", 1600120070123456789),
        ("1600120070123456789", "ns", 1600120070123456789),
        ("100.5", "s", 100_500_000_000),
    ],
)
def test_the_unit_is_found_by_size_said_and_may_be_given(read_text: ReadText, cell: str, unit: str, ns: int) -> None:
    found, given_unit = read_text(f"t,y\n{cell},1\n"), read_text(f"t,y\n{cell},1\n", time_unit=unit)
    assert found.time_ns is not None
    assert given_unit.time_ns is not None
    assert found.time_ns.tolist() == given_unit.time_ns.tolist() == [ns]
    assert any(unit in note for note in found.notes) == (unit != "s")
    assert given_unit.notes == ()


@pytest.mark.parametrize(
    ("cell", "ns"),
    [
        ("2020-09-14T21:47:50Z", 1600120070 * NS),
        ("2020-09-14 21:47:50.123456789", 1600120070123456789),
        ("2020-09-14T23:47:50,5+02:00", 1600120070500000000),
        ("2020-09-14T16:17:50.5-0530", 1600120070500000000),
        ("2020-09-14T21:47Z", 1600120020 * NS),
        ("2020-09-14", 1600041600 * NS),
        ("2024-02-29T00:00:00Z", 1709164800 * NS),
        ("1969-12-31T23:59:59.5Z", -NS // 2),
        ("2020-09-14T21:47:50.1234567895Z", 1600120070123456790),
    ],
)
def test_iso_times_are_exact(read_text: ReadText, cell: str, ns: int) -> None:
    text = f'"{cell}"' if "," in cell else cell
    data = read_text(f"t,y\n{text},1\n")
    assert data.time_ns is not None
    assert data.time_ns.tolist() == [ns]


@reusing
@given(moments=st.lists(st.datetimes(), min_size=1, max_size=20), places=st.integers(0, 6))
def test_iso_times_are_those_of_the_standard_library(read_text: ReadText, moments: list, places: int) -> None:  # type: ignore[type-arg]
    kept = [moment for moment in moments if 1900 <= moment.year <= 2100]
    if not kept:
        return
    texts = [
        f"{moment:%Y-%m-%dT%H:%M:%S}" + (f".{moment.microsecond:06d}"[: places + 1] if places else "")
        for moment in kept
    ]
    from datetime import UTC, datetime, timedelta

    exact = [(datetime.fromisoformat(text).replace(tzinfo=UTC) - datetime(1970, 1, 1, tzinfo=UTC)) for text in texts]
    data = read_text("t,y\n" + "".join(f"{text}Z,{i}\n" for i, text in enumerate(texts)))
    assert data.time_ns is not None
    assert data.time_ns.tolist() == sorted(1000 * (one // timedelta(microseconds=1)) for one in exact)


def test_a_digit_is_a_unit_of_the_last_place(read_text: ReadText) -> None:
    assert read_text("t,y\n1.25,1\n2,1\n").digit_ns == NS // 100
    assert read_text("t,y\n1600120070123,1\n").digit_ns == 10**6
    assert read_text("t,y\n2020-09-14T21:47:50.25Z,1\n2020-09-14T21:47:51Z,1\n").digit_ns == NS // 100
    assert read_text("t,y\n2020-09-14T21:47Z,1\n").digit_ns == 60 * NS


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("t;y\n1;2.5\n2;\n", {}),
        ("t\ty\n1\t2.5\n2\tNA\n", {}),
        ("t|y\n1|2.5\n2|\n", {"delimiter": "|"}),
        ("t;y\n1;2,5\n2;\n", {"decimal": ","}),
        ('t,y\n1,"2,5"\n2,\n', {"decimal": ","}),
        ('"t","y"\n"1","2.5"\n"2",""\n', {}),
        ("\ufefft,y\r\n1,2.5\r\n2,\r\n", {}),
        ("t,y\r1,2.5\r2,\r", {}),
        ("t , y\n 1 ,\t2.5\n2,  \n", {}),
        ("# by hand\nt,y\n1,2.5\n# pause\n\n2,-\n", {}),
        ("t,y\n% pause\n1,2.5\n2,\n", {"comment": "%"}),
        ("Logger 3000\nserial,77,x\n\nt,y\n1,2.5\n2,\n", {}),
        ("t,y\n1,2.5\n2,-999\n", {"missing": ("-999",)}),
        ("t,y\n1,2.5\n2,???\n", {"missing": ("???",)}),
        ("t,y\n2,\n,\n1,2.5", {}),
    ],
)
def test_one_table_in_many_dresses(read_text: ReadText, text: str, options: dict[str, object]) -> None:
    data = read_text(text, **options)
    assert data.time_ns is not None
    assert data.time_ns.tolist() == [NS, 2 * NS]
    assert data.columns["y"][0] == 2.5
    assert math.isnan(data.columns["y"][1])


def test_rows_of_any_order_are_sorted_and_keep_their_lines(read_text: ReadText) -> None:
    data = read_text("t,y\n3,1\n1,2\n2,3\n1,4\n")
    assert data.lines.tolist() == [3, 5, 4, 2]
    assert data.columns["y"].tolist() == [2.0, 4.0, 3.0, 1.0]
    assert data.out_of_order == 3


@reusing
@given(seed=st.integers(0, 2**32))
def test_lines_by_lines_and_all_at_once_are_the_same(read_text: ReadText, seed: int) -> None:
    """A comment in the middle makes the reader go line by line."""
    rng = random.Random(seed)
    rows = [
        ",".join(rng.choice(["", "1", "-2.5", "3e2", "NA", " 4 "]) for _ in range(2)) for _ in range(rng.randint(1, 30))
    ]
    table = [f"{rng.randint(0, 9)},{row}\n" for row in rows]
    regular, broken = read_text("t,y,z\n" + "".join(table)), read_text("t,y,z\n" + "".join(table) + "# end\n")
    np.testing.assert_array_equal(regular.values, broken.values)
    np.testing.assert_array_equal(regular.lines, broken.lines)


def _outcome(path: Path, **options: object) -> DataFile | None:
    try:
        return read(settings_of(path, **options))
    except DataFileError as error:
        lines = error.lines
    assert lines
    assert all("\n" not in line for line in lines)
    return None


@often
@given(
    data=st.one_of(
        st.binary(max_size=200), st.text(alphabet='t,y;\t\n\r"#0123456789.-+eE_ nan\x00é', max_size=120).map(str.encode)
    )
)
def test_any_bytes_are_data_or_a_refusal(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "any"
    for head in (b"", b"t,y\n", b"step;y\n", b"PAR1", b"PK\x03\x04", b"\x93NUMPY\x01\x00\x76\x00"):
        path.write_bytes(head + data)
        for index in ("t", "step"):
            found = _outcome(path, index=index)
            assert found is None or np.isfinite(found.values[~np.isnan(found.values)]).all()


@often
@given(seed=st.integers(0, 2**32))
def test_a_damaged_table_is_data_or_a_refusal(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    text = bytearray(("t,y,z\n" + "".join(f"{i}.5,{rng.random()},{rng.random()}\n" for i in range(12))).encode())
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(text))
        cut = rng.choice((lambda: b"", lambda: rng.choice(string.printable).encode(), lambda: rng.randbytes(1)))()
        text[at : at + rng.randint(0, 3)] = cut
    path = tmp_path / "damaged.csv"
    path.write_bytes(text[: rng.randint(1, len(text))])
    _outcome(path)


@given(values=st.lists(st.floats(-4e9, 4e9), min_size=1), unit=st.sampled_from([1, 10**3, 10**6, NS]))
@example(values=[0.0000000005, 1.5 / 2**31, 2**31 + 0.5], unit=NS)
def test_float_times_are_the_nearest_nanosecond(values: list[float], unit: int) -> None:
    found = float_ns(np.array(values), unit)
    assert found.tolist() == [round(Fraction(value) * unit) for value in values]


@given(ns=st.integers(1_500_000_000 * NS, 1_800_000_000 * NS))
def test_half_the_spacing_holds_the_true_time(ns: int) -> None:
    stamp = np.array([float(Fraction(ns, NS))])
    half = half_spacing_ns(stamp, NS)
    assert half.tolist() == [119]
    assert abs(int(float_ns(stamp, NS)[0]) - ns) <= 119


@pytest.mark.alone
def test_a_million_rows_take_less_than_three_seconds_of_processor_time(tmp_path: Path) -> None:
    path, count = tmp_path / "long.csv", 10**6
    numbers = np.random.default_rng(1).normal(size=count).tolist()
    path.write_text("t,y\n" + "".join(f"{1600120070 + i / 100:.2f},{y!r}\n" for i, y in enumerate(numbers)))
    start = time.process_time()
    data = read(settings_of(path))
    assert time.process_time() - start < 3
    assert data.columns["y"].tolist() == numbers
