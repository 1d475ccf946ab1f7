"""Recorded measurements and inputs: CSV files with a header, in order of a time or step column.

An empty cell is a missing value. Times are seconds or ISO 8601 (UTC where no zone is given).
"""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.errors import LsuMeshError

if TYPE_CHECKING:
    from lsu_mesh.mesh.config.settings import MeasurementFileSettings

MAX_SHOWN = 20


class FileProblems(LsuMeshError):
    """A measurement file is wrong; ``lines`` say file, line, column, value and remedy."""

    def __init__(self, lines: Sequence[str]) -> None:
        shown = list(lines[:MAX_SHOWN])
        if len(lines) > MAX_SHOWN:
            shown.append(f"{lines[0].split(': ')[0]}: and {len(lines) - MAX_SHOWN} more mistakes of this kind")
        super().__init__("\n".join(shown))
        self.lines = shown


@dataclass(frozen=True)
class Columns:
    """``index`` (T,): seconds or steps; ``values`` (T, m), NaN = missing."""

    columns: tuple[str, ...]
    index: NDArray[np.float64]
    values: NDArray[np.float64]


@dataclass(frozen=True)
class Playback:
    """Values by step: ``values[k]`` belongs to ``steps[k]``, ascending.

    ``collisions`` rows shared a step with an earlier row and were left out.
    """

    steps: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    values: NDArray[np.float64]
    collisions: int


def read_playback(settings: MeasurementFileSettings, dt: float, start_time: float | None) -> Playback:
    """The file's values by step, ``step = round((t − start_time)/dt)`` for a time column.

    The first row of a step counts.
    Rows before step 1 are left out. Raises :class:`FileProblems`.
    """
    table = read_columns(settings, default_count=len(settings.columns))
    if settings.indexed_by == "time":
        origin = 0.0 if start_time is None else start_time
        steps = np.rint((table.index - origin) / dt).astype(np.int64)
        times = np.array([round(t * 1e9) for t in table.index], dtype=np.int64)
    else:
        steps = table.index.astype(np.int64)
        times = np.zeros(len(steps), dtype=np.int64)
    order = np.argsort(steps, kind="stable")
    order = order[steps[order] >= 1]
    first = np.ones(len(order), dtype=bool)
    first[1:] = steps[order][1:] != steps[order][:-1]
    kept = order[first]
    return Playback(steps[kept], np.maximum(times[kept], 0), table.values[kept], int((~first).sum()))


def read_columns(settings: MeasurementFileSettings, default_count: int) -> Columns:
    """Read and check a CSV file.

    Without named columns all but the index column are taken, if they are ``default_count``.
    """
    path = settings.path
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return _parse(csv.reader(file), settings, default_count)
    except OSError as error:
        raise FileProblems([f"{path}: cannot be read: {error.strerror}"]) from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileProblems([f"{path}: not a CSV file: {error}"]) from None


def _parse(rows: csv._reader, settings: MeasurementFileSettings, default_count: int) -> Columns:  # type: ignore[name-defined]
    path = settings.path
    header = [name.strip() for name in next(rows, [])]
    names = settings.columns or tuple(name for name in header if name != settings.index)
    lines = [
        f"{path}: line 1: there is no column {name!r}; the columns are {', '.join(header) or 'none'}"
        for name in dict.fromkeys([settings.index, *names])
        if name not in header
    ]
    if not settings.columns and len(names) != default_count:
        lines.append(
            f"{path}: line 1: {len(names)} value columns ({', '.join(names)}) for {default_count} outputs; "
            "name the right ones with columns = […]"
        )
    if lines:
        raise FileProblems(lines)
    at = [header.index(name) for name in names]
    index_at = header.index(settings.index)
    index: list[float] = []
    values: list[list[float]] = []
    for number, row in enumerate(rows, start=2):
        if not any(cell.strip() for cell in row):
            continue
        cells = [*row, *[""] * (len(header) - len(row))]
        place = f"{path}: line {number}"
        index.append(_index(cells[index_at], settings, place, lines))
        values.append([_number(cells[i], header[i], place, lines) for i in at])
    if not index:
        lines.append(f"{path}: holds no rows below the header")
    if lines:
        raise FileProblems(lines)
    return Columns(tuple(names), np.array(index), np.array(values).reshape(len(index), len(names)))


def _index(cell: str, settings: MeasurementFileSettings, place: str, lines: list[str]) -> float:
    text = cell.strip()
    try:
        value = float(text)
    except ValueError:
        value = _iso_seconds(text) if settings.indexed_by == "time" else math.nan
    whole = settings.indexed_by == "time" or value == math.floor(value) if math.isfinite(value) else False
    if not whole or abs(value) > 2**53:
        expected = "seconds or an ISO 8601 time" if settings.indexed_by == "time" else "a whole number"
        lines.append(f"{place}, column {settings.index!r}: expected {expected}, found {cell!r}")
        return 0.0
    return value


def _iso_seconds(text: str) -> float:
    try:
        moment = datetime.fromisoformat(text)
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    except ValueError:
        return math.nan


def _number(cell: str, column: str, place: str, lines: list[str]) -> float:
    text = cell.strip()
    if not text:
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.inf
    if not math.isfinite(value):
        lines.append(f"{place}, column {column!r}: expected a number or nothing (= missing), found {cell!r}")
    return value
