"""Processor time and resident memory of processes, as Linux tells them in ``/proc``."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

PROC = Path("/proc")
MIB = 2.0**20


def processor_seconds(pids: Iterable[int]) -> float | None:
    """Processor time that the processes have used so far, all their threads together; ``None`` without ``/proc``.

    The system counts in ticks, 10 ms on Linux. A process that has ended counts nothing: take the difference of two
    moments at which all of them run.
    """
    if not (PROC / "self" / "stat").exists():
        return None
    ticks = 0
    for pid in pids:
        try:
            text = (PROC / str(pid) / "stat").read_text(encoding="utf-8", errors="replace")
        except OSError:
            continue
        fields = text.rpartition(")")[2].split()  # the name before it may hold anything
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def resident_mib(pid: int) -> float | None:
    """Resident memory of a process in MiB, pages that it shares included; ``None`` where the system does not tell."""
    try:
        pages = int((PROC / str(pid) / "statm").read_text(encoding="utf-8").split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") / MIB
