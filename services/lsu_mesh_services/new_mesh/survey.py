"""What a file of measurements holds, as far as a start for it needs to know."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.mesh.data_files import DataFile, DataFileError, DataFileSettings, columns_of, read

TIME_NAMES = (
    "time",
    "t",
    "timestamp",
    "stamp",
    "datetime",
    "date",
    "seconds",
    "time_s",
    "time_ms",
    "time_us",
    "time_ns",
)
STEP_NAMES = ("step", "k")
NS = 10**9
_NICE_DIGITS = 2


@dataclass(frozen=True)
class Survey:
    """A file's index, columns, and what its numbers say; one entry per column."""

    path: Path
    index: str
    indexed_by: str
    columns: tuple[str, ...]
    start_ns: int | None
    """One period before the first time."""
    dt: Fraction
    resolution: tuple[float, ...]
    """The largest number of which all differences of values are multiples; 0 where all are alike."""
    first: tuple[float, ...]
    largest_speed: tuple[float, ...]
    """|difference| of neighbours, per second."""
    largest_acceleration: tuple[float, ...]
    """|second difference| of neighbours, per second²."""
    left_out: tuple[str, ...]
    """Columns that hold no numbers."""


def survey(path: Path, time: str | None, step: str | None, columns: Sequence[str] | None) -> Survey:
    """Read a file whole. Raises :class:`DataFileError`, also where no column orders the rows."""
    names = columns_of(path)
    index, indexed_by = _index(path, names, time, step)
    asked = tuple(columns) if columns is not None else tuple(n for n in dict.fromkeys(names) if n and n != index)
    data, left_out = _read(path, asked, index, indexed_by, all_must_be_read=columns is not None)
    dt = _dt(data)
    start_ns = None if data.time_ns is None else int(data.time_ns[0]) - round(dt * NS)
    values, seconds = list(data.columns.values()), _seconds(data, dt)
    rates = [_rates(y, seconds, float(dt)) for y in values]
    return Survey(
        path=path,
        index=index,
        indexed_by=indexed_by,
        columns=tuple(data.columns),
        start_ns=start_ns,
        dt=dt,
        resolution=tuple(_resolution(y) for y in values),
        first=tuple(_first(y) for y in values),
        largest_speed=tuple(a for a, _ in rates),
        largest_acceleration=tuple(b for _, b in rates),
        left_out=left_out,
    )


def _index(path: Path, names: Sequence[str], time: str | None, step: str | None) -> tuple[str, str]:
    if time is not None or step is not None:
        return (time, "time") if time is not None else (str(step), "step")
    for known, indexed_by in ((TIME_NAMES, "time"), (STEP_NAMES, "step")):
        for name in names:
            if name.lower() in known:
                return name, indexed_by
    raise DataFileError([f"{path}: no column is called time or step ({', '.join(names)}); name it: --time COLUMN"])


def _read(
    path: Path, asked: Sequence[str], index: str, indexed_by: str, *, all_must_be_read: bool
) -> tuple[DataFile, tuple[str, ...]]:
    """The columns of numbers, and the names of the others."""
    try:
        return read(DataFileSettings(path, tuple(asked), index, indexed_by)), ()
    except DataFileError:
        if all_must_be_read:
            raise
    good = [name for name in asked if _is_read(DataFileSettings(path, (name,), index, indexed_by))]
    if not good:
        return read(DataFileSettings(path, tuple(asked), index, indexed_by)), ()  # says why
    return read(DataFileSettings(path, tuple(good), index, indexed_by)), tuple(n for n in asked if n not in good)


def _is_read(settings: DataFileSettings) -> bool:
    try:
        data = read(settings)
    except DataFileError:
        return False
    return not bool(np.isnan(data.values).all())


def _dt(data: DataFile) -> Fraction:
    """The median period with two digits, or in full where it is the only one; 1 s for steps."""
    if data.time_ns is None:
        return Fraction(1)
    gaps = np.diff(data.time_ns)
    gaps = gaps[gaps > 0]
    if not len(gaps):
        return Fraction(1)
    median = int(np.median(gaps))
    if (gaps == median).all():
        return Fraction(median, NS)
    return Fraction(f"{median / NS:.{_NICE_DIGITS}g}")


def _seconds(data: DataFile, dt: Fraction) -> NDArray[np.float64]:
    if data.time_ns is None:
        assert data.steps is not None
        return np.asarray((data.steps - data.steps[0]) * float(dt), dtype=np.float64)
    return np.asarray((data.time_ns - data.time_ns[0]) / NS, dtype=np.float64)


def _resolution(values: NDArray[np.float64]) -> float:
    """The largest q of which all differences of values are multiples, as decimals: .001, or 25; 0 for one value."""
    distinct = np.unique(values[~np.isnan(values)])
    exact = [Fraction(repr(value)) for value in distinct.tolist()]
    scale = math.lcm(*(value.denominator for value in exact))
    whole = [int(value * scale) for value in exact]
    return math.gcd(*(one - whole[0] for one in whole[1:])) / scale if len(whole) > 1 else 0.0


def _first(values: NDArray[np.float64]) -> float:
    known = values[~np.isnan(values)]
    return float(known[0]) if len(known) else 0.0


def _rates(values: NDArray[np.float64], seconds: NDArray[np.float64], dt: float) -> tuple[float, float]:
    """Largest speed and acceleration between neighbours; rows closer than half a step are one."""
    known = ~np.isnan(values)
    y, t = values[known], seconds[known]
    apart = np.concatenate([[True], np.diff(t) > dt / 2]) if len(t) else np.zeros(0, dtype=bool)
    y, t = y[apart], t[apart]
    if len(y) < 2:
        return 0.0, 0.0
    speed = np.diff(y) / np.diff(t)
    between = np.diff((t[1:] + t[:-1]) / 2)
    acceleration = np.abs(np.diff(speed) / between).max(initial=0.0)
    return float(np.abs(speed).max()), float(acceleration)
