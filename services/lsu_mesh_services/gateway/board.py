"""What is known of the mesh now: the newest estimate of each estimator, the last events, the health of each peer.

One thread records, others read. Whatever is recorded gets the next number, so that a reader asks for what is newer than
what it has. So many are kept and no more: of a slow reader newer estimates replace those that it has not taken, and
nothing grows with the number of readers.
"""

from __future__ import annotations

import functools
import itertools
import threading
from collections import Counter, deque
from collections.abc import Collection, Iterable, Iterator
from datetime import UTC, datetime
from typing import NamedTuple

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.json_form import Json, dumps, estimate, whole
from lsu_mesh.mesh.messages import Event, Health, Message, Posterior
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh.mesh.observer import HealthObserver, PeerHealth, worst
from lsu_mesh_services.gateway.server_sent import server_sent

KEPT_EVENTS = 256
KEPT_ESTIMATES = 512
"""Of each estimator."""


KEPT_PARCELS = 8


class Entry:
    """A message that came, with its number and its JSON, made once for all readers."""

    def __init__(self, number: int, message: Message, arrival_ns: int) -> None:
        self.number, self.message, self.arrival_ns = number, message, arrival_ns

    @property
    def identity(self) -> str:
        """The same after a restart of the gateway."""
        return ":".join(map(str, self.message.reference))

    @functools.cached_property
    def brief(self) -> bytes:
        """An estimate without the set and its provenance, as an event of a stream."""
        assert isinstance(self.message, Posterior)
        return server_sent("estimate", dumps(estimate(self.message, self.arrival_ns)))

    @functools.cached_property
    def whole(self) -> bytes:
        """An estimate with all fields, as an event of a stream."""
        return server_sent("estimate", dumps(whole(self.message, self.arrival_ns)))

    @functools.cached_property
    def event(self) -> bytes:
        """An event of the mesh, as an event of a stream."""
        return server_sent("event", dumps(whole(self.message, self.arrival_ns)), self.identity)


class Since(NamedTuple):
    """A level, and since when a peer has it."""

    level: str
    since_ns: int


class Connection(NamedTuple):
    """How the gateway itself is connected."""

    links: int = 0
    trying: tuple[str, ...] = ()
    refused: int = 0
    last_refusal: str = ""


