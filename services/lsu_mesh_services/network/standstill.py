"""Whether a process stood still: it was stopped, or its machine was. It cannot tell how long ago came what waits."""

from __future__ import annotations

import time
from collections.abc import Callable

SECOND_NS = 1_000_000_000
STANDSTILL_NS = SECOND_NS // 2
"""So long between two looks, and the thread stood still,"""
MAX_SHARE = 0.1
"""where it has computed for less than this share of it: one that computes for so long is busy."""
BETWEEN_NS = SECOND_NS // 10
"""So often the processor's time is read; the call costs as much as taking a message."""


class Standstill:
    """What one thread asks whenever it takes something, also where the queue is empty."""

    def __init__(self, computed_ns: Callable[[], int] = time.thread_time_ns) -> None:
        self._computed_ns = computed_ns
        self._looked_at: int | None = None
        self._had_computed = 0

    def look(self, now: int) -> bool:
        """Whether the thread stood still since the last look, by the receiver's clock in ns."""
        if self._looked_at is None:
            self._looked_at, self._had_computed = now, self._computed_ns()
            return False
        passed = now - self._looked_at
        if 0 <= passed < BETWEEN_NS:
            return False
        computed = self._computed_ns()
        stood = passed > STANDSTILL_NS and computed - self._had_computed < MAX_SHARE * passed
        self._looked_at, self._had_computed = now, computed
        return stood
