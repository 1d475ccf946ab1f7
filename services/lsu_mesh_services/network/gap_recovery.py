"""Asks again for messages that a subscriber's own recovery has not brought, and gives up what is not to be had.

Advanced subscribers ask a publisher's cache once for what they missed. When that one question is lost, as it may be
while a link comes back, the gap would stay. The queue notes gaps as messages come, and what it had no room for; here
the missing numbers are asked for, as few ranges, until they have come or their publisher keeps them no more.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from itertools import pairwise

from lsu_mesh.mesh.lost_messages import Loss
from lsu_mesh_services.network.receive_queue import ReceiveQueue
from lsu_mesh_services.network.received_numbers import Gap, Stream
from lsu_mesh_services.network.standstill import SECOND_NS

LOOK_NS = SECOND_NS // 2
"""Between two looks. After an outage of four seconds publishers keep what was missed for two more."""
MAX_TRIES = 10
"""Then the messages have left the publisher's cache, or the publisher is gone."""
MAX_QUESTIONS = 8
"""For a stream at one look; ranges that lie close together are asked for as one."""
GRACE_NS = SECOND_NS
"""What is asked for when its publisher is about to forget it may still be on its way."""
PAUSE_S, STANDSTILL_NS = 0.1, SECOND_NS
"""Between two turns of the thread; one that had to wait for so long could not ask."""
WHOLE_CACHE = 4
"""At each so-many-th try the whole cache is asked for, in case its publisher counts otherwise."""
Span = tuple[int, int]
Ask = Callable[[str, Span | None], None]


class GapRecovery:
    """Asks, at each look, for what has been missing since the look before.

    Parameters
    ----------
    queue:
        What knows which numbers are missing.
    ask:
        Gets a key and the first and last number of a range, or None for all that the cache of its publisher holds.
    is_cached:
        Whether the publisher of a key keeps anything; a gap of another one is given up at once.
    kept_ns:
        For how long publishers keep what they sent, at least; None: as long as one asks.
    """

    def __init__(
        self, queue: ReceiveQueue, ask: Ask, is_cached: Callable[[str], bool], kept_ns: int | None = None
    ) -> None:
        self._queue, self._ask, self._is_cached, self._kept_ns = queue, ask, is_cached, kept_ns
        self._last: int | None = None
        self.asked = 0
        """Questions so far."""

    def check(self, now: int) -> list[Loss]:
        """Do what is due; returns what has been given up since the last call, by the queue too."""
        losses = self._queue.take_losses()
        if self._last is not None and now < self._last + LOOK_NS:
            return losses
        self._last = now
        found = [(gap, missing) for gap, missing in self._queue.gaps() if now >= gap.noticed_ns + LOOK_NS]
        given_up = [(gap, missing) for gap, missing in found if self._is_lost(gap, now)]
        self._queue.give_up(gap for gap, _ in given_up)
        for gap, missing in given_up:
            losses += [Loss(*gap.stream, first, last, is_too_old=False) for first, last in missing]
        open_gaps = [(gap, missing) for gap, missing in found if not self._is_lost(gap, now)]
        self._ask_for(open_gaps)
        return losses

    def _is_lost(self, gap: Gap, now: int) -> bool:
        is_forgotten = self._kept_ns is not None and now > gap.noticed_ns + self._kept_ns + GRACE_NS
        return is_forgotten or gap.tries > MAX_TRIES or not self._is_cached(gap.stream[0])

    def _ask_for(self, found: list[tuple[Gap, list[Span]]]) -> None:
        room = self._queue.room()
        due: dict[Stream, list[Span]] = {}
        tries: dict[Stream, int] = {}
        for gap, missing in found:
            left = sum(last - first + 1 for first, last in missing)
            comes, gap.left = left < gap.left, left
            if comes or room <= 0:  # wait for the rest, or until there is room
                continue
            room -= left
            gap.tries += 1
            due.setdefault(gap.stream, []).extend(missing)
            tries[gap.stream] = max(tries.get(gap.stream, 0), gap.tries)
        for stream, ranges in due.items():
            is_whole = tries[stream] % WHOLE_CACHE == 0
            for span in [None] if is_whole else joined(ranges, MAX_QUESTIONS):
                self.asked += 1
                self._ask(stream[0], span)


class RecoveryThread:
    """Looks for gaps in a thread of its own: a peer that takes long over its messages asks in time all the same."""

    def __init__(self, recovery: GapRecovery, queue: ReceiveQueue, clock: Callable[[], int]) -> None:
        self._recovery, self._queue, self._clock = recovery, queue, clock
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recovery", daemon=True)
        self._thread.start()

    def close(self, patience: float = 2.0) -> None:
        """End it before the session."""
        self._is_over.set()
        self._thread.join(patience)

    def _run(self) -> None:
        before = self._clock()
        while not self._is_over.wait(PAUSE_S):
            now = self._clock()
            if now - before > STANDSTILL_NS:
                self._queue.excuse_gaps(now)
            before = now
            self._queue.lose(self._recovery.check(now))


def joined(ranges: list[Span], most: int) -> list[Span]:
    """At most so many spans that hold all of the ranges: those that lie closest together become one."""
    ranges = sorted(ranges)
    apart = sorted(range(1, len(ranges)), key=lambda i: ranges[i][0] - ranges[i - 1][1], reverse=True)[: most - 1]
    cuts = [0, *sorted(apart), len(ranges)]
    return [(ranges[a][0], ranges[b - 1][1]) for a, b in pairwise(cuts)]
