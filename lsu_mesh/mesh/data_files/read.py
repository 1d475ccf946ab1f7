"""Reading a file of data, whole or only its header."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lsu_mesh.array_types import Integers, Vector
from lsu_mesh.mesh.data_files.cells import split_rows
from lsu_mesh.mesh.data_files.data_file import DataFile
from lsu_mesh.mesh.data_files.index_column import Times, text_times
from lsu_mesh.mesh.data_files.last_line import check_last_line
from lsu_mesh.mesh.data_files.layout import check_text, find_layout, guess_names
from lsu_mesh.mesh.data_files.numbers import read_numbers, read_steps
from lsu_mesh.mesh.data_files.numpy_files import NumpyFile
from lsu_mesh.mesh.data_files.opening import HEAD_BYTES, FileKind, kind_of, read_bytes
from lsu_mesh.mesh.data_files.parquet_files import ParquetFile
from lsu_mesh.mesh.data_files.problems import FileProblems
from lsu_mesh.mesh.data_files.settings import DataFileSettings
from lsu_mesh.mesh.data_files.typed_columns import typed_numbers, typed_steps, typed_times


def look(settings: DataFileSettings, count: int | None = None) -> tuple[str, ...]:
    """The value columns, from the header alone; where none are named, all but the index, and ``count`` of them.

    Raises :class:`DataFileError` for a file that is not there, of no known kind, or without these columns.
    """
    problems = FileProblems(settings.path)
    kind = kind_of(settings.path, settings.max_bytes, problems)
    place = ""
    if kind is FileKind.TEXT:
        head = read_bytes(settings.path, HEAD_BYTES, problems)
        text = check_text(head, problems, whole=len(head) < HEAD_BYTES)
        if head and not text:
            raise problems.fail(f"the first line is longer than {HEAD_BYTES // 1024} KiB; this is no table of rows")
        layout = find_layout(text, settings, problems)
        names, place = layout.names, f"line {layout.header_line}"
    else:
        names = _typed_file(settings, kind, problems).names
    return _value_columns(names, settings, count, place=place, problems=problems)


def columns_of(path: Path) -> tuple[str, ...]:
    """All names of a file's header, whatever they are. Raises :class:`DataFileError`."""
    settings = DataFileSettings(path, (), "", "time")
    problems = FileProblems(path)
    kind = kind_of(path, settings.max_bytes, problems)
    if kind is not FileKind.TEXT:
        return _typed_file(settings, kind, problems).names
    head = read_bytes(path, HEAD_BYTES, problems)
    return guess_names(check_text(head, problems, whole=len(head) < HEAD_BYTES), settings, problems)


def read(settings: DataFileSettings, count: int | None = None) -> DataFile:
    """The whole file. Raises :class:`DataFileError` with a line per kind of mistake."""
    problems = FileProblems(settings.path)
    kind = kind_of(settings.path, settings.max_bytes, problems)
    found = (
        _read_text(settings, count, problems) if kind is FileKind.TEXT else _read_typed(settings, kind, count, problems)
    )
    problems.raise_if_any()
    if not found.row_count:
        problems.add("empty", "", "holds no rows below the header" if kind is FileKind.TEXT else "holds no rows")
    problems.raise_if_any()
    return found


def _value_columns(
    names: Sequence[str], settings: DataFileSettings, count: int | None, place: str, problems: FileProblems
) -> tuple[str, ...]:
    values = settings.columns or tuple(name for name in names if name != settings.index)
    for name in dict.fromkeys((settings.index, *values)):
        if name not in names:
            text = f"there is no column {name!r}; the columns are {', '.join(names) or 'none'}"
            problems.add(f"column {name}", place, text)
    if not settings.columns and count is not None and len(values) != count:
        told = f"{len(values)} value columns ({', '.join(values)}) for {count} outputs"
        problems.add("count", place, f"{told}; name the right ones with columns = […]")
    problems.raise_if_any()
    return tuple(values)


def _read_text(settings: DataFileSettings, count: int | None, problems: FileProblems) -> DataFile:
    data = check_text(read_bytes(settings.path, settings.max_bytes + 1, problems), problems, whole=True)
    layout = find_layout(data, settings, problems)
    values = _value_columns(layout.names, settings, count, place=f"line {layout.header_line}", problems=problems)
    cells = split_rows(
        data, layout, tuple(dict.fromkeys((settings.index, *values))), settings=settings, problems=problems
    )
    check_last_line(cells, layout, settings.decimal, problems)
    index = cells.columns[settings.index]
    times = steps = None
    if settings.indexed_by == "time":
        times = text_times(index, settings.index, cells.lines, settings=settings, problems=problems)
    else:
        steps = read_steps(index, settings.index, cells.lines, settings=settings, problems=problems)
    columns = {
        name: read_numbers(cells.columns[name], name, cells.lines, settings=settings, problems=problems)
        for name in values
    }
    return _ordered(settings, columns, cells.lines, times=times, steps=steps, blank=cells.blank, notes=layout.notes)


def _typed_file(settings: DataFileSettings, kind: FileKind, problems: FileProblems) -> NumpyFile | ParquetFile:
    if kind is FileKind.PARQUET:
        return ParquetFile(settings.path, settings.max_bytes, problems)
    return NumpyFile(settings.path, settings.max_bytes, problems, is_npz=kind is FileKind.NPZ)


def _read_typed(settings: DataFileSettings, kind: FileKind, count: int | None, problems: FileProblems) -> DataFile:
    file = _typed_file(settings, kind, problems)
    values = _value_columns(file.names, settings, count, place="", problems=problems)
    index, *columns = file.read(tuple(dict.fromkeys((settings.index, *values))))
    times = steps = None
    if settings.indexed_by == "time":
        times = typed_times(index, settings, problems)
    else:
        steps = typed_steps(index, settings, problems)
    by_name = {column.name: typed_numbers(column, settings, problems) for column in columns}
    if settings.index in values:
        by_name[settings.index] = typed_numbers(index, settings, problems)
    rows = np.arange(1, len(index.data) + 1, dtype=np.int64)
    return _ordered(
        settings, {name: by_name[name] for name in values}, rows, times=times, steps=steps, blank=0, notes=()
    )


def _ordered(
    settings: DataFileSettings, columns: dict[str, Vector], lines: Integers, times: Times | None,
    steps: Integers | None, blank: int, notes: Sequence[str],
) -> DataFile:  # fmt: skip
    """The rows by time or step; rows of one moment stay in the order of the file."""
    index = steps if times is None else times.ns
    assert index is not None
    later = np.maximum.accumulate(index) if len(index) else index
    out_of_order = int((index < later).sum())
    order = np.argsort(index, kind="stable") if out_of_order else slice(None)
    half = np.zeros(len(lines), dtype=np.int64) if times is None else times.half_ns[order]
    return DataFile(
        path=settings.path,
        columns={name: values[order] for name, values in columns.items()},
        lines=lines[order],
        time_ns=None if times is None else times.ns[order],
        time_half_ns=half,
        digit_ns=1 if times is None else times.digit_ns,
        steps=None if steps is None else steps[order],
        out_of_order=out_of_order,
        blank=blank,
        notes=(*notes, *(times.notes if times is not None else ())),
    )
