"""The bus of the simulation: caches, recovery, history for late joiners, and the faults of its links.

It is modelled on the real one (``services``' ``bus.py``): a publisher keeps its newest samples and tells every 100 ms
how far it is; a subscriber that misses some asks for them, and holds back what came after them meanwhile; whoever joins
gets what the caches hold. What a publisher that died had cached is gone. Times are nanoseconds of true time.
"""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from lsu_mesh.mesh.messages import VERSION, Refused, decode
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.simulator.faults import MESSAGE_FAULTS, FaultPlan, Outage

MILLISECOND = SECOND // 1000
HEARTBEAT_NS = 100 * MILLISECOND
LEASE_NS = 2 * SECOND
RECONNECT_NS = SECOND
MAX_DELAY_NS = 2 * SECOND
MAX_COPY_NS = 5 * SECOND
"""So much later a copy of an old message may come."""

Schedule = Callable[[int, Callable[[int], None]], None]
"""Ask for a call at a time."""


class Sample(NamedTuple):
    """One publication of a session, the ``number``-th on its key."""

    key: str
    boot: str
    number: int
    payload: bytes


@dataclass
class Stream:
    """What one subscriber has of one (key, boot)."""

    missing: set[int] = field(default_factory=set)
    """Numbers that were lost and are asked for."""
    held: dict[int, Sample] = field(default_factory=dict)
    """Samples that wait until the missing ones before them have come."""


class Port:
    """One session: what it has published, and what is under way to it."""

    def __init__(self, name: str, boot: str, cache: int, receive: Callable[[str, bytes, int], None]) -> None:
        self.name = name
        self.boot = boot
        self.is_open = True
        self.receive = receive
        self.caches: dict[str, deque[Sample]] = {}
        self.streams: dict[tuple[str, str], Stream] = {}
        self._cache = cache
        self._numbers: dict[str, int] = {}

    def sample(self, key: str, payload: bytes) -> Sample:
        """The next sample on a key, kept in the cache."""
        number = self._numbers.get(key, 0)
        self._numbers[key] = number + 1
        sample = Sample(key, self.boot, number, payload)
        self.caches.setdefault(key, deque(maxlen=self._cache)).append(sample)
        return sample

    def has(self, sample: Sample) -> bool:
        """Whether the cache still holds a sample."""
        cache = self.caches.get(sample.key)
        return self.is_open and cache is not None and bool(cache) and cache[0].number <= sample.number


class Links:
    """Who can reach whom, as partitions, freezes and leases allow."""

    def __init__(self, plan: FaultPlan, rng: random.Random) -> None:
        self._cuts = [(cut, self._reconnected(cut, rng)) for cut in plan.partitions]
        self.frozen = [(outage, self._reconnected(outage, rng)) for outage in plan.freezes]

    @staticmethod
    def _reconnected(outage: Outage, rng: random.Random) -> int:
        """When links that an outage broke are there again; one shorter than the lease breaks none."""
        was_broken = outage.end - outage.begin > LEASE_NS
        return outage.end + (rng.randint(0, RECONNECT_NS) if was_broken else 0)

    def are_joined(self, one: str, other: str, now: int) -> bool:
        """Whether messages pass between two peers now."""
        for cut, end in self._cuts:
            if cut.begin <= now < end and (one in cut.names) != (other in cut.names):
                return False
        for freeze, end in self.frozen:
            names = freeze.names
            if end > freeze.end and freeze.begin + LEASE_NS <= now < end and (one in names or other in names):
                return False
        return True

    def changes(self, one: str, other: str) -> list[tuple[int, bool]]:
        """When liveliness between two peers is lost (False) and found again (True)."""
        found = []
        for cut, end in self._cuts:
            if end > cut.end and (one in cut.names) != (other in cut.names):
                found += [(cut.begin + LEASE_NS, False), (end, True)]
        for freeze, end in self.frozen:
            if end > freeze.end and (one in freeze.names or other in freeze.names):
                found += [(freeze.begin + LEASE_NS, False), (end, True)]
        return found


