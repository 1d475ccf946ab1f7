"""Times of ISO 8601, in exact nanoseconds since 1970 (UTC where no zone is given)."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import CellTexts, Flags, Integers
from lsu_mesh.mesh.data_files.cells import MAX_CELL
from lsu_mesh.mesh.data_files.numbers import bytes_of

NS = 10**9
MAX_SHAPES = 256
"""Of texts with other digits only; a column of times has a few."""
_TIME = re.compile(
    rb"(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)"
    rb"(?:[Tt ](?P<hour>\d\d):(?P<minute>\d\d)(?::(?P<second>\d\d)(?:[.,](?P<fraction>\d+))?)?"
    rb" ?(?P<zone>[Zz]|UTC|(?P<sign>[+-])(?P<zone_hour>\d\d)(?::?(?P<zone_minute>\d\d))?)?)?"
)
_DAYS = np.array([31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31])


class IsoTimes:
    """Times (T,) of ISO 8601 texts; ``is_time`` says which cells are such texts and moments that exist."""

    def __init__(self, cells: CellTexts) -> None:
        count = len(cells)
        self.ns = np.zeros(count, dtype=np.int64)
        self.is_time = np.zeros(count, dtype=bool)
        self.has_zone = np.zeros(count, dtype=bool)
        self.places = 0
        """The most digits of a second's fraction."""
        self.unit_ns = 86400 * NS
        """The finest unit that is written where there is no fraction."""
        characters = bytes_of(cells)
        shapes = np.where((characters >= 48) & (characters <= 57), np.uint8(48), characters)
        shapes = np.ascontiguousarray(shapes).view(cells.dtype).ravel() if count else cells
        left = np.arange(count)
        for _ in range(MAX_SHAPES):
            if not len(left):
                break
            is_alike = shapes[left] == shapes[left[0]]
            self._read(characters, left[is_alike], bytes(shapes[left[0]]))
            left = left[~is_alike]

    @property
    def digit_ns(self) -> int:
        """A unit of the last digit, at least 1 ns."""
        return max(1, NS // 10 ** min(self.places, 9)) if self.places else self.unit_ns

    def _read(self, characters: NDArray[np.uint8], rows: Integers, shape: bytes) -> None:
        """The texts of one shape: every part stands in the same columns of all of them."""
        match = _TIME.fullmatch(shape)
        if match is None or len(shape) > MAX_CELL:
            return

        def part(name: str) -> Integers:
            return _whole(characters, rows, match.span(name))

        year, month, day = part("year"), part("month"), part("day")
        hour, minute, second = part("hour"), part("minute"), part("second")
        days, good = _days_since_1970(year, month, day)
        zone_hour, zone_minute = part("zone_hour"), part("zone_minute")
        good &= (hour <= 23) & (minute <= 59) & (second <= 59) & (zone_hour <= 23) & (zone_minute <= 59)
        good &= (year >= 1826) & (year <= 2115)  # ±2⁶² ns
        offset = (zone_hour * 60 + zone_minute) * (-1 if match["sign"] == b"-" else 1)
        seconds = ((days * 24 + hour) * 60 + minute - offset) * 60 + second
        self.ns[rows] = np.where(good, seconds, 0) * NS + _fraction_ns(characters, rows, match.span("fraction"))
        self.is_time[rows] = good
        self.has_zone[rows] = match["zone"] is not None
        self.places = max(self.places, len(match["fraction"] or b""))
        written = 1 if match["second"] is not None else 60 if match["hour"] is not None else 86400
        self.unit_ns = min(self.unit_ns, written * NS)


def _whole(characters: NDArray[np.uint8], rows: Integers, span: tuple[int, int]) -> Integers:
    """The number in these columns, its first nine digits; 0 where there is no such part."""
    number = np.zeros(len(rows), dtype=np.int64)
    for column in range(span[0], min(span[1], span[0] + 9)):
        number = number * 10 + (characters[rows, column] - np.uint8(48))
    return number


def _fraction_ns(characters: NDArray[np.uint8], rows: Integers, span: tuple[int, int]) -> Integers:
    """A second's fraction in ns; what a tenth digit says is rounded."""
    digits = min(span[1] - span[0], 9)
    ns: Integers = _whole(characters, rows, span) * 10 ** (9 - digits)
    return ns + (characters[rows, span[0] + 9] >= ord("5")) if span[1] - span[0] > 9 else ns


def _days_since_1970(year: Integers, month: Integers, day: Integers) -> tuple[Integers, Flags]:
    """Days of the Gregorian calendar, and which dates exist (Hinnant, *chrono-compatible date algorithms*, 2014)."""
    is_month = (month >= 1) & (month <= 12)
    is_leap = (year % 4 == 0) & ((year % 100 != 0) | (year % 400 == 0))
    length = _DAYS[np.where(is_month, month, 1) - 1] + (is_leap & (month == 2))
    y = year - (month <= 2)
    day_of_year = (153 * (month + np.where(month > 2, -3, 9)) + 2) // 5 + day - 1
    days = 365 * y + y // 4 - y // 100 + y // 400 + day_of_year - 719468
    return days, is_month & (day >= 1) & (day <= length)
