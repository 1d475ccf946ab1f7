"""Times written as decimal numbers, in exact nanoseconds: the text is never read through a float."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import CellTexts, Flags, Integers
from lsu_mesh.mesh.data_files.cells import MAX_CELL
from lsu_mesh.mesh.data_files.numbers import bytes_of
from lsu_mesh.mesh.data_files.settings import TIME_UNITS

MAX_TIME_NS = 2**62
"""±146 years: no later time is counted in ns."""
EARLIEST_S, LATEST_S = 631_152_000, 4_102_444_800
"""1990 and 2100: a number between them, in one of the units, is taken as a time since 1970."""
_MAX_DIGITS = 18
_NUMBER = re.compile(rb"([+-]?)(\d*)\.?(\d*)(?:[eE]([+-]?\d{1,3}))?")


class Decimals:
    """Decimal numbers (T,): exact, ``mantissa / 10**places`` or a fraction where that has too many digits."""

    def __init__(self, cells: CellTexts) -> None:
        self.mantissa = np.zeros(len(cells), dtype=np.int64)
        self.places = np.zeros(len(cells), dtype=np.int64)
        self.is_number = np.zeros(len(cells), dtype=bool)
        self._long: dict[int, Fraction] = {}
        plain = self._read_plain(cells)
        for i in np.flatnonzero(~plain).tolist():
            self._read_long(i, bytes(cells[i]))

    def _read_plain(self, cells: CellTexts) -> Flags:
        """Read cells of a sign, digits and a point, at most 18 digits, column by column."""
        columns = np.ascontiguousarray(bytes_of(cells).T)
        digits, points, others = (np.zeros(len(cells), dtype=np.int64) for _ in range(3))
        for j, column in enumerate(columns):
            digit = column - np.uint8(48)  # wraps: what is no digit is above 9
            is_digit, is_point = digit < 10, column == ord(".")
            self.mantissa = np.where(is_digit & (digits < _MAX_DIGITS), self.mantissa * 10 + digit, self.mantissa)
            digits += is_digit
            self.places += is_digit & (points > 0)
            points += is_point
            is_sign = ((column == ord("-")) | (column == ord("+"))) if j == 0 else np.zeros(len(cells), dtype=bool)
            others += ~(is_digit | is_point | is_sign | (column == 0))
        plain: Flags = (others == 0) & (points <= 1) & (digits > 0) & (digits <= _MAX_DIGITS)
        if len(columns):
            self.mantissa = np.where(columns[0] == ord("-"), -self.mantissa, self.mantissa)
        self.is_number = plain.copy()
        return plain

    def _read_long(self, i: int, cell: bytes) -> None:
        match = _NUMBER.fullmatch(cell)
        if match is None or not match[2] + match[3] or len(cell) > MAX_CELL:
            return
        exponent = int(match[4] or 0)
        self.is_number[i] = True
        value = Fraction(int(match[1] + (match[2] + match[3])) if match[2] + match[3] else 0)
        self._long[i] = value * Fraction(10) ** (exponent - len(match[3]))
        self.places[i] = max(0, len(match[3]) - exponent)

    def about(self) -> NDArray[np.float64]:
        """The numbers as floats, to judge their size only."""
        values = self.mantissa / 10.0 ** np.minimum(self.places, 300)
        for i, value in self._long.items():
            values[i] = float(value) if abs(value) < 10**308 else np.inf
        return values

    def in_ns(self, unit_ns: int) -> tuple[Integers, Flags]:
        """``value · unit_ns`` rounded to whole ns, halves to the even one; and which are within ±2⁶² ns."""
        ns = np.zeros(len(self.mantissa), dtype=np.int64)
        fits = np.ones(len(ns), dtype=bool)
        scale = len(str(unit_ns)) - 1
        for places in np.unique(self.places).tolist():
            rows = np.flatnonzero(self.places == places)
            mantissa = self.mantissa[rows]
            if places <= scale:
                factor = 10 ** (scale - places)
                inside = np.abs(mantissa) < MAX_TIME_NS // factor
                ns[rows] = np.where(inside, mantissa * factor, 0)
                fits[rows] = inside
            elif places - scale <= _MAX_DIGITS:
                ns[rows] = _divided(mantissa, 10 ** (places - scale))
        for i, value in self._long.items():
            fits[i] = abs(value) * unit_ns < MAX_TIME_NS
            ns[i] = round(value * unit_ns) if fits[i] else 0
        return ns, fits

    def digit_ns(self, unit_ns: int) -> int:
        """A unit of the last digit of the number with the most decimals, at least 1 ns."""
        places = int(self.places.max(initial=0))
        divisor: int = 10 ** min(places, _MAX_DIGITS)
        return max(1, unit_ns // divisor)


def _divided(mantissa: Integers, divisor: int) -> Integers:
    """``mantissa / divisor`` rounded, halves to the even one."""
    whole, rest = np.divmod(mantissa, divisor)
    up = (rest > divisor // 2) | ((rest == divisor // 2) & (whole % 2 == 1))  # the divisor is even
    rounded: Integers = whole + up
    return rounded


def unit_by_size(smallest: float, largest: float) -> str | None:
    """The unit of times between these: of a date from 1990 to 2100, or seconds if smaller; None if neither."""
    if max(abs(smallest), abs(largest)) < EARLIEST_S:
        return "s"
    for unit, unit_ns in TIME_UNITS.items():
        per_second = 10**9 // unit_ns
        if EARLIEST_S * per_second <= smallest and largest <= LATEST_S * per_second:
            return unit
    return None
