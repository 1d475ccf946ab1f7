"""``start_time`` and ``dt`` of a configuration, exactly."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from fractions import Fraction

import numpy as np

from lsu_mesh.errors import ModelError
from lsu_mesh.mesh.data_files.decimal_times import MAX_TIME_NS, Decimals, unit_by_size
from lsu_mesh.mesh.data_files.iso_times import IsoTimes
from lsu_mesh.mesh.data_files.settings import TIME_UNITS

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def start_time_ns(value: object) -> tuple[int, str]:
    """Nanoseconds of a number, a text, or a date of TOML, and the unit that was found for a number ("" for a date).

    Numbers are seconds; one of the size of a date from 1990 to 2100 in ms, us or ns is read so. Moments without a zone
    are UTC. Raises :class:`lsu_mesh.errors.ModelError`.
    """
    if isinstance(value, date):
        moment = value if isinstance(value, datetime) else datetime(value.year, value.month, value.day)
        since = (moment if moment.tzinfo else moment.replace(tzinfo=UTC)) - _EPOCH
        return _checked(since // timedelta(microseconds=1) * 1000, value), ""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise _unreadable(value)
    cell = np.array([(value if isinstance(value, str) else repr(value)).strip().encode()], dtype=np.bytes_)
    iso = IsoTimes(cell)
    if iso.is_time[0]:
        return int(iso.ns[0]), ""
    decimals = Decimals(cell)
    if not decimals.is_number[0]:
        raise _unreadable(value)
    about = float(decimals.about()[0])
    unit = unit_by_size(about, about) or "s"
    ns, fits = decimals.in_ns(TIME_UNITS[unit])
    return _checked(int(ns[0]) if fits[0] else MAX_TIME_NS, value), unit


def exact_dt(value: object) -> Fraction:
    """Seconds of a number or a text such as "0.02" or "1/30"; a float is the decimal that it is written as.

    Raises :class:`lsu_mesh.errors.ModelError`.
    """
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str | Fraction):
            raise ValueError
        dt = Fraction(value if isinstance(value, int | Fraction) else str(value).strip())
    except (ValueError, ZeroDivisionError, OverflowError):
        raise ModelError(f'expected seconds such as 0.02, or a fraction such as "1/30", found {value!r}') from None
    if dt <= 0:
        raise ModelError(f"expected a number > 0, found {value!r}")
    return dt


def _checked(ns: int, value: object) -> int:
    if abs(ns) >= MAX_TIME_NS:
        raise ModelError(f"{value} is beyond ±146 years from 1970, which are counted in nanoseconds")
    return ns


def _unreadable(value: object) -> ModelError:
    return ModelError(f'expected seconds, or a moment such as 2024-05-01T12:00:00Z, found "{value}"')
