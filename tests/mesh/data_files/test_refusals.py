"""Files of mistakes: one line for each kind, with line, column, value and remedy."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from data_file_settings import Refusals, settings_of

from lsu_mesh.mesh.data_files import DataFileError, look, read

LONG = "".join(f"{i},2.25\n" for i in range(9))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("t,y\n1,2,5\n2,2\n3,1,5\n", "line 2: 3 cells, the header has 2; a decimal comma, as in 1,5, splits a number"),
        ("t;y\n1;2;5\n", "line 2: 3 cells, the header has 2; a text that holds ';' needs quotes"),
        ("t,y\n1,2,\n2,2,\n", "line 2: the row ends with a ',' that the header does not have; remove it (2 such rows)"),
        (
            "t,y,z\n1,2\n2,2,3\n",
            "line 2: 2 cells, the header has 3; write every cell, an empty one for a missing value",
        ),
        ("t,y,y\n1,2,3\n", "line 1: columns 2 and 3 are both called 'y'; rename one of them"),
        ("t,y,z\n1,2,3\n2,2", "line 3: the last line is cut off: 2 cells, the header has 3, and no line end follows"),
        ("t,y\n1,2.25\n2,2.", "line 3, column 'y': the last line has no line end, and its last cell '2.' ends in the"),
        ("t,y\n1,2.25\n2,-", "line 3, column 'y': the last line has no line end, and its last cell '-' ends in the"),
        (f"t,y\n{LONG}9,2.2", "line 11, column 'y': the last line has no line end, and its last cell '2.2' is shorter"),
        (f"t,y\n{LONG}9,", "line 11, column 'y': the last line has no line end, and its last cell '' is shorter"),
        (
            "t,y\n1,high\n2,1\n3,low\n",
            "line 2, column 'y': expected a number or nothing (= missing), found 'high'; if it",
        ),
        (
            "t,y\n1,inf\n",
            "line 2, column 'y': expected a number or nothing (= missing), found 'inf'; leave the cell empty",
        ),
        ("t,y\n1,1_0\n", "line 2, column 'y': expected a number or nothing (= missing), found '1_0'; write the number"),
        ("t,y\n1,0x1f\n", "line 2, column 'y': expected a number or nothing (= missing), found '0x1f'"),
        ("t,y\n1,1.79769313486231580e325\n", "line 2, column 'y': '1.79769313486231580e325' is too large for a number"),
        ("t,y\n1,1e999\n", "line 2, column 'y': '1e999' is too large for a number of 64 bits"),
        ("t,y\n1,1-2\n", "line 2, column 'y': expected a number or nothing (= missing), found '1-2'"),
        (
            "t;y\n1;2,5\n",
            "line 2, column 'y': expected a number or nothing (= missing), found '2,5'; is this a decimal",
        ),
        (
            't,y\n1,"1,234.5"\n',
            "line 2, column 'y': expected a number or nothing (= missing), found '1,234.5'; write the",
        ),
        (
            "t,y\n1," + "1" * 99 + "\n",
            "line 2, column 'y': expected a number or nothing (= missing), found '" + "1" * 39,
        ),
        ("t,y\n1," + " " * 75 + "123456789\n", "line 2, column 'y': expected a number or nothing (= missing), found '"),
        (
            "t,y\n1." + "0" * 90 + ",2\n",
            "line 2, column 't': expected seconds (or a unit given by time_unit) or an ISO",
        ),
        (
            "# t,y\n1,2\n2,3\n",
            "line 2: there is no column 't'; the columns are 1, 2; line 1 names it, but begins with '#'",
        ),
        (
            "1,2\n2,3\n",
            "line 1: there is no column 't'; the columns are 1, 2; these are numbers, so the file has no header",
        ),
        ("T,y\n1,2\n", "line 1: there is no column 't'; the columns are T, y; did you mean 'T'?"),
        ("t\n1\n", "line 1: 't' is the only column; expected a column of values beside it"),
        ("t,y,T (°C)\n1,2,3\n".encode("latin-1"), "line 1: byte 0xb0 ('°' in Latin-1) is not UTF-8; if the text is"),
        ("t,y\n1,2\n".encode("utf-16"), "is UTF-16 text; save it as UTF-8"),
        (b"t,y\n1,2\n\0\0", "line 3: holds a zero byte; this is no text, or it was damaged"),
        ('t,y\n1,"2\n2,3\n', "line 3: a quote is not closed, or stands inside a cell"),
        ("t,y\n0,2\n5e12,2\n", "column 't': times from 0 to 5e+12 fit no unit: neither dates from 1990 to 2100"),
        (
            "t,y\n2024-05-01,2\n2023-02-29,2\n",
            "line 3, column 't': expected an ISO 8601 time of a day that exists, found",
        ),
        (
            "t,y\n2024-05-01 12:00,2\n2024-05-01 12:01Z,2\n",
            "line 3, column 't': '2024-05-01 12:01Z': some times have a zone",
        ),
        (
            "t,y\n1,2\n,3\n",
            "line 3, column 't': expected seconds (or a unit given by time_unit) or an ISO 8601 time, the",
        ),
        (
            "t,y\n1_0,3\n",
            "line 2, column 't': expected seconds (or a unit given by time_unit) or an ISO 8601 time, found",
        ),
        ("", "is empty"),
        ("t,y\n", "holds no rows below the header"),
        ("t,y\n,\n", "holds no rows below the header"),
        (b"\x1f\x8b\x08aa", "is compressed by gzip; unpack it: gunzip FILE"),
        (b"\x89HDF\r\n", "is an HDF5 (or MATLAB 7.3) file; save the columns as CSV, Parquet or .npz"),
    ],
)
def test_one_line_says_place_value_and_remedy(refusals: Refusals, text: str | bytes, line: str) -> None:
    lines = refusals(text)
    assert lines[0].startswith(f"data.csv: {line}"), lines
    assert len(lines) == 1


def test_kinds_of_mistakes_come_together_each_once_with_its_count(refusals: Refusals) -> None:
    rows = "".join(f"{i},high,inf\n" for i in range(500))
    assert [line.rpartition(" (")[2] for line in refusals(f"t,y,z\n{rows}")] == ["500 such cells)", "500 such cells)"]


@pytest.mark.parametrize(
    ("options", "text", "line"),
    [
        (
            {"decimal": ","},
            "t;y\n1;1.234,5\n",
            "data.csv: line 2, column 'y': '1.234,5' has a point, but decimal = \",\"",
        ),
        ({"time_unit": "s"}, "t,y\n1e300,2\n", "data.csv: line 2, column 't': '1e300' is beyond ±146 years from 1970"),
        ({"time_unit": "s"}, "t,y\n1600120070000,2\n", "data.csv: line 2, column 't': '1600120070000' is beyond"),
        (
            {"index": "step"},
            "step,y\n1,2\n2.5,3\n",
            "data.csv: line 3, column 'step': expected a whole number, found '2.5'",
        ),
        (
            {"index": "step"},
            "step,y\n1,2\n1e17,3\n",
            "data.csv: line 3, column 'step': expected a whole number, found '1e17'",
        ),
        ({"index": "step"}, "step,y\n1,2\n,3\n", "data.csv: line 3, column 'step': expected a whole number, found ''"),
        ({"columns": ["z", "y"]}, "t,y\n1,2\n", "data.csv: line 1: there is no column 'z'; the columns are t, y"),
        ({"columns": ["y"]}, "t,y,t\n1,2,3\n", "data.csv: line 1: columns 1 and 3 are both called 't'"),
        ({"delimiter": ";"}, "t,y\n1,2\n", "data.csv: line 1: there is no column 't'; the columns are t,y"),
        ({"max_bytes": 10}, "t,y\n1,2\n3,4\n", "data.csv: holds 12 bytes, at most 10 bytes are read; split it"),
    ],
)
def test_what_settings_say_is_held_to(refusals: Refusals, options: dict[str, object], text: str, line: str) -> None:
    lines = refusals(text, **options)
    assert lines[0].startswith(line)
    assert len(lines) == 1


def test_what_is_no_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path, word in (
        (tmp_path, "is a folder"),
        (tmp_path / "pipe", "is a pipe (FIFO)"),
        (Path("/dev/zero"), "is a device"),
        (tmp_path / "nowhere.csv", "cannot be read: No such file or directory"),
        (tmp_path / "zero\0byte", "cannot be read"),
    ):
        for reads in (look, read):
            with pytest.raises(DataFileError) as caught:
                reads(settings_of(path))
            assert caught.value.lines[0].startswith(f"{path}: {word}")


def test_a_file_that_is_too_large_is_not_opened(tmp_path: Path) -> None:
    huge = tmp_path / "huge.csv"
    with huge.open("wb") as file:
        file.truncate(2**40)  # no block of it is written
    with pytest.raises(DataFileError, match="holds 1048576 MiB, at most 512 MiB are read"):
        read(settings_of(huge))


def test_columns_that_nobody_wants_may_hold_anything(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("t,who,y,who\n1,Ada,2,-\n2,Bob,3,x\n")
    assert read(settings_of(path, columns=["y"])).values.tolist() == [[2.0], [3.0]]


def test_the_header_alone_is_looked_at(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    path.write_text("t,y,z\n" + "1,2,high\n" * 100_000)
    assert look(settings_of(path)) == ("y", "z")
    assert look(settings_of(path, columns=["z"])) == ("z",)
    with pytest.raises(DataFileError, match=r"line 1: 2 value columns \(y, z\) for 1 outputs; name the right ones"):
        look(settings_of(path), 1)
    path.write_bytes(b"t" * 10**6)
    with pytest.raises(DataFileError, match="the first line is longer than 256 KiB"):
        look(settings_of(path))
