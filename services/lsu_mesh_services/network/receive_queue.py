"""Messages that have arrived and wait: bounded in number, in bytes and in age, and nothing is dropped without a word.

A queue that is full drops its oldest messages and notes which: they are asked for again when there is room. One whose
messages wait for longer than their publishers keep them is of a peer that gets too little processor. It skips ahead:
all that waits behind the present is given up at once, and until the queue was empty once no message waits for long.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import NamedTuple

from lsu_mesh.mesh.lost_messages import Loss
from lsu_mesh.mesh.sequences import Head
from lsu_mesh_services.network.received_numbers import Gap, Number, ReceivedNumbers, as_ranges
from lsu_mesh_services.network.standstill import SECOND_NS, Standstill

MAX_MESSAGES, MAX_BYTES = 65536, 2**26
"""Messages and bytes that may wait; the oldest beyond that are dropped and counted, and asked for again."""
MAX_LATE_NS = SECOND_NS
"""How long messages wait in the queue of a peer that is late, before it skips ahead again."""
PRESENT_NS = SECOND_NS // 4
"""What has come in so short a time is kept by a peer that skips ahead."""


class Arrival(NamedTuple):
    """Something that came: a ``sample``, or a peer that is ``alive`` or ``gone``; of another network, other words."""

    what: str
    key: str
    payload: bytes
    arrival_ns: int
    attachment: bytes = b""


class ReceiveQueue:
    """A queue that network threads put into and one thread takes from; putting never waits."""

    def __init__(self, most: int = MAX_MESSAGES, most_bytes: int = MAX_BYTES) -> None:
        self._waiting: deque[tuple[Arrival, Number | None]] = deque()
        self._most, self._most_bytes = most, most_bytes
        self._changed = threading.Condition()
        self._bytes = 0
        self._numbers = ReceivedNumbers()
        self._now: Callable[[], int] | None = None
        self._standstill = Standstill()
        self._max_age_ns = 0
        self._spares: Callable[[str], bool] = lambda _: False
        self._max_spared_ns: int | None = 0
        self._excused_until = self._next_skip = 0
        self._lost: list[Loss] = []
        self.is_late = False
        """Whether the peer skips ahead until its queue was empty once."""
        self.dropped = 0
        """Samples that a full queue had no room for. Who comes and goes is never dropped: there are few of them."""
        self.too_old = 0
        """Samples that were given up because they waited for too long."""
        self.taken = 0
        """Arrivals that were handed over."""

    def bound_age(
        self,
        max_age_ns: int,
        now: Callable[[], int],
        spares: Callable[[str], bool] = lambda _: False,
        *,
        max_spared_ns: int | None = None,
        standstill: Standstill | None = None,
    ) -> None:
        """Let no message wait for longer; those whose key is spared may for ``max_spared_ns`` (None: for ever).

        What waited while the taking thread stood still, as ``standstill`` sees it, waits from then on.
        """
        self._max_age_ns, self._now, self._spares, self._max_spared_ns = max_age_ns, now, spares, max_spared_ns
        self._standstill = standstill or Standstill()

    # -- from the network

    def put(self, arrival: Arrival, head: Head | None = None) -> None:
        """Queue what came; a copy is dropped, and a full queue drops its oldest. ``head``: its number is noted."""
        with self._changed:
            is_new, number = (True, None) if head is None else self._numbers.take(arrival.key, head, arrival.arrival_ns)
            if is_new:
                self._append(arrival, number)
                if arrival.payload:
                    self._make_room(arrival.arrival_ns)
                self._changed.notify()

    def put_answer(self, arrival: Arrival, head: Head | None = None) -> None:
        """Queue the answer of a cache; a full queue drops it, and nothing else for it."""
        with self._changed:
            if self._is_full(1, len(arrival.payload)) and (head is None or self._numbers.lacks(arrival.key, head)):
                self.dropped += 1  # and is as missing as before
                return
            is_new, number = (True, None) if head is None else self._numbers.take(arrival.key, head, arrival.arrival_ns)
            if is_new:
                self._append(arrival, number)
                self._changed.notify()

    def _append(self, arrival: Arrival, number: Number | None) -> None:
        self._bytes += len(arrival.payload)
        self._waiting.append((arrival, number))

    def _is_full(self, more: int = 0, more_bytes: int = 0) -> bool:
        return len(self._waiting) + more > self._most or self._bytes + more_bytes > self._most_bytes

    def _make_room(self, now: int) -> None:
        """Drop the oldest samples; who comes and goes has no payload and stays."""
        kept: list[tuple[Arrival, Number | None]] = []
        dropped: list[Number] = []
        while self._is_full(len(kept)) and self._waiting:
            arrival, number = self._waiting.popleft()
            if not arrival.payload:
                kept.append((arrival, number))
                continue
            self._bytes -= len(arrival.payload)
            self.dropped += 1
            dropped += [] if number is None else [number]
        self._waiting.extendleft(reversed(kept))
        if dropped:
            self._numbers.want(dropped, now)

    # -- to the peer

    def next(self, timeout: float) -> Arrival | None:
        """The oldest, or None after ``timeout`` seconds; 0 does not wait."""
        with self._changed:
            if not self._waiting:
                self.is_late = False
                if timeout > 0:
                    self._changed.wait_for(lambda: bool(self._waiting), timeout)
            if self._now is not None:
                now = self._now()
                if self._standstill.look(now):
                    self._excused_until = now
                    self._numbers.excuse(now)
                if self._waiting:
                    self._skip_ahead(now)
            if not self._waiting:
                return None
            arrival, _ = self._waiting.popleft()
            self._bytes -= len(arrival.payload)
            self.taken += 1
            return arrival

    def _age(self, arrival: Arrival, now: int) -> int:
        return now - max(arrival.arrival_ns, self._excused_until)

    def _skip_ahead(self, now: int) -> None:
        """Give up what waits behind the present, where the oldest has waited for too long."""
        limit = MAX_LATE_NS if self.is_late else self._max_age_ns
        if now < self._next_skip or self._age(self._waiting[0][0], now) <= limit:
            return
        self.is_late, self._next_skip = True, now + PRESENT_NS
        kept: deque[tuple[Arrival, Number | None]] = deque()
        lost: list[Number] = []
        for arrival, number in self._waiting:
            most = self._max_spared_ns if self._spares(arrival.key) else PRESENT_NS
            if not arrival.payload or most is None or self._age(arrival, now) <= most:
                kept.append((arrival, number))
                continue
            self._bytes -= len(arrival.payload)
            self.too_old += 1
            lost += [] if number is None else [number]
        self._waiting = kept
        self._lost += [Loss(*stream, first, last, is_too_old=True) for stream, first, last in as_ranges(lost)]

    def waits_long(self) -> bool:
        """Whether the peer is late: the oldest message has waited for longer than messages of a late peer may."""
        with self._changed:
            if self._now is None or not self._waiting:
                return False
            return self.is_late or self._age(self._waiting[0][0], self._now()) > MAX_LATE_NS

    def take_losses(self) -> list[Loss]:
        """What has been given up since the last call."""
        with self._changed:
            lost, self._lost = self._lost, []
            return lost

    # -- for those who ask again

    def gaps(self) -> list[tuple[Gap, list[tuple[int, int]]]]:
        """Gaps that are not closed, each with the ranges that are missing of it."""
        with self._changed:
            return self._numbers.gaps()

    def excuse_gaps(self, now: int) -> None:
        """Nobody could ask: what was missed before counts from now on."""
        with self._changed:
            self._numbers.excuse(now)

    def lose(self, losses: Iterable[Loss]) -> None:
        """What has been given up, for :meth:`take_losses`."""
        with self._changed:
            self._lost += losses

    def give_up(self, gaps: Iterable[Gap]) -> None:
        """Ask for these no more."""
        with self._changed:
            self._numbers.give_up(gaps)

    def want(self, key: str, boot: str, numbers: Iterable[int], now: int) -> None:
        """Messages that were taken and not used are missing again."""
        with self._changed:
            self._numbers.want([Number((key, boot), seq) for seq in numbers], now)

    def room(self) -> int:
        """How many messages may be asked for: what fills half of the queue."""
        return 0 if 2 * self._bytes > self._most_bytes else max(0, self._most // 2 - len(self._waiting))

    @property
    def copies(self) -> int:
        """Messages that had come before and were not queued."""
        return self._numbers.copies

    def __len__(self) -> int:
        return len(self._waiting)
