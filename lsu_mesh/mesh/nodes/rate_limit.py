"""How fast a source that is late may publish.

After a standstill of the whole machine, links are broken for a moment. What a source publishes then must still be in
its cache when the links are back. So it publishes a third of what its cache holds at once, then steps at the mesh's
rate, and ``HURRY`` times as fast when the links have had time to come back.
"""

from __future__ import annotations

import math

from lsu_mesh.mesh.nodes.node import SECOND

SETTLING_NS = SECOND
"""Links are back after so long."""
HURRY = 5.0
"""So many times as fast as time does a late source publish then."""


class RateLimit:
    """Steps that may go out: a bucket of ``kept/3`` tokens, filled at the mesh's rate, later ``HURRY`` times as fast.

    Parameters
    ----------
    rate:
        Steps per second of the mesh.
    kept:
        Steps that a publisher keeps for those who come late.
    """

    def __init__(self, rate: float, kept: int) -> None:
        self._per_ns = rate / SECOND
        self._most = max(1, kept // 3)
        self._full_at: int | None = None
        """When the bucket was full last; times in nanoseconds."""
        self._spent = 0
        """Steps since then."""

    def take(self, steps: int, now: int) -> int:
        """How many of these steps may go out now, and do; times never go back."""
        if self._full_at is None or self._filled(now) >= self._spent:
            self._full_at, self._spent = now, 0
        taken = max(0, min(steps, self._most - self._spent + int(self._filled(now))))
        self._spent += taken
        return taken

    def ready_at(self) -> int:
        """When a step may go out, 0 for at once."""
        lacking = self._spent - self._most + 1
        if self._full_at is None or lacking <= 0:
            return 0
        settling = min(SETTLING_NS, lacking / self._per_ns)
        hurried = (lacking - settling * self._per_ns) / (HURRY * self._per_ns)
        return self._full_at + math.ceil(settling + hurried)

    def _filled(self, now: int) -> float:
        """Tokens since the bucket was full."""
        assert self._full_at is not None
        passed = now - self._full_at
        settling = min(SETTLING_NS, passed)
        return self._per_ns * (settling + HURRY * (passed - settling))
