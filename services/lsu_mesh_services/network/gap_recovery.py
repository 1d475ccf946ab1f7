"""Asks again for messages that a subscriber's own recovery has not brought.

Advanced subscribers ask a publisher's cache once for what they missed. When that one question is lost, as it may be
while a link comes back, the gap would stay. Admission counts gaps, and here they are asked for until they close.
"""

from __future__ import annotations

from collections.abc import Callable

from lsu_mesh.mesh.admission import Admission

SECOND_NS = 1_000_000_000
LOOK_NS = SECOND_NS // 2
"""Between two checks. After an outage of four seconds publishers keep what was missed for two more."""
MAX_TRIES = 10
"""Then the messages have left the publisher's cache, or the publisher is gone."""
LONG_QUEUE = 1024
"""So much waits to be taken, and what is missing may be in there; questions add to it, so that fewer are asked."""
PATIENCE_NS = 2 * SECOND_NS
"""Between two checks then: after two of them publishers still have what is missing (``CACHED_SECONDS``)."""


class GapRecovery:
    """Asks, at each look, for the keys whose gaps have not changed since the look before.

    ``ask`` gets a key and brings what its publisher's cache holds; copies are dropped by admission.
    """

    def __init__(self, admission: Admission, ask: Callable[[str], None]) -> None:
        self._admission = admission
        self._ask = ask
        self._last = -PATIENCE_NS
        self._seen: dict[str, int] = {}
        self._tries: dict[str, int] = {}
        self.asked = 0
        """Questions so far."""

    def check(self, now: int, waiting: int = 0) -> None:
        """Do what is due, less often where so many messages wait to be taken that the peer has enough to do."""
        pause = PATIENCE_NS if waiting > LONG_QUEUE else LOOK_NS
        if now < self._last + pause:
            return
        self._last = now
        gaps = self._admission.gaps_by_key()
        for key, count in gaps.items():
            if self._seen.get(key) != count:
                self._tries.pop(key, None)  # something comes: wait for the rest
            elif self._tries.get(key, 0) < MAX_TRIES:
                self._tries[key] = self._tries.get(key, 0) + 1
                self.asked += 1
                self._ask(key)
        self._seen = gaps
