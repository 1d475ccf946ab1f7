"""Messages that have arrived and wait: bounded, so that a slow peer drops and counts them and does not grow."""

from __future__ import annotations

import queue
import threading
from typing import NamedTuple

MAX_MESSAGES, MAX_BYTES = 65536, 2**26
"""Messages and bytes that may wait; a message beyond that is dropped and counted, and may be requested again."""


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
        self._queue: queue.SimpleQueue[Arrival] = queue.SimpleQueue()
        self._most, self._most_bytes = most, most_bytes
        self._lock = threading.Lock()
        self._bytes = 0
        self.dropped = 0
        """Samples that found the queue full. Who comes and goes is never dropped: there are few of them."""

    def put(self, arrival: Arrival) -> None:
        """Queue what came, or drop it where the queue is full."""
        with self._lock:
            is_full = self._queue.qsize() >= self._most or self._bytes >= self._most_bytes
            if is_full and arrival.payload:  # who comes and goes has none
                self.dropped += 1
                return
            self._bytes += len(arrival.payload)
            self._queue.put(arrival)

    def next(self, timeout: float) -> Arrival | None:
        """The oldest, or None after ``timeout`` seconds; 0 does not wait."""
        try:
            arrival = self._queue.get(timeout=timeout) if timeout > 0 else self._queue.get_nowait()
        except queue.Empty:
            return None
        with self._lock:
            self._bytes -= len(arrival.payload)
        return arrival

    def __len__(self) -> int:
        return self._queue.qsize()
