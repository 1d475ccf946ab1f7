"""How much processor a peer gets, and how much it would need: measured around its loop, once a second."""

from __future__ import annotations

from typing import NamedTuple

SECOND_NS = 1_000_000_000
LEAST_LOSS = 0.02
"""A peer that works off this share less than what comes needs more than it gets; less is chance."""
BUSY = 0.9
"""A loop that waits for less than the rest of its time has more to do than it can, if its messages wait."""


class Reading(NamedTuple):
    """Totals since the start of a process, at one time."""

    now: int
    waited_ns: int
    """How long the loop has waited for something to do."""
    processor_ns: int
    """What all threads of the process have computed."""
    taken: int
    """Messages that the loop has taken from its queue."""
    waiting: int
    """Messages that wait in the queue now."""
    too_old: int
    """Messages that were given up because they waited for too long."""


class ProcessorNeed:
    """``cores``: share of a processor that the process got in the last second. ``cores_needed``: what it would need.

    A loop that waits now and then gets what it needs. One that never waits, with a queue that grows or gives up
    messages, took only a part of what came: it needs ``cores · (taken + growth + given up) / taken``.
    """

    def __init__(self, first: Reading) -> None:
        self._last = first
        self.cores = self.cores_needed = 0.0

    def measure(self, reading: Reading) -> None:
        """To be called at each turn of the loop; it measures once a second."""
        last = self._last
        passed = reading.now - last.now
        if passed < SECOND_NS:
            return
        self._last = reading
        self.cores = self.cores_needed = (reading.processor_ns - last.processor_ns) / passed
        busy = 1.0 - (reading.waited_ns - last.waited_ns) / passed
        taken = max(1, reading.taken - last.taken)
        left = reading.waiting - last.waiting + reading.too_old - last.too_old
        if busy > BUSY and left > LEAST_LOSS * taken:
            self.cores_needed = self.cores * (taken + left) / taken

    @property
    def gauges(self) -> dict[str, float]:
        """For the health."""
        return {"cores": self.cores, "cores_needed": self.cores_needed}
