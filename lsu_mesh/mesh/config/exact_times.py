"""Moments of a TOML file as text: neither a date of TOML nor a number loses a digit on the way to whole nanoseconds."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from datetime import date
from decimal import Decimal
from fractions import Fraction
from typing import Any

_EXACT = (("mesh", "start_time"), ("mesh", "dt"))


def spell_out_dates(values: dict[str, Any]) -> None:
    """Moments as ISO text: the values are recorded, and a recording holds no dates of TOML."""
    for table, key in _moments(values):
        if isinstance(table[key], date):
            table[key] = table[key].isoformat()


def keep_digits(values: dict[str, Any], text: str) -> None:
    """Put numbers that say moments, or dt, as the text that they are in ``text`` where a float holds fewer digits."""
    decimals = tomllib.loads(text, parse_float=Decimal)
    for (table, key), (exact, _) in zip(_moments(values), _moments(decimals), strict=True):
        table[key] = with_all_digits(table[key], exact[key])


def with_all_digits(value: Any, exact: Any) -> Any:
    """The number, or its decimal text where a float does not say it."""
    if not isinstance(value, float) or not isinstance(exact, Decimal) or not exact.is_finite():
        return value
    return value if Fraction(repr(value)) == Fraction(exact) else str(exact)


def is_moment(key: str) -> bool:
    """Whether the value at a path such as ``mesh.start_time`` is kept to the last digit."""
    return tuple(key.split(".")) in _EXACT


def _moments(values: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """The tables and keys that hold moments, and that of dt."""
    for name, key in _EXACT:
        table = values.get(name)
        if isinstance(table, dict) and key in table:
            yield table, key
    model = values.get("model")
    schedule = model.get("schedule") if isinstance(model, dict) else None
    for entry in schedule if isinstance(schedule, list) else ():
        if isinstance(entry, dict) and "from" in entry:
            yield entry, "from"
