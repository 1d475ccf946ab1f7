"""NumPy and Parquet files give what the same table as a text gives, as far as their types can say it."""

from __future__ import annotations

import random
import sys
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from data_file_settings import settings_of

from lsu_mesh.mesh.data_files import DataFile, DataFileError, look, read

parquet = pytest.importorskip("pyarrow.parquet")
pa = pytest.importorskip("pyarrow")

NS = 10**9
START = 1_600_120_070 * NS
TIMES = np.array([START, START + 20_000_000, START + 50_000_001], dtype=np.int64)
VALUES = np.array([1.5, np.nan, -2.0])


def written(path: Path, columns: dict[str, Any]) -> Path:
    if path.suffix == ".parquet":
        parquet.write_table(pa.table(columns), path)
    else:
        np.savez(path, **{name: np.asarray(column) for name, column in columns.items()})
    return path


def times(data: DataFile) -> list[int]:
    assert data.time_ns is not None
    return data.time_ns.tolist()


@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
@pytest.mark.parametrize("kind", ["M8[ns]", "i8", "f8"])
def test_times_are_exact_where_the_type_is(tmp_path: Path, suffix: str, kind: str) -> None:
    column = np.array([float(Fraction(ns, NS)) for ns in TIMES.tolist()]) if kind == "f8" else TIMES.astype(kind)
    path = written(tmp_path / f"data{suffix}", {"t": column, "y": VALUES})
    data = read(settings_of(path))
    np.testing.assert_array_equal(data.columns["y"], VALUES)
    if kind == "f8":
        assert data.time_half_ns.tolist() == [119] * 3
        assert np.abs(np.array(times(data)) - TIMES).max() <= 119
        assert data.notes == ("times are floating-point numbers, known to ±119 ns",)
    else:
        assert times(data) == TIMES.tolist()
        assert not data.time_half_ns.any()
    assert look(settings_of(path)) == ("y",)


@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
@pytest.mark.parametrize("unit", ["s", "ms", "us"])
def test_coarser_units_are_read_too(tmp_path: Path, suffix: str, unit: str) -> None:
    path = written(tmp_path / f"data{suffix}", {"t": TIMES[:1].astype("M8[ns]").astype(f"M8[{unit}]"), "y": [1]})
    assert times(read(settings_of(path))) == [START]


def test_texts_decimals_and_holes_of_parquet_are_read(tmp_path: Path) -> None:
    from decimal import Decimal

    table = {"t": ["2020-09-14T21:47:50Z", "2020-09-14T21:47:51Z"], "y": [Decimal("1.25"), None], "z": [None, 3]}
    data = read(settings_of(written(tmp_path / "data.parquet", table)))
    assert times(data) == [START, START + NS]
    np.testing.assert_array_equal(data.values, [[1.25, np.nan], [np.nan, 3]])


def test_arrays_of_numpy_are_columns_by_name_field_or_number(tmp_path: Path) -> None:
    np.savez(tmp_path / "wide.npz", step=[1, 2], y=[[1.0, 2.0], [3.0, 4.0]])
    assert look(settings_of(tmp_path / "wide.npz", index="step")) == ("y.1", "y.2")
    assert read(settings_of(tmp_path / "wide.npz", index="step")).values.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    np.save(tmp_path / "plain.npy", np.array([[1.0, 7.0], [2.0, 8.0]]))
    assert read(settings_of(tmp_path / "plain.npy", index="1")).values.tolist() == [[7.0], [8.0]]
    np.save(tmp_path / "fields.npy", np.array([(1, 7.0), (2, 8.0)], dtype=[("step", "i8"), ("y", "f8")]))
    data = read(settings_of(tmp_path / "fields.npy", index="step"))
    assert data.steps is not None
    assert (data.steps.tolist(), data.values.tolist()) == ([1, 2], [[7.0], [8.0]])


