"""Columns of NumPy and Parquet files, which have types of their own, as numbers, times and steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import CellTexts, Flags, Integers, Vector
from lsu_mesh.mesh.data_files.decimal_times import MAX_TIME_NS
from lsu_mesh.mesh.data_files.float_times import float_ns, half_spacing_ns
from lsu_mesh.mesh.data_files.index_column import Times, find_unit, text_times
from lsu_mesh.mesh.data_files.numbers import MAX_STEP, read_numbers, read_steps
from lsu_mesh.mesh.data_files.problems import FileProblems, cell_place
from lsu_mesh.mesh.data_files.settings import DataFileSettings


@dataclass(frozen=True)
class TypedColumn:
    """``data`` (T,): floats, whole numbers (int64), times (int64, in ``unit_ns``) or texts; ``missing`` (T,)."""

    name: str
    data: NDArray[np.generic]
    missing: Flags
    unit_ns: int | None = None
    """Of a column of times."""

    @property
    def is_text(self) -> bool:
        """Whether the values are written in digits."""
        return self.data.dtype.kind == "S"


def typed_numbers(column: TypedColumn, settings: DataFileSettings, problems: FileProblems) -> Vector:
    """(T,), NaN = missing."""
    lines = np.arange(1, len(column.data) + 1, dtype=np.int64)
    if column.is_text:
        cells: CellTexts = np.where(column.missing, b"", column.data.astype(np.bytes_))
        return read_numbers(cells, column.name, lines, settings=settings, problems=problems)
    if column.unit_ns is not None:
        problems.add(f"time {column.name}", f"column {column.name!r}", "holds times; expected numbers")
    values = np.where(column.missing, np.nan, column.data.astype(np.float64))
    _refuse(np.isinf(values), column, problems, "is infinite; leave it out where there is no value")
    return values


def typed_steps(column: TypedColumn, settings: DataFileSettings, problems: FileProblems) -> Integers:
    """(T,)."""
    if column.is_text:
        lines = np.arange(1, len(column.data) + 1, dtype=np.int64)
        return read_steps(column.data.astype(np.bytes_), column.name, lines, settings=settings, problems=problems)
    values = column.data.astype(np.float64)
    with np.errstate(invalid="ignore"):
        whole = (values == np.floor(values)) & (np.abs(values) <= MAX_STEP) & ~column.missing
    _refuse(~whole, column, problems, "is no whole number")
    return np.where(whole, values, 0.0).astype(np.int64)


def typed_times(column: TypedColumn, settings: DataFileSettings, problems: FileProblems) -> Times:
    """Times in ns; floats are known to half their spacing."""
    count = len(column.data)
    if column.is_text:
        lines = np.arange(1, count + 1, dtype=np.int64)
        return text_times(column.data.astype(np.bytes_), column.name, lines, settings=settings, problems=problems)
    is_float = column.data.dtype.kind == "f"
    bad = column.missing | (~np.isfinite(column.data.astype(np.float64)) if is_float else False)
    _refuse(bad, column, problems, "is no time; every row needs one")
    data = np.where(bad, np.zeros(1, column.data.dtype), column.data)
    notes: list[str] = []
    unit_ns = column.unit_ns
    if unit_ns is None:
        about = data[~bad].astype(np.float64)
        unit_ns = find_unit(about, column.name, settings, problems=problems, notes=notes)
    if unit_ns is None:
        return Times(np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64), 1, ())  # it is refused
    far = np.abs(data.astype(np.float64)) * unit_ns >= MAX_TIME_NS
    _refuse(far, column, problems, "is beyond ±146 years from 1970 in nanoseconds; is time_unit right?")
    data = np.where(far, np.zeros(1, data.dtype), data)
    if is_float:
        half = half_spacing_ns(data, unit_ns)
        notes.append(f"times are floating-point numbers, known to ±{int(half.max(initial=0))} ns")
        return Times(float_ns(data.astype(np.float64), unit_ns), half, 1, tuple(notes))
    return Times(data.astype(np.int64) * unit_ns, np.zeros(count, dtype=np.int64), unit_ns, tuple(notes))


def _refuse(wrong: Flags, column: TypedColumn, problems: FileProblems, text: str) -> None:
    if wrong.any():
        i = int(np.argmax(wrong))
        value = "a missing value" if column.missing[i] else str(column.data[i])
        place = cell_place(i + 1, column.name).replace("line", "row")
        problems.add(f"{text} {column.name}", place, f"{value} {text}", count=int(wrong.sum()))
