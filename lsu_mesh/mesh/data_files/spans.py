"""Moments and durations in words."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from lsu_mesh.mesh.data_files.decimal_times import EARLIEST_S

NS = 10**9
_UNITS = ((86400 * NS, "d"), (3600 * NS, "h"), (60 * NS, "min"), (NS, "s"), (10**6, "ms"), (10**3, "us"), (1, "ns"))


def duration_text(ns: int) -> str:
    """Four digits in the largest fitting unit, such as 10 ms, 1.25 s, 33.3 min."""
    if ns == 0:
        return "0 s"
    for size, unit in _UNITS:
        if abs(ns) >= size:
            return f"{ns / size:.4g} {unit}"
    return f"{ns} ns"


def moment_text(ns: int) -> str:
    """A date with its fraction of a second if it is one since 1990, else seconds; both exact."""
    if ns < EARLIEST_S * NS:
        return f"{seconds_text(ns)} s"
    whole, rest = divmod(ns, NS)
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=whole)
    fraction = f".{rest:09d}".rstrip("0") if rest else ""
    return f"{moment:%Y-%m-%dT%H:%M:%S}{fraction}Z"


def seconds_text(ns: int) -> str:
    """Seconds as an exact decimal, such as 100.5."""
    whole, rest = divmod(abs(ns), NS)
    fraction = f".{rest:09d}".rstrip("0") if rest else ""
    return f"{'-' if ns < 0 else ''}{whole}{fraction}"