@pytest.mark.parametrize(
    ("columns", "line"),
    [
        ({"t": [1.0, np.nan], "y": [1, 2]}, "row 2, column 't': a missing value is no time; every row needs one"),
        ({"t": [1.0, np.inf], "y": [1, 2]}, "row 2, column 't': inf is no time; every row needs one"),
        ({"t": [1.0, 2.0], "y": [1.0, np.inf]}, "row 2, column 'y': inf is infinite; leave it out"),
        ({"t": [1.0, 2.0], "z": [1, 2]}, "there is no column 'y'; the columns are t, z"),
        ({"t": [0.0, 5e12], "y": [1, 2]}, "column 't': times from 0 to 5e+12 fit no unit"),
        ({"t": [1.0, 2.0], "y": [True, False]}, "column 'y': holds bool"),
        ({"t": [], "y": []}, "holds no rows"),
    ],
)
@pytest.mark.parametrize("suffix", [".npz", ".parquet"])
def test_one_line_says_what_is_wrong(tmp_path: Path, suffix: str, columns: dict[str, Any], line: str) -> None:
    columns = {name: np.array(column) for name, column in columns.items()}
    if suffix == ".parquet":
        line = line.replace("holds bool", "holds values of type bool")
    path = written(tmp_path / f"data{suffix}", columns)
    with pytest.raises(DataFileError) as caught:
        read(settings_of(path, columns=["y"]))
    assert caught.value.lines[0].startswith(f"{path}: {line}")
    assert len(caught.value.lines) == 1


def test_a_step_that_is_no_whole_number_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "data.npz", {"step": [1.0, 2.5], "y": [1, 2]})
    with pytest.raises(DataFileError, match=r"row 2, column 'step': 2\.5 is no whole number"):
        read(settings_of(path, index="step"))


def test_what_is_too_large_for_64_bits_is_refused_by_name(tmp_path: Path) -> None:
    path = written(tmp_path / "data.npz", {"step": [1, 2], "y": np.array(["1", "1e4000"]).astype(np.longdouble)})
    with pytest.raises(DataFileError, match=r"column 'y'.*inf"):
        read(settings_of(path, index="step"))


def test_archives_that_are_no_data_are_named(tmp_path: Path) -> None:
    for name, word in (("[Content_Types].xml", "an Excel workbook"), ("notes.txt", "a zip archive without arrays")):
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.writestr(name, "x")
        with pytest.raises(DataFileError, match=word):
            read(settings_of(tmp_path / "a.zip"))


def test_arrays_that_would_fill_the_memory_are_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "data.npz"
    np.savez_compressed(path, t=np.zeros(1000), y=np.zeros(1000))
    with pytest.raises(DataFileError, match="unpacks to more than"):
        read(settings_of(path, max_bytes=path.stat().st_size))
    header = np.lib.format.magic(1, 0) + (118).to_bytes(2, "little")
    text = "{'descr': '<f8', 'fortran_order': False, 'shape': (4000000000000,), }".ljust(117) + "\n"
    (tmp_path / "bomb.npy").write_bytes(header + text.encode())
    with pytest.raises(DataFileError, match="declares an array of 32000000000000 bytes"):
        read(settings_of(tmp_path / "bomb.npy", index="1"))


def test_pickles_are_not_opened(tmp_path: Path) -> None:
    np.save(tmp_path / "objects.npy", np.array([1, "a"], dtype=object), allow_pickle=True)
    with pytest.raises(DataFileError, match="Object arrays cannot be loaded"):
        read(settings_of(tmp_path / "objects.npy", index="1", columns=["1"]))


def test_parquet_without_pyarrow_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path / "data.parquet", {"t": [1.0], "y": [1.0]})
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(DataFileError, match=r'is Parquet, which needs pyarrow: pip install "lsu-mesh\[record\]"'):
        read(settings_of(path))


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".parquet"])
def test_damaged_files_are_data_or_a_refusal(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"data{suffix}"
    if suffix == ".npy":
        np.save(path, np.array([(1, 7.0), (2, 8.0)], dtype=[("t", "i8"), ("y", "f8")]))
    else:
        written(path, {"t": TIMES, "y": VALUES})
    whole, rng, refused = path.read_bytes(), random.Random(1), 0
    for _ in range(300):
        damaged = bytearray(whole)
        for _ in range(rng.randint(1, 3)):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        path.write_bytes(damaged[: rng.choice((len(damaged), rng.randrange(len(damaged))))])
        try:
            read(settings_of(path))
        except DataFileError:
            refused += 1
    assert refused > 100
