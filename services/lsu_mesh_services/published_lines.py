"""Lines of text as measurements: JSON, or CSV with a header; numbers and times exactly as they are written."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

from lsu_mesh_services.client import Time, Value, WrongValue

ABOUT_TIME = ("time", "time_ns", "time_error", "time_error_ns", "step")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", re.ASCII)
_NAME = re.compile(r"[^\W\d][\w .()/°%-]*")
EXPECTED = 'expected a number, a list, an object such as {"time": "now", "y": [1.5]}, or a CSV header first'


@dataclass(frozen=True)
class Reading:
    """What a line says; ``time`` None where it says none."""

    values: Value | Sequence[Value] | Mapping[str, Value]
    time: Time | None = None
    more: Mapping[str, Any] = field(default_factory=dict)


class LineReader:
    """Reads line after line; a first line of names makes the rest CSV. ``key`` is that of the list of all values."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._columns: list[str] | None = None
        self._delimiter = ","
        self._is_first = True

    def readings(self, line: str, outputs: Sequence[str]) -> Iterator[Reading]:
        """What the line says: nothing where it is empty or a header.

        Raises :class:`WrongValue` with what was found and expected.
        """
        text = line.strip().removeprefix("\ufeff")
        if not text:
            return
        if self._is_first:
            self._is_first = False
            self._columns = self._header(text, outputs)
            if self._columns is not None:
                return
        if self._columns is None:
            yield self._json(text, outputs)
        elif self._cells(text) != self._columns:  # a program that began again repeats its header
            yield self._row(text, self._columns)

    def _header(self, text: str, outputs: Sequence[str]) -> list[str] | None:
        self._delimiter = next((one for one in (",", ";", "\t") if one in text), ",")
        cells = self._cells(text)
        if text[0] in '{["' or text in ("null", "true", "false", "NaN") or not all(map(_NAME.fullmatch, cells)):
            return None
        known = (*ABOUT_TIME, *outputs)
        if unknown := [cell for cell in cells if cell not in known]:
            self._is_first = True
            raise WrongValue(f"header {text!r}: unknown column {unknown[0]!r}; known are {', '.join(known)}")
        if twice := {cell for cell in cells if cells.count(cell) > 1}:
            self._is_first = True
            raise WrongValue(f"header {text!r}: column {min(twice)!r} stands there twice")
        return cells

    def _cells(self, text: str) -> list[str]:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=self._delimiter))]

    def _row(self, text: str, columns: Sequence[str]) -> Reading:
        cells = self._cells(text)
        if len(cells) != len(columns):
            raise WrongValue(f"{text!r}: {len(cells)} cells, the header has {len(columns)}: {', '.join(columns)}")
        row = dict(zip(columns, cells, strict=True))
        about = {name: row.pop(name) for name in ABOUT_TIME if name in row}
        values = {name: None if cell == "" else _decimal(name, cell) for name, cell in row.items()}
        whole = {name: _whole(name, about[name]) for name in ("time_ns", "time_error_ns", "step") if about.get(name)}
        more = whole | ({"time_error": about["time_error"]} if about.get("time_error") else {})
        return Reading(values, about.get("time") or None, more)

    def _json(self, text: str, outputs: Sequence[str]) -> Reading:
        try:
            found = json.loads(text, parse_float=Decimal, parse_constant=_no_number, object_pairs_hook=_without_copies)
        except WrongValue:
            raise
        except (ValueError, RecursionError):
            raise WrongValue(f"{text[:80]!r} cannot be read; {EXPECTED}") from None
        if not isinstance(found, dict):
            return Reading(found)
        about = {name: found.pop(name) for name in ABOUT_TIME if name in found}
        time = about.pop("time", None)
        for name in ("time_ns", "time_error_ns", "step"):
            if name in about:
                about[name] = _whole(name, about[name])
        is_list = list(found) == [self._key] and (self._key not in outputs or isinstance(found[self._key], list))
        return Reading(found[self._key] if is_list else found, time, about)


def _decimal(name: str, cell: str) -> Decimal:
    if _NUMBER.fullmatch(cell) is None:
        raise WrongValue(
            f"{name} = {cell!r} is no number; expected one such as 1.5, or nothing where none was measured"
        )
    return Decimal(cell)


def _whole(name: str, value: object) -> int:
    text = value if isinstance(value, str) else repr(value)
    if isinstance(value, bool) or re.fullmatch(r"\d{1,19}", text, re.ASCII) is None:
        raise WrongValue(f"{name} = {value!r}: expected a whole number ≥ 0")
    return int(text)


def _no_number(text: str) -> float:
    raise WrongValue(f"{text} is no measurement; give null where nothing was measured")


def _without_copies(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        twice = next(name for i, (name, _) in enumerate(pairs) if name in {other for other, _ in pairs[:i]})
        raise WrongValue(f"{twice!r} stands twice in one object")
    return found
