"""What a value of the file has to be: words for people, and a strict conversion.

Nothing is converted silently: ``"no"`` is no boolean, ``20.0`` is no whole number, ``true`` is no number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Generic, TypeVar

from lsu_mesh.mesh.config.problem import closest, nearest
from lsu_mesh.mesh.config.write import value_text

T = TypeVar("T")
WHOLE_LIMIT = 2**53
"""Whole numbers up to here are exact as numbers of other languages too."""
SHOWN_LENGTH = 60
_DURATION = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*(us|ms|s|min)")
_UNIT_SECONDS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0}
_SIZE = re.compile(r"([0-9]{1,9}(?:\.[0-9]{1,9})?)\s*(kB|MB|GB)")
_UNIT_BYTES = {"kB": 10**3, "MB": 10**6, "GB": 10**9}
_SPAN = re.compile(r"([0-9]{1,18}(?:\.[0-9]{1,18})?)\s*(ns|us|ms|s|min)")
_UNIT_NS = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9, "min": 60 * 10**9}
MAX_NS = 2**62
"""146 years: longer spans are not counted in nanoseconds."""
SMALLEST = 5e-324
"""A number larger than minus this is not negative."""
_TRUE, _FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")


class Unfit(Exception):
    """A value is not as expected; ``remedy`` and ``nearest`` say what may be meant, ``text`` is a better sentence."""

    def __init__(self, remedy: str = "", *, nearest: str | None = None, text: str = "") -> None:
        super().__init__(text or remedy)
        self.remedy, self.nearest, self.text = remedy, nearest, text


@dataclass(frozen=True)
class Expected(Generic[T]):
    """``words`` complete "expected …"; ``convert`` returns the value or raises :class:`Unfit`."""

    words: str
    convert: Callable[[Any], T]

    def explain(self, value: object, unfit: Unfit) -> str:
        """The sentence for a value that ``convert`` refused."""
        said = unfit.text or f"expected {self.words}, found {shown(value)}"
        return f"{said}; {unfit.remedy}" if unfit.remedy else said


def shown(value: object) -> str:
    """The value as TOML text, cut where it is long."""
    try:
        text = value_text(value)
    except (TypeError, ValueError, RecursionError):  # dates, and whole numbers or lists beyond Python's limits
        text = str(value) if not isinstance(value, int | list | dict) else "a value too large to be shown"
    return text if len(text) <= SHOWN_LENGTH else text[: SHOWN_LENGTH - 3] + "…"


def is_number(value: Any) -> bool:
    """A finite number; ``true`` and ``false`` are none."""
    return is_real(value) and math.isfinite(value)


def is_real(value: Any) -> bool:
    """A number that a float can hold, infinity included; ``nan``, ``true`` and ``false`` are none."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    with suppress(OverflowError):
        return not math.isnan(float(value))
    return False


def as_flag(value: Any) -> bool:
    """true or false, and nothing that could pass for one."""
    if isinstance(value, bool):
        return value
    word = str(value).strip().lower() if isinstance(value, str | int) else ""
    raise Unfit("write true" if word in _TRUE else "write false" if word in _FALSE else "")


def as_whole(value: Any, low: int, high: int) -> int:
    """A whole number within limits; 20.0 is none."""
    if not isinstance(value, int) or isinstance(value, bool):
        raise Unfit(_whole_remedy(value))
    if not low <= value <= high:
        raise Unfit
    return value


def _whole_remedy(value: Any) -> str:
    if isinstance(value, float) and value.is_integer() and abs(value) <= WHOLE_LIMIT:
        return f"write {int(value)}"
    return f"write {value.strip()}" if isinstance(value, str) and re.fullmatch(r"\s*[+-]?[0-9]{1,15}\s*", value) else ""


def as_number(value: Any, above: float = -math.inf) -> float:
    """A finite number larger than ``above``."""
    if is_number(value) and value > above:
        return float(value)
    if isinstance(value, str):
        with suppress(ValueError):
            number = float(value)
            raise Unfit(f"write {value.strip()} without quotes" if math.isfinite(number) and number > above else "")
    raise Unfit


def as_text(value: Any) -> str:
    """A string that is not empty."""
    if isinstance(value, str) and value:
        return value
    raise Unfit("put it in quotes" if isinstance(value, int | float) and not isinstance(value, bool) else "")


def as_table(value: Any) -> dict[str, Any]:
    """A table."""
    if isinstance(value, dict):
        return value
    raise Unfit


def as_string(value: Any) -> str:
    """A string, also an empty one."""
    return value if value == "" else as_text(value)


def as_list(value: Any, of: Expected[T]) -> list[T]:
    """A list whose items are all as expected; the first that is not is named."""
    if not isinstance(value, list | tuple):
        raise Unfit
    items = []
    for number, item in enumerate(value, start=1):
        try:
            items.append(of.convert(item))
        except Unfit as unfit:
            raise Unfit(f"item {number}: {of.explain(item, unfit)}", nearest=unfit.nearest) from None
    return items