class Transport:
    """Carries samples between ports, or does not; what ``is_live`` by its key is never taken from a cache."""

    def __init__(
        self,
        plan: FaultPlan,
        rng: random.Random,
        links: Links,
        schedule: Schedule,
        *,
        is_live: Callable[[str], bool] = lambda key: False,
    ) -> None:
        self._is_live = is_live
        self._plan = plan
        self._rng = rng
        self.links = links
        self._schedule = schedule
        self._in_order = rng.random() < 0.5
        """Whether subscribers hold back what came after a missing sample, as the real ones do."""
        self._total = plan.total_rate
        self.counts = dict.fromkeys((*MESSAGE_FAULTS, "recovered", "given up", "carried"), 0)

    def send(self, sample: Sample, sender: Port, receiver: Port, now: int) -> None:
        """A sample's first journey."""
        self.counts["carried"] += 1
        if not self.links.are_joined(sender.name, receiver.name, now):
            self._miss(sample, sender, receiver, now)
            return
        kind = self._fault(now)
        delay = MILLISECOND
        if kind is not None:
            self.counts[kind] += 1
            if kind == "drop":
                self._miss(sample, sender, receiver, now)
                return
            if kind == "corrupt":
                self._arrive_at(now + delay, sample.key, self._corrupted(sample), receiver)
                self._miss(sample, sender, receiver, now)
                return
            if kind == "duplicate":
                later = now + delay + self._log_uniform(MAX_COPY_NS)
                self._arrive_at(later, sample.key, sample.payload, receiver)
            elif kind == "delay":
                delay += self._log_uniform(MAX_DELAY_NS)
            else:  # reorder
                delay += self._rng.randint(1, 80) * MILLISECOND
        self._schedule(now + delay, lambda at: self._come(sample, receiver, at))

    def send_history(self, sender: Port, receiver: Port, key: str, now: int) -> None:
        """What a publisher's cache holds of a key, to one who has just joined."""
        if not (sender.is_open and receiver.is_open):
            return
        if not self.links.are_joined(sender.name, receiver.name, now):
            self._schedule(now + HEARTBEAT_NS, lambda at: self.send_history(sender, receiver, key, at))
            return
        for sample in sender.caches.get(key, ()):
            self._arrive_at(now, sample.key, sample.payload, receiver)

    def _fault(self, now: int) -> str | None:
        if now >= self._plan.end:
            return None
        draw = self._rng.random()
        if draw >= self._total:
            return None
        for kind, rate in self._plan.rates.items():
            draw -= rate
            if draw < 0:
                return kind
        return None

    def _log_uniform(self, longest: int) -> int:
        steps = math.exp(math.log(longest / MILLISECOND) * self._rng.random())
        return round(steps) * MILLISECOND

    def _arrive_at(self, at: int, key: str, payload: bytes, receiver: Port) -> None:
        self._schedule(at, lambda moment: receiver.receive(key, payload, moment))

    def _come(self, sample: Sample, receiver: Port, now: int) -> None:
        """A sample is there; it waits if earlier ones are missing and order is kept."""
        stream = receiver.streams.get((sample.key, sample.boot))
        if stream is None or not self._in_order or all(number > sample.number for number in stream.missing):
            receiver.receive(sample.key, sample.payload, now)
        else:
            stream.held[sample.number] = sample

    # -- recovery

    def _miss(self, sample: Sample, sender: Port, receiver: Port, now: int) -> None:
        """A sample was lost; the next heartbeat shows it, and the subscriber asks for it, but not for live data."""
        if self._is_live(sample.key):
            self.counts["given up"] += 1
            return
        stream = receiver.streams.setdefault((sample.key, sample.boot), Stream())
        stream.missing.add(sample.number)
        wait = self._rng.randint(2, HEARTBEAT_NS // MILLISECOND) * MILLISECOND
        self._schedule(now + wait, lambda at: self._recover(sample, sender, receiver, at))

    def _recover(self, sample: Sample, sender: Port, receiver: Port, now: int) -> None:
        if not receiver.is_open:
            return
        if not sender.has(sample):
            self.counts["given up"] += 1
            self._settle(sample, receiver, now)
        elif not self.links.are_joined(sender.name, receiver.name, now) or self._fault(now) == "drop":
            self._schedule(now + HEARTBEAT_NS, lambda at: self._recover(sample, sender, receiver, at))
        else:
            self.counts["recovered"] += 1
            receiver.receive(sample.key, sample.payload, now)
            self._settle(sample, receiver, now)

    def _settle(self, sample: Sample, receiver: Port, now: int) -> None:
        """A missing sample has come or never will; hand over what waited for it alone."""
        stream = receiver.streams[sample.key, sample.boot]
        stream.missing.discard(sample.number)
        first = min(stream.missing, default=None)
        for number in sorted(stream.held):
            if first is not None and number > first:
                return
            held = stream.held.pop(number)
            receiver.receive(held.key, held.payload, now)

    # -- corruption

    def _corrupted(self, sample: Sample) -> bytes:
        """A flipped bit, a cut, or another version; always a payload that is no message.

        A flipped bit that leaves a message of another content is the transport's to find (TCP's checksum, TLS): no
        receiver could tell it from a sensor's own number.
        """
        payload, way = bytearray(sample.payload), self._rng.random()
        if way < 0.6:
            payload[self._rng.randrange(len(payload))] ^= 1 << self._rng.randrange(8)
        elif way < 0.8:
            other = VERSION + self._rng.randint(1, 100)
            payload = bytearray(sample.payload.replace(b"\xa1v\x01", b"\xa1v" + bytes([other]), 1))
        if way >= 0.8 or _is_message(sample.key, bytes(payload)):
            payload = payload[: self._rng.randrange(len(payload))]
        return bytes(payload)


def _is_message(key: str, payload: bytes) -> bool:
    try:
        decode(key.split("/")[3], payload)
    except Refused:
        return False
    return True
