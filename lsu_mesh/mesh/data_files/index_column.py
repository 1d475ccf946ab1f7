"""The column of times of a text: decimal numbers in some unit, or ISO 8601."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import CellTexts, Integers, Vector
from lsu_mesh.mesh.data_files.decimal_times import Decimals, unit_by_size
from lsu_mesh.mesh.data_files.iso_times import IsoTimes
from lsu_mesh.mesh.data_files.numbers import with_point
from lsu_mesh.mesh.data_files.problems import FileProblems, cell_place, shown
from lsu_mesh.mesh.data_files.settings import TIME_UNITS, DataFileSettings


@dataclass(frozen=True)
class Times:
    """``ns`` and ``half_ns`` (T,); a unit of the last digit; what was found."""

    ns: Integers
    half_ns: Integers
    digit_ns: int
    notes: tuple[str, ...]


def text_times(
    cells: CellTexts, name: str, lines: Integers, settings: DataFileSettings, problems: FileProblems
) -> Times:
    """The times of a column of texts; the first cell says whether they are numbers or ISO 8601."""
    if len(cells) and IsoTimes(cells[:1]).is_time[0]:
        return _iso(cells, name, lines, problems)
    written = cells
    decimals = Decimals(with_point(cells, name, lines, settings=settings, problems=problems))
    _refuse(~decimals.is_number, written, name, lines=lines, problems=problems, expected="a time")
    notes: list[str] = []
    unit_ns = find_unit(decimals.about()[decimals.is_number], name, settings, problems=problems, notes=notes)
    if unit_ns is None:
        return Times(decimals.mantissa, decimals.places, 1, ())  # of a column that is refused
    ns, fits = decimals.in_ns(unit_ns)
    if not fits.all():
        i = int(np.argmin(fits))
        text = f"{shown(written[i])} is beyond ±146 years from 1970 in nanoseconds; is time_unit right?"
        problems.add("far", cell_place(int(lines[i]), name), text, count=int((~fits).sum()))
    return Times(ns, np.zeros(len(ns), dtype=np.int64), decimals.digit_ns(unit_ns), tuple(notes))


def _iso(cells: CellTexts, name: str, lines: Integers, problems: FileProblems) -> Times:
    times = IsoTimes(cells)
    _refuse(
        ~times.is_time, cells, name, lines=lines, problems=problems, expected="an ISO 8601 time of a day that exists"
    )
    zones = times.has_zone[times.is_time]
    if zones.any() and not zones.all():
        i = int(np.flatnonzero(times.is_time & (times.has_zone != times.has_zone[0]))[0])
        text = f"{shown(cells[i])}: some times have a zone (Z, +02:00), some have none; write it everywhere"
        problems.add("zones", cell_place(int(lines[i]), name), text)
    notes = () if zones.all() else (f"times of {name!r} have no zone and are read as UTC",)
    return Times(times.ns, np.zeros(len(cells), dtype=np.int64), times.digit_ns, notes)


def _refuse(wrong: object, cells: CellTexts, name: str, lines: Integers, problems: FileProblems, expected: str) -> None:
    at = np.flatnonzero(np.asarray(wrong))
    if not len(at):
        return
    cell = bytes(cells[at[0]])
    if expected == "a time":
        expected = "seconds (or a unit given by time_unit) or an ISO 8601 time"
    found = f"found {shown(cell)}" if cell else "the cell is empty; every row needs its time"
    problems.add("time", cell_place(int(lines[at[0]]), name), f"expected {expected}, {found}", count=len(at))


def find_unit(
    values: Vector, name: str, settings: DataFileSettings, problems: FileProblems, notes: list[str]
) -> int | None:  # fmt: skip
    """Nanoseconds of the unit of a column of numbers: as given, or by their size, which is noted; None: a mistake."""
    if settings.time_unit is not None:
        return TIME_UNITS[settings.time_unit]
    if not len(values):
        return TIME_UNITS["s"]
    smallest, largest = float(values.min()), float(values.max())
    unit = unit_by_size(smallest, largest)
    if unit is None:
        text = (
            f"times from {smallest:g} to {largest:g} fit no unit: neither dates from 1990 to 2100 in s, ms, us or ns, "
            'nor seconds from a start; say which: time_unit = "s", "ms", "us" or "ns"'
        )
        problems.add("unit", f"column {name!r}", text)
        return None
    if unit != "s":
        notes.append(f'times of {name!r} are read as {unit} since 1970, by their size; time_unit = "{unit}" says so')
    return TIME_UNITS[unit]
