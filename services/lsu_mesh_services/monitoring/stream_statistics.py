"""Rate, jitter and latency of a stream, over its last messages."""

from __future__ import annotations

import itertools
import statistics
from collections import deque

MAX_SAMPLES = 4096
NS_PER_S, NS_PER_MS = 1e9, 1e6


class StreamStatistics:
    """ReceiveQueue of one key.

    Latencies compare the clocks of two processes: across hosts they are as good as the hosts' clocks agree.
    """

    def __init__(self, most: int = MAX_SAMPLES) -> None:
        self._arrivals: deque[int] = deque(maxlen=most)
        self._latencies_ms: deque[float] = deque(maxlen=most)
        self.count = 0
        """Of all messages so far."""
        self.bytes = 0
        self.step = 0
        """The newest step."""

    def record(self, arrival_ns: int, sent_ns: int, size: int, step: int) -> None:
        """One message."""
        self._arrivals.append(arrival_ns)
        self._latencies_ms.append((arrival_ns - sent_ns) / NS_PER_MS)
        self.count += 1
        self.bytes += size
        self.step = max(self.step, step)

    @property
    def rate(self) -> float | None:
        """Messages per second between the first and the last one; None of fewer than two."""
        if len(self._arrivals) < 2 or self._arrivals[-1] <= self._arrivals[0]:
            return None
        return (len(self._arrivals) - 1) * NS_PER_S / (self._arrivals[-1] - self._arrivals[0])

    @property
    def periods_ms(self) -> list[float]:
        """Times between messages."""
        arrivals = list(self._arrivals)
        return [(later - earlier) / NS_PER_MS for earlier, later in itertools.pairwise(arrivals)]

    @property
    def jitter_ms(self) -> float | None:
        """Standard deviation of the times between messages; None of fewer than two."""
        periods = self.periods_ms
        return statistics.pstdev(periods) if periods else None

    def latency_ms(self, share: float) -> float | None:
        """Time from sending to arrival that a share of the messages did not exceed; None of none."""
        ordered = sorted(self._latencies_ms)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else None
