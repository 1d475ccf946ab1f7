"""What a listener of a topic knows of it: who sends, what was lost on the way, and for how long nothing has come."""

from __future__ import annotations

from lsu_mesh.mesh.ros2.attachment import decode_attachment
from lsu_mesh.mesh.ros2.graph import Announced

SECOND = 1_000_000_000
LEAST_SILENCE_NS = 2 * SECOND
"""So long a topic may be silent, or five times as long as its last two messages lay apart."""
INTERVALS = 5


class Listening:
    """Counts of one topic since the process started."""

    def __init__(self) -> None:
        self.publishers: dict[str, Announced] = {}
        """By token."""
        self.received = self.lost = 0
        """Messages that came, and that are missing between the numbers of a publisher."""
        self.links: int | None = None
        """Connections to the network of ROS 2; None until somebody has looked."""
        self._last_of: dict[bytes, int] = {}
        self._last_ns: int | None = None
        self._began_ns: int | None = None
        self._interval_ns = 0

    def note(self, attachment: bytes, arrival_ns: int) -> None:
        """A message came; what is missing before it is counted."""
        self.received += 1
        if self._last_ns is not None:
            self._interval_ns = arrival_ns - self._last_ns
        self._last_ns = arrival_ns
        found = decode_attachment(attachment) if attachment else None
        if found is None:
            return
        last = self._last_of.get(found.gid)
        if last is not None and found.sequence > last + 1:
            self.lost += found.sequence - last - 1
        self._last_of[found.gid] = found.sequence

    def silence_ns(self, now: int) -> int | None:
        """For how long nothing has come, where that is longer than is usual; else None."""
        if self._began_ns is None:
            self._began_ns = now
        since = now - (self._began_ns if self._last_ns is None else self._last_ns)
        return since if since > max(LEAST_SILENCE_NS, INTERVALS * self._interval_ns) else None