class Board:
    """Recorded by one thread, read by others."""

    def __init__(self, configuration: Configuration, now: int) -> None:
        self._lock = threading.Lock()
        self._mesh = configuration.mesh.name
        self._observer = HealthObserver(configuration, now)
        self._estimates: dict[str, deque[Entry]] = {}
        self._newest: dict[str, Entry] = {}
        self._events: deque[Entry] = deque(maxlen=KEPT_EVENTS)
        self._since: dict[str, Since] = {}
        self._peers: list[PeerHealth] = []
        self._parcels: dict[tuple[int, tuple[str, ...] | None, bool, bool, int], tuple[int, bytes]] = {}
        self._number = 0
        self._checked_ns = now
        self.health_number = 0
        """Of the last :meth:`check`; raised when a level changes, and once a second."""
        self.connection = Connection()
        self.counts: Counter[str] = Counter()
        """Estimates that came, by estimator."""
        self.check(now)

    # -- recording

    def record(self, message: Message, arrival_ns: int) -> None:
        """A message of the mesh."""
        with self._lock:
            if isinstance(message, Posterior):
                self._record_estimate(message, arrival_ns)
            elif isinstance(message, Event):
                self._events.append(self._entry(message, arrival_ns))
            elif isinstance(message, Health):
                self._observer.record(message, arrival_ns)

    def _record_estimate(self, message: Posterior, arrival_ns: int) -> None:
        name, entry = message.name, self._entry(message, arrival_ns)
        self.counts[name] += 1
        self._estimates.setdefault(name, deque(maxlen=KEPT_ESTIMATES)).append(entry)
        if name not in self._newest or _is_newer(message, self._newest[name].message):
            self._newest[name] = entry

    def record_presence(self, name: str, is_there: bool) -> None:
        """A peer has come or gone."""
        with self._lock:
            self._observer.record_presence(name, is_there)

    def check(self, now: int, connection: Connection | None = None) -> None:
        """Judge all peers."""
        with self._lock:
            changed = connection is not None and connection.links != self.connection.links
            self.connection = connection or self.connection
            self._peers = self._observer.peers(now)
            for peer in self._peers:
                if peer.name not in self._since or self._since[peer.name].level != peer.level:
                    self._since[peer.name] = Since(peer.level, now)
                    changed = True
            if changed or now - self._checked_ns >= SECOND:
                self._checked_ns = now
                self._number += 1
                self.health_number = self._number

    def _entry(self, message: Message, arrival_ns: int) -> Entry:
        self._number += 1
        return Entry(self._number, message, arrival_ns)

    # -- reading

    def newest(self, after: int = 0, names: Collection[str] | None = None) -> list[Entry]:
        """The newest estimate of each of these estimators, or of all, where its number is above ``after``."""
        with self._lock:
            return _in_order([one for one in self._newest.values() if one.number > after], names)

    def estimates(self, after: int = 0, names: Collection[str] | None = None) -> list[Entry]:
        """All kept estimates with a number above ``after``, as they came; of these estimators, or of all."""
        with self._lock:
            found = [one for kept in self._estimates.values() for one in _newer(kept, after)]
        return _in_order(found, names)

    def parcel(
        self, after: int, names: tuple[str, ...] | None, *, only_newest: bool, is_whole: bool
    ) -> tuple[int, bytes]:
        """Estimates after a number as text, and the number that it reaches; made once for readers that ask alike."""
        asked = (after, names, only_newest, is_whole, self._number)
        parcel = self._parcels.get(asked)
        if parcel is None:
            entries = (self.newest if only_newest else self.estimates)(after, names)
            text = b"".join(entry.whole if is_whole else entry.brief for entry in entries)
            parcel = (entries[-1].number if entries else after, text)
            if len(self._parcels) >= KEPT_PARCELS:
                self._parcels.clear()
            self._parcels[asked] = parcel
        return parcel

    def events(self, after: int = 0) -> list[Entry]:
        """The last events with a number above ``after``."""
        with self._lock:
            return [entry for entry in self._events if entry.number > after]

    def number_of(self, identity: str) -> int:
        """The number of an event that a reader has seen; 0 where it is not known any more."""
        with self._lock:
            return next((entry.number for entry in self._events if entry.identity == identity), 0)

    @property
    def peers(self) -> list[PeerHealth]:
        """All peers as last judged."""
        return self._peers

    def health(self, now: int) -> Json:
        """The mesh and every peer, with reasons and since when."""
        with self._lock:
            peers, since, connection = list(self._peers), dict(self._since), self.connection
        return {
            "mesh": self._mesh,
            "level": worst([peer.level for peer in peers]),
            "time_ns": str(now),
            "links": connection.links,
            "trying": [] if connection.links else list(connection.trying),
            "refused": connection.refused,
            "last_refusal": connection.last_refusal or None,
            "peers": [_as_json(peer, since[peer.name].since_ns) for peer in peers],
        }


def _newer(kept: deque[Entry], after: int) -> Iterator[Entry]:
    """From the newest on, as far as numbers are above ``after``."""
    return itertools.takewhile(lambda entry: entry.number > after, reversed(kept))


def _in_order(entries: Iterable[Entry], names: Collection[str] | None) -> list[Entry]:
    wanted = [one for one in entries if names is None or one.message.name in names]
    return sorted(wanted, key=lambda entry: entry.number)


def _is_newer(message: Posterior, known: Message) -> bool:
    """Whether it is of a later step, or a later revision, or of a process that started later."""
    assert isinstance(known, Posterior)
    if message.boot != known.boot:
        return message.sent_ns > known.sent_ns
    return (message.step, message.revision) >= (known.step, known.revision)


def _as_json(peer: PeerHealth, since_ns: int) -> Json:
    return {
        "name": peer.name,
        "role": peer.role,
        "level": peer.level,
        "reasons": list(peer.reasons),
        "since": datetime.fromtimestamp(since_ns / 1e9, UTC).isoformat(timespec="milliseconds"),
        "since_ns": str(since_ns),
        "step": peer.step,
        "age_s": None if peer.age_ns is None else peer.age_ns / SECOND,
        "started_ns": None if peer.started_ns is None else str(peer.started_ns),
        "host": peer.host,
    }
