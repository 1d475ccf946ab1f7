"""How fast a source that is late may publish.

After a standstill of the whole machine, links are broken for a moment. What a source publishes then must still be in
its cache when the links are back. So it publishes a third of what its cache holds at once, then steps at the mesh's
rate, and ``HURRY`` times as fast when the links have been back for a moment, in which others ask for what they missed.
"""

from __future__ import annotations

import math

from lsu_mesh.mesh.nodes.node import SECOND

SETTLING_NS = SECOND
"""So long after the links are back, others have asked for what they missed."""
MAX_SETTLING_NS = 4 * SECOND
"""After so long a source hurries in any case: a peer that has left does not come back. Until then it has published no
more than it keeps, which is six seconds of steps."""
HURRY = 5.0
"""So many times as fast as time does a late source publish then."""


class RateLimit:
    """Steps that may go out: a bucket of ``kept/3`` tokens, filled at the mesh's rate, later ``HURRY`` times as fast.

    Later is ``SETTLING_NS`` after there were as many links as when the bucket was full last, or ``MAX_SETTLING_NS``.

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
        self._links = self._usual_links = 0
        """Connections of the process: now, and when the bucket was full last."""
        self._back_at: int | None = None
        """Since when there are as many as usual; None while some are missing."""
        self._hurries_at: int | None = None
        """Since when the bucket is filled faster; None before."""

    def record_links(self, count: int, now: int) -> None:
        """How many peers and routers the process is connected to."""
        self._links = count
        if count < self._usual_links:
            self._back_at = None
        elif self._back_at is None:
            self._back_at = now

    def take(self, steps: int, now: int) -> int:
        """How many of these steps may go out now, and do; times never go back."""
        if self._full_at is None or self._filled(now) >= self._spent:
            self._begin(now)
        if self._hurries_at is None and now >= self._hurry_from():
            self._hurries_at = now
        taken = max(0, min(steps, self._most - self._spent + int(self._filled(now))))
        self._spent += taken
        return taken

    def ready_at(self) -> int:
        """When a step may go out, 0 for at once."""
        lacking = self._spent - self._most + 1
        if self._full_at is None or lacking <= 0:
            return 0
        slowly = self._full_at + math.ceil(lacking / self._per_ns)
        since = self._hurries_at
        if since is None or slowly <= since:
            return slowly
        return since + math.ceil((lacking - (since - self._full_at) * self._per_ns) / (HURRY * self._per_ns))

    def _begin(self, now: int) -> None:
        """The bucket is full."""
        self._full_at = self._back_at = now
        self._spent, self._hurries_at, self._usual_links = 0, None, self._links

    def _hurry_from(self) -> int:
        assert self._full_at is not None
        latest = self._full_at + MAX_SETTLING_NS
        return latest if self._back_at is None else min(latest, self._back_at + SETTLING_NS)

    def _filled(self, now: int) -> float:
        """Tokens since the bucket was full."""
        assert self._full_at is not None
        slow_end = now if self._hurries_at is None else min(now, self._hurries_at)
        return self._per_ns * (slow_end - self._full_at + HURRY * (now - slow_end))
