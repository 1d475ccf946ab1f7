"""Whether a peer runs twice, as each of its two processes finds out by listening to the health of its own name.

A session does not get what it publishes itself. So whatever comes under the own health key is of another process.
"""

from __future__ import annotations

from lsu_mesh.mesh.messages import Health
from lsu_mesh.mesh.processes import HEARD_NS, SECOND, Process, process_of

APART_NS = SECOND // 2
"""Two health messages that come so far apart are not what a process sent before it ended."""
DUPLICATE_PROCESS = "duplicate-process"
"""Of the event."""
WORDS = "another process of this name runs "
"""How its complaint begins."""


class DuplicateProcess:
    """What a process knows of another one of its own name.

    The last health of the process that it has replaced is no sign of another one. It was sent before the own start, so
    that a message counts which was sent later, or, where the clocks of two hosts differ, the second one in a row.

    Parameters
    ----------
    src, boot:
        The peer, as ``role/name``, and its own process.
    """

    def __init__(self, src: str, boot: str) -> None:
        self._src, self._boot = src, boot
        self._other: Process | None = None
        self._seq = -1
        self._first_at = self._at = 0
        self._is_proved = False
        self._is_told = False

    def record(self, message: Health, started_ns: int | None, now: int) -> None:
        """A health message of the own name has come; ``started_ns``: when this process began, by its own clock."""
        if message.src != self._src or message.boot == self._boot:
            return
        if self._other is None or self._other.boot != message.boot or now - self._at >= HEARD_NS:
            self._other, self._first_at, self._seq = process_of(message), now, -1
            self._is_proved = self._is_told = False
        if message.seq <= self._seq:
            return
        self._seq, self._at = message.seq, now
        is_later = started_ns is not None and message.sent_ns > started_ns
        self._is_proved = self._is_proved or is_later or now - self._first_at >= APART_NS

    def other(self, now: int) -> Process | None:
        """The other process, as long as it is heard."""
        return self._other if self._is_proved and now - self._at < HEARD_NS else None

    def complaint(self, now: int) -> str | None:
        """What is wrong and what to do; None where this process is the only one."""
        other = self.other(now)
        if other is None:
            return None
        return f"{WORDS}{other.words}; subscribers use the one that came first until it is gone: stop one of the two"

    def take_news(self, now: int) -> str | None:
        """The complaint once, when it begins."""
        text = None if self._is_told else self.complaint(now)
        self._is_told = self._is_told or text is not None
        return text