def as_rows(value: Any) -> list[list[float]]:
    """Rows of one length."""
    rows = as_list(value, VECTOR)
    if not rows:
        raise Unfit("give at least one row")
    lengths = [len(row) for row in rows]
    if len(set(lengths)) > 1:
        raise Unfit(f"the rows have {', '.join(map(str, lengths))} numbers")
    return rows


def choice(choices: Sequence[Any]) -> Expected[Any]:
    """One of a few values; of words the nearest is named."""
    listed = ", ".join(str(one) if isinstance(one, str) else shown(one) for one in choices)
    words = [one for one in choices if isinstance(one, str)]

    def convert(value: Any) -> Any:
        for one in choices:
            if type(value) is type(one) and value == one:
                return one
        if not isinstance(value, str) or not words:
            raise Unfit
        text = f"{shown(value)} is no choice; {nearest(value, words)} (choices: {listed})"
        raise Unfit(text=text, nearest=closest(value, words))

    return Expected(f"one of {', '.join(shown(one) for one in choices)}", convert)


def whole(low: int, high: int) -> Expected[int]:
    """A whole number from ``low`` to ``high``."""
    words = f"a whole number ≥ {low}" if high == WHOLE_LIMIT else f"a whole number from {low} to {high}"
    return Expected(words, lambda value: as_whole(value, low, high))


def number(above: float = -math.inf) -> Expected[float]:
    """A finite number, larger than ``above``; whole numbers are numbers too."""
    words = "a finite number" if above == -math.inf else f"a number > {above:g}"
    return Expected(words, lambda value: as_number(value, above))


def nats() -> Expected[float]:
    """A gain: a finite number, not negative."""
    return Expected("a number of nats ≥ 0", lambda value: as_number(value, -SMALLEST))


def duration(low: float = 0.0) -> Expected[float]:
    """A time such as "50ms", in seconds."""

    def convert(value: Any) -> float:
        match = _DURATION.fullmatch(value) if isinstance(value, str) else None
        if match is None:
            raise Unfit(f'write "{value}s" if seconds are meant' if is_number(value) else "")
        seconds = float(match[1]) * _UNIT_SECONDS[match[2]]
        if not low <= seconds < math.inf:
            raise Unfit
        return seconds

    return Expected(f'a duration of at least {low:g} s such as "50ms", "0.2s" or "1min"', convert)


def as_size(value: Any) -> int:
    """A size such as "500MB", in bytes."""
    match = _SIZE.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        raise Unfit(f'write "{value}MB" if megabytes are meant' if is_number(value) else "")
    return int(Fraction(match[1]) * _UNIT_BYTES[match[2]])


def span_ns(low: int = 0) -> Expected[int]:
    """A time such as "5ms", or a number of seconds, in whole nanoseconds; nothing is rounded."""

    def convert(value: Any) -> int:
        match = _SPAN.fullmatch(value) if isinstance(value, str) else None
        if match is not None:
            span = Fraction(match[1]) * _UNIT_NS[match[2]]
        elif is_number(value):
            span = Fraction(repr(value)) * 10**9  # the decimal as it is written
        else:
            raise Unfit
        if span.denominator != 1:
            raise Unfit("it is no whole number of nanoseconds")
        if not low <= span < MAX_NS:
            raise Unfit
        return int(span)

    least = f"of at least {low} ns " if low else ""
    return Expected(f'a duration {least}such as "5ms" or "200us", or a number of seconds', convert)


def each(words: str, of: Expected[T]) -> Expected[list[T]]:
    """A list of such values."""
    return Expected(words, lambda value: as_list(value, of))


def known_names(known: Iterable[str], sentence: str) -> Expected[str]:
    """A name that is defined elsewhere in the file; ``sentence`` says of ``{name}`` that it is not."""
    names = sorted(known)

    def convert(value: Any) -> str:
        if isinstance(value, str) and value in names:
            return value
        if not isinstance(value, str):
            raise Unfit
        text = f"{sentence.format(name=shown(value))}; {nearest(value, names)}"
        raise Unfit(text=text, nearest=closest(value, names))

    listed = ", ".join(map(shown, names))
    return Expected(f"one of {listed}" if names else "a name that is defined", convert)


SIZE = Expected('a size such as "500MB" or "2GB"', as_size)
FLAG = Expected("true or false", as_flag)
TEXT = Expected("a string that is not empty", as_text)
STRING = Expected("a string", as_string)
VECTOR = each("a list of finite numbers", number())
MATRIX = Expected("a matrix: a list of rows of one length, of finite numbers", as_rows)
TEXTS = each("a list of strings", STRING)
TABLES = each("a list of tables such as [{kind = …}]", Expected("a table", as_table))
