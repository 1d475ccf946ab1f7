"""The Zenoh session of a peer; the only file that imports zenoh.

Peers with gossip and without multicast; every peer listens somewhere, because peers do not relay for one another.
Advanced publishers keep a cache and a heartbeat, advanced subscribers recover what they missed; congestion drops (and
is recovered), it never blocks. Callbacks only stamp the arrival and put into a bounded queue.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

import zenoh
from zenoh import ext

from lsu_mesh.mesh.keys import parse
from lsu_mesh.mesh.sequences import Head, read_head
from lsu_mesh_services.network.gap_recovery import GapRecovery, RecoveryThread
from lsu_mesh_services.network.link_repair import LinkRepair
from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue
from lsu_mesh_services.network.session_settings import SessionSettings as SessionSettings
from lsu_mesh_services.network.session_settings import open_error, session_values

LEASE_MS = 2000
HEARTBEAT_S = 0.1
"""So often each publisher tells its newest number: who has missed the last messages of a stream learns of it."""
MAX_KEYS = 4096
"""Keys whose numbers are compared with those of Zenoh."""
SETTLED_S, MAX_INTRODUCTION_S = 0.5, 5.0
"""A second session leaves the mesh when its links have not changed for so long, and after so long in any case. One that
is closed while it opens links leaves them open, for as long as its process lives."""


class NoSession(Exception):
    """The session could not be opened; the message says what to do."""


class Clock:
    """Nanoseconds since 1970 that never go back: the wall clock at the start plus the monotonic clock since."""

    def __init__(self) -> None:
        self._offset = time.time_ns() - time.monotonic_ns()

    def now(self) -> int:
        """The time now."""
        return self._offset + time.monotonic_ns()


class Bus:
    """A session with queued arrivals. Use it as a context manager."""

    def __init__(self, settings: SessionSettings, clock: Clock, arrivals: ReceiveQueue | None = None) -> None:
        self._settings = settings
        self._clock = clock
        self._arrivals = ReceiveQueue() if arrivals is None else arrivals
        self._publishers: dict[str, Any] = {}
        self._declared: list[Any] = []
        self._own_tokens: set[str] = set()
        self._watches_numbers = False
        self._offsets: dict[str, int] = {}
        """By key: by how much Zenoh's number of a message is larger than its own."""
        self._recovery: RecoveryThread | None = None
        self._reunion: LinkRepair | None = None
        try:
            self._session = zenoh.open(_zenoh_configuration(settings))
        except zenoh.ZError as error:
            raise NoSession(open_error(settings, str(error))) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def publish(self, key: str, payload: bytes, encoding: str) -> None:
        """Send to everyone who subscribes, now or soon (the cache serves late joiners)."""
        self.announce(key)
        self._publishers[key].put(payload, encoding=encoding)

    def announce(self, key: str) -> None:
        """Declare the publisher of a key, so that subscribers know it before the first message."""
        if key not in self._publishers:
            self._publishers[key] = self._declare_publisher(key)

    def _declare_publisher(self, key: str) -> Any:
        return ext.declare_advanced_publisher(
            self._session,
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            allowed_destination=zenoh.Locality.REMOTE,
            cache=ext.CacheConfig(self._settings.cache),
            publisher_detection=True,
            sample_miss_detection=ext.MissDetectionConfig(heartbeat=HEARTBEAT_S, sporadic_heartbeat=None),
        )

    def subscribe(self, key: str) -> None:
        """Queue what is and was (as far as caches reach) published under a key expression."""
        self._declared.append(
            ext.declare_advanced_subscriber(
                self._session,
                key,
                self._enqueue_sample,
                history=ext.HistoryConfig(detect_late_publishers=True, max_samples=self._settings.cache),
                recovery=ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
            )
        )

    def subscribe_live(self, key: str) -> None:
        """Queue what is published from now on under a key expression; what is missed stays missing."""
        self._declared.append(self._session.declare_subscriber(key, self._enqueue_sample))

    def _enqueue_sample(self, sample: Any) -> None:
        arrival, head = self._received(sample)
        self._arrivals.put(arrival, head)

    def _received(self, sample: Any) -> tuple[Arrival, Head | None]:
        key, payload = str(sample.key_expr), sample.payload.to_bytes()
        arrival = Arrival("sample", key, payload, self._clock.now())
        if not self._watches_numbers or parse(key) is None or (head := read_head(payload)) is None:
            return arrival, None
        if sample.source_info is not None and (key in self._offsets or len(self._offsets) < MAX_KEYS):
            self._offsets[key] = int(sample.source_info.source_sn) - head.seq
        return arrival, head

    def watch_numbers(self) -> None:
        """Note from now on the numbers of messages when they come: copies are dropped, gaps and losses known."""
        self._watches_numbers = True

    def recover(self, is_cached: Callable[[str], bool], kept_ns: int | None) -> None:
        """Watch numbers, and ask the caches of publishers, which keep messages for so long, for what is missed."""
        self.watch_numbers()
        recovery = GapRecovery(self._arrivals, self.ask_cache, is_cached, kept_ns)
        self._recovery = RecoveryThread(recovery, self._arrivals, self._clock.now)

    def bound_age(self, max_age_ns: int, spares: Callable[[str], bool], max_spared_ns: int | None = None) -> None:
        """Let no message wait for longer; those whose key is spared may for ``max_spared_ns`` (None: for ever)."""
        self._arrivals.bound_age(max_age_ns, self._clock.now, spares, max_spared_ns=max_spared_ns)

    @property
    def arrivals(self) -> ReceiveQueue:
        """The queue, for a session with another network whose arrivals shall come in the same order."""
        return self._arrivals

    @property
    def zid(self) -> str:
        """The session's identifier in Zenoh."""
        return str(self._session.zid())

    def subscribe_plain(self, key: str, what: str) -> None:
        """Queue, with attachments, what is published from now on by programs that know nothing of the mesh."""

        def came(sample: Any) -> None:
            attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
            now, payload = self._clock.now(), sample.payload.to_bytes()
            self._arrivals.put(Arrival(what, str(sample.key_expr), payload, now, attachment=attachment))

        self._declared.append(self._session.declare_subscriber(key, came))

    def announce_plain(self, key: str) -> None:
        """Declare a publisher for programs that know nothing of the mesh."""
        drop = zenoh.CongestionControl.DROP
        self._publishers[key] = self._session.declare_publisher(key, congestion_control=drop)

    def put_plain(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        """Send to those who listen now, by a publisher of :meth:`announce_plain`."""
        self._publishers[key].put(payload, attachment=attachment)

    def watch_tokens(self, key: str, there: str, gone: str) -> None:
        """Queue whose tokens are there and which come and go."""

        def changed(sample: Any) -> None:
            what = there if sample.kind == zenoh.SampleKind.PUT else gone
            self._arrivals.put(Arrival(what, str(sample.key_expr), b"", self._clock.now()))

        self._declared.append(self._session.liveliness().declare_subscriber(key, changed, history=True))

    def watch_listeners(self, key: str) -> None:
        """Queue when the first listener of a key comes and when the last has left; no word: there is none.

        A plain publisher beside the advanced one, which cannot tell; asking it would cost as much as a message.
        """

        def changed(status: Any) -> None:
            self._arrivals.put(Arrival("listened" if status.matching else "unheard", key, b"", self._clock.now()))

        publisher = self._session.declare_publisher(key, allowed_destination=zenoh.Locality.REMOTE)
        self._declared += [publisher, publisher.declare_matching_listener(changed)]

    def keep(self, count: int) -> None:
        """How many messages publishers that are declared from now on keep for those who come late."""
        self._settings = replace(self._settings, cache=count)

    def declare_alive(self, key: str) -> None:
        """Show that this process is there, for as long as it is; once is enough."""
        if key in self._own_tokens:
            return
        self._own_tokens.add(key)
        self._declared.append(self._session.liveliness().declare_token(key))

    def watch_alive(self, key: str) -> None:
        """Queue who is there and who comes and goes, and look for those that only this session does not see."""
        if self._settings.mode == "peer" and self._settings.connect and self._reunion is None:
            self._reunion = LinkRepair(lambda: self._alive_elsewhere(key), self._introduce, self._arrivals.waits_long)

        def changed(sample: Any) -> None:
            is_there = sample.kind == zenoh.SampleKind.PUT
            self._arrivals.put(Arrival("alive" if is_there else "gone", str(sample.key_expr), b"", self._clock.now()))
            if self._reunion is not None:
                self._reunion.record(str(sample.key_expr), is_there)

        self._declared.append(self._session.liveliness().declare_subscriber(key, changed, history=True))

    def _alive_elsewhere(self, key: str) -> set[str] | None:
        """Tokens that an entry of the mesh knows, without the own ones; None where it may not tell of others'."""
        if self._settings.certificates is not None and self._settings.certificates.access_control is not None:
            return None
        configuration = _zenoh_configuration(replace(self._settings, mode="client", listen=()))
        configuration.insert_json5("connect/timeout_ms", "1000")
        configuration.insert_json5("connect/exit_on_failure", "true")
        try:
            with zenoh.open(configuration) as session:
                replies = session.liveliness().get(key, timeout=1.0)
                return {str(reply.ok.key_expr) for reply in replies if reply.ok is not None} - self._own_tokens
        except zenoh.ZError:
            return set()

    def _introduce(self, is_over: Callable[[], bool]) -> None:
        """Join the mesh once more, linked to everybody, for a moment."""
        configuration = _zenoh_configuration(replace(self._settings, listen=()))
        strategy = {"peer": {"to_router": "always", "to_peer": "always"}}
        configuration.insert_json5("scouting/gossip/autoconnect_strategy", json.dumps(strategy))
        configuration.insert_json5("connect/timeout_ms", "1000")
        try:
            with zenoh.open(configuration) as session:
                begin = changed = time.monotonic()
                links: set[str] = set()
                while (now := time.monotonic()) < begin + MAX_INTRODUCTION_S:
                    found = {str(peer) for peer in session.info.peers_zid()}
                    if found != links:
                        links, changed = found, now
                    if now > changed + SETTLED_S and is_over():
                        return
                    time.sleep(0.05)
        except zenoh.ZError:
            return

    def ask(self, key: str) -> None:
        """Query a key; the answers are queued as samples when they come."""

        def answered(reply: Any) -> None:
            if reply.ok is not None:
                self._enqueue_sample(reply.ok)

        self._session.get(key, answered, timeout=2.0)

    def ask_all(self, key: str) -> None:
        """Query a key of everybody who answers it; every answer is queued as a sample when it comes."""

        def answered(reply: Any) -> None:
            if reply.ok is not None:
                self._enqueue_sample(reply.ok)

        mode, target = zenoh.ConsolidationMode.NONE, zenoh.QueryTarget.ALL
        self._session.get(key, answered, target=target, consolidation=mode, timeout=2.0)

    def ask_cache(self, key: str, span: tuple[int, int] | None = None) -> None:
        """Ask the publisher of a key for the messages from a number to a number that its cache holds, or for all."""

        def answered(reply: Any) -> None:
            if reply.ok is not None:
                self._arrivals.put_answer(*self._received(reply.ok))

        offset = self._offsets.get(key)
        chosen = f"_max={self._settings.cache}"
        if span is not None and offset is not None:
            chosen = f"_sn={max(0, span[0] + offset)}..{max(0, span[1] + offset)}"
        selector = f"{key}/@adv/**?_anyke;{chosen}"
        self._session.get(selector, answered, consolidation=zenoh.ConsolidationMode.NONE, timeout=5.0)

    def answer(self, key: str, answers: Callable[[], tuple[str, bytes, str] | None]) -> None:
        """Answer queries on ``key`` with ``(key, payload, encoding)``."""

        def reply(query: Any) -> None:
            with query:
                found = answers()
                if found is not None:
                    query.reply(found[0], found[1], encoding=found[2])

        self._declared.append(self._session.declare_queryable(key, reply))

    def answer_each(self, keys: str, answers: Callable[[str], tuple[bytes, str] | str]) -> None:
        """Answer queries on single keys of the expression ``keys`` with ``(payload, encoding)``, or with an error."""

        def reply(query: Any) -> None:
            with query:
                asked = str(query.key_expr)
                found = answers(asked)
                if isinstance(found, str):
                    query.reply_err(found)
                else:
                    query.reply(asked, found[0], encoding=found[1])

        self._declared.append(self._session.declare_queryable(keys, reply))

    def links(self) -> int:
        """How many peers and routers this session is connected to."""
        info = self._session.info
        return len(info.peers_zid()) + len(info.routers_zid())

    def next(self, timeout: float) -> Arrival | None:
        """The next arrival, or None after ``timeout`` seconds; 0 does not wait."""
        return self._arrivals.next(timeout)

    def waiting(self) -> int:
        """Arrivals in the queue."""
        return len(self._arrivals)

    @property
    def dropped(self) -> int:
        """Samples that a full queue had no room for."""
        return self._arrivals.dropped

    @property
    def copies(self) -> int:
        """Messages that had come before and were not queued."""
        return self._arrivals.copies

    def close(self) -> None:
        """Undeclare everything and close; errors of a lost link do not matter any more."""
        if self._recovery is not None:
            self._recovery.close()
        if self._reunion is not None:
            self._reunion.close()
        for declared in [*reversed(self._declared), *self._publishers.values()]:
            try:
                declared.undeclare()
            except zenoh.ZError:
                continue
        self._declared.clear()
        self._publishers.clear()
        try:
            self._session.close()  # type: ignore[no-untyped-call]
        except zenoh.ZError:
            return


def _zenoh_configuration(settings: SessionSettings) -> Any:
    configuration = zenoh.Config()
    for path, text in session_values(settings, LEASE_MS):
        configuration.insert_json5(path, text)
    return configuration
