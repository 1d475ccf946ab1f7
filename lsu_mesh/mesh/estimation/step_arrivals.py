"""When the first message of each step came."""

from __future__ import annotations

from bisect import bisect_left

FURTHEST = 4096
"""So many steps, and four times those that the rate allows since the last message, a message may lie ahead."""
MAX_SIGNS = 65536


class StepArrivals:
    """The newest step, and for each step that was the newest, when its first message came.

    Parameters
    ----------
    rate:
        Steps in a nanosecond.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._known: list[tuple[int, int]] = []
        """Step and time; both rise."""
        self.newest = 0
        self.heard_at: int | None = None
        """When the last message came, of whatever step."""

    def is_from_the_future(self, k: int, now: int) -> bool:
        """Whether a step is too far ahead to be true; if it were believed, all other messages would be late."""
        passed = 0 if self.heard_at is None else max(0, now - self.heard_at)
        return k > self.newest + FURTHEST + int(4 * passed * self._rate)

    def record(self, k: int, now: int) -> None:
        """A message of step k has come."""
        self.heard_at = now
        if k > self.newest:
            self.newest = k
            self._known.append((k, now))
            if len(self._known) > MAX_SIGNS:
                del self._known[: MAX_SIGNS // 2]

    def of(self, k: int) -> int | None:
        """When the first message of step k, or of one after it, came."""
        i = bisect_left(self._known, (k,))
        return self._known[i][1] if i < len(self._known) else None

    def forget_before(self, k: int) -> None:
        """Steps before k are not asked for any more."""
        del self._known[: bisect_left(self._known, (k,))]
