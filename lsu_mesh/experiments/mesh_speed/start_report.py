"""How long a mesh takes to start, and how much memory its roles hold, from several starts."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class Start(NamedTuple):
    """One start of a mesh whose kernels are compiled."""

    linked_s: float
    """From the start of the first process until all are linked to one another, seconds by the clock."""
    fused_s: float
    """Until the subscriber has the first fused set."""
    processor_s: float | None
    """Processor time of all processes until then; ``None``: the system tells none."""
    rss_mib: Mapping[str, float | None]
    """Resident memory of each process, by ``role name``, some seconds later."""


def start_lines(starts: Sequence[Start]) -> list[dict[str, Any]]:
    """One line for each time and each role: the median over the starts, of a role that of its largest process."""
    lines: list[dict[str, Any]] = [
        _line("all peers linked", seconds=statistics.median(start.linked_s for start in starts)),
        _line(
            "first fused set",
            seconds=statistics.median(start.fused_s for start in starts),
            processor_s=_median([start.processor_s for start in starts]),
        ),
    ]
    roles = list(dict.fromkeys(label.split()[0] for label in starts[0].rss_mib))
    return lines + [_line(role, rss_mib=_median([_largest(start, role) for start in starts])) for role in roles]


def _line(what: str, **numbers: float | None) -> dict[str, Any]:
    rounded = {name: None if value is None else float(f"{value:.4g}") for name, value in numbers.items()}
    return {"type": "start", "what": what, **rounded}


def _largest(start: Start, role: str) -> float | None:
    values = [mib for label, mib in start.rss_mib.items() if label.split()[0] == role and mib is not None]
    return max(values, default=None)


def _median(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return statistics.median(known) if known else None
