"""What all nodes are: pure state machines that get messages and the time, and return messages.

No clock, socket, thread or random source in here. ``now`` is nanoseconds of a clock that never goes back.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from lsu_mesh.mesh.admission import DUPLICATE_PUBLISHER, Admission
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.duplicate_process import DUPLICATE_PROCESS, DuplicateProcess
from lsu_mesh.mesh.duplicate_publishers import DuplicatePublisher, DuplicatePublishers
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.lost_messages import Loss, LostMessages
from lsu_mesh.mesh.messages import VERSION, Event, Health, Message

SECOND = 1_000_000_000
About = dict[str, str | int | float | None]
REMEMBERED_NS = 5 * SECOND
"""So long an event or a refusal colours the health."""
PATIENCE_NS, LONG_NS = SECOND // 2, 5 * SECOND
"""A wait that is longer is a warning, or an error."""


class Complaint(NamedTuple):
    """A reason why a node is not well, and how bad it is: WARN or ERROR."""

    level: str
    text: str


class Rise:
    """Whether a count has risen in the last seconds."""

    def __init__(self) -> None:
        self._before = 0.0
        self._at: int | None = None

    def is_recent(self, count: float, now: int) -> bool:
        """To be asked about once a second."""
        if count > self._before:
            self._before, self._at = count, now
        return self._at is not None and now - self._at < REMEMBERED_NS


def overload_words(gauges: Mapping[str, float]) -> str | None:
    """How much more processor a peer needs than it gets; None where it gets what it needs."""
    cores, needed = gauges.get("cores", 0.0), gauges.get("cores_needed", 0.0)
    return f"overloaded: needs {needed:.2f} cores of {cores:.2f} that it gets" if needed > cores else None


class Node(ABC):
    """A peer without its network.

    Parameters
    ----------
    configuration:
        The mesh that the node belongs to.
    name:
        The peer's name in the configuration.
    boot:
        16 hexadecimal characters, drawn anew at each process start.
    """

    role: ClassVar[str]
    publishes: tuple[str, ...] = ()
    """Topics that the node publishes, besides health and events."""
    takes_at_once: ClassVar[int] = 256
    """Messages that the service around the node hands over before the next tick, however many more are waiting: few,
    so that a backlog stays in the queue, which knows its age."""
    is_late: bool = False
    """Whether more than that waits; the service around the node tells."""
    messages_per_step: int = 1
    """Messages of a step under one key at most, as far as the node knows."""
    needs_all_inputs: bool = False
    """Whether it can never continue behind an input that it did not get."""
    answers: ClassVar[tuple[str, ...]] = ()
    """Topics that come as answers to the node's queries, besides its subscriptions."""

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        self.configuration = configuration
        self.name = name
        self.boot = boot
        self._digest = configuration.digest()
        self._sequences: dict[str, int] = {}
        self.started_ns: int | None = None
        self.host: str | None = None
        """When its process started, and on what machine, told in the health; the service around it knows."""
        self.next_health = 0
        """When the next health message is due."""
        self._warnings: dict[tuple[str, str], int] = {}
        """When an event of a level and code was last told."""
        self._refused, self._dropped = Rise(), Rise()
        self._waiting_since: int | None = None
        self.gauges: dict[str, float] = {"links": 0.0}
        """What the service around it measures, told with the counters: links, queue, queue_ms, dropped, too old,
        step_ms, cores, cores_needed."""
        topics = {*(topic for topic, _ in self.subscriptions()), *self.answers, "health"}
        self.admission = Admission(configuration, topics)
        self._publishers = self.admission.publishers = DuplicatePublishers(configuration.cached)
        self._other_process = DuplicateProcess(f"{self.role}/{name}", boot)
        self.lost = LostMessages()

    @abstractmethod
    def subscriptions(self) -> Sequence[tuple[str, str]]:
        """``(topic, name)`` of everything that the node listens to."""

    @abstractmethod
    def receive(self, message: Message, now: int) -> list[Message]:
        """Take a message that was admitted; return what to publish."""

    @abstractmethod
    def advance(self, now: int) -> Iterable[Message]:
        """Do what is due by ``now``, to the end of the iteration; what to publish, each as soon as it stands."""

    def deliver(self, address: str, payload: bytes, now: int) -> list[Message]:
        """Admission and :meth:`receive`."""
        message = self.admission.admit(address, payload, now)
        if isinstance(message, Health):  # of the own name: another process
            self._other_process.record(message, self.started_ns, now)
            return []
        return [] if message is None else self.receive(message, now)

    def record_alive(self, name: str, is_there: bool, now: int) -> None:
        """The liveliness token of another peer came or went."""
        self._publishers.record_alive(name, is_there, now)

    def record_lost(self, losses: Sequence[Loss], now: int) -> None:
        """Messages that were on their way to this node are given up; the next tick tells which."""
        for loss in losses:
            self.admission.expect(loss.key, loss.boot, loss.first, loss.last)
        self.lost.record(losses, now)

    def work(self, now: int) -> Iterator[Message]:
        """:meth:`advance`, and a health message once a second; each message before what comes after it is computed.

        Whoever publishes a message at once saves its readers the wait for the rest. The iteration has to be exhausted.
        """
        yield from self.advance(now)
        if warnings := self.warnings(now):
            yield from warnings
            self.next_health = now  # whoever reads the health is told at once
        self._waited(now)
        if now >= self.next_health:
            self.next_health = now + SECOND
            yield self.health(now)

    def tick(self, now: int) -> list[Message]:
        """All of :meth:`work`."""
        return list(self.work(now))

    def warnings(self, now: int) -> list[Message]:
        """Events about what has just been found wrong around the node, and stands in its health as long as it is so."""
        found = [self._duplicate_publisher(pair, now) for pair in self._publishers.take_news()]
        text, other = self._other_process.take_news(now), self._other_process.other(now)
        if text is not None and other is not None:
            about: About = {"peer": f"{self.role}/{self.name}", "host": other.host, "boot": other.boot}
            found.append(self.warning(DUPLICATE_PROCESS, text, now, about=about))
        lost = self.lost.take_news(now)
        if lost is not None:
            found.append(self.warning("messages-lost", lost[0], now, about=lost[1]))
        return found

    def warning(self, code: str, text: str, now: int, *, about: About) -> Event:
        """An event about what a complaint tells as long as it is so: the health needs no memory of it."""
        event = self.event("WARN", code, text, now=now, step=self.step(), about=about)
        del self._warnings["WARN", code]
        return event

    def _duplicate_publisher(self, pair: DuplicatePublisher, now: int) -> Message:
        about: About = {"peer": pair.src, "key": pair.key, "used": pair.used, "refused": pair.refused}
        return self.warning("duplicate-publisher", pair.words, now, about=about)

    def warm_up(self) -> None:
        """Do once, and forget, what a step does, so that the first real step finds all kernels loaded."""
        return

    def record_links(self, count: int, now: int) -> None:
        """How many peers and routers the process is connected to; the next tick tells."""
        self.gauges["links"] = float(count)
        self.next_health = 0

    def wakeup(self) -> int | None:
        """When :meth:`tick` has something to do next, apart from health; ``None``: only after a message."""
        return None

    @property
    def finished(self) -> bool:
        """Whether the node will never publish data again."""
        return False

    def step(self) -> int:
        """The step that the node is at."""
        return 0

    def waiting_for(self) -> str:
        """What the node waits for, by key; empty when it runs."""
        return ""

    def counters(self) -> dict[str, float]:
        """The node's own counts."""
        return {}

    def key(self, message: Message) -> str:
        """The key to publish a message of this node under."""
        return key(self.configuration.mesh.name, message.topic, self.name)

    def stamp(self, topic: str, step: int, now: int, origin: int | None = None) -> dict[str, Any]:
        """The common fields of a new message; draws the next sequence number of the topic."""
        sequence = self._sequences.get(topic, 0)
        self._sequences[topic] = sequence + 1
        return {
            "v": VERSION,
            "src": f"{self.role}/{self.name}",
            "boot": self.boot,
            "seq": sequence,
            "step": step,
            "sent_ns": now,
            "origin_ns": now if origin is None else origin,
            "model": self._digest,
        }

    def event(
        self,
        level: str,
        code: str,
        text: str,
        now: int,
        step: int,
        about: About,
    ) -> Event:
        """A message for people; WARN and ERROR also colour the health of the next seconds."""
        if level != "INFO":
            self._warnings[level, code] = now
        return Event(**self.stamp("event", step, now), level=level, code=code, text=text, about=about)  # type: ignore[arg-type]

    def health(self, now: int) -> Health:
        """How the node does now: the worst of its complaints is its level."""
        complaints = self.complaints(now)
        levels = {complaint.level for complaint in complaints}
        return Health(
            **self.stamp("health", self.step(), now),
            role=self.role,
            level="ERROR" if "ERROR" in levels else "WARN" if levels else "OK",
            reasons=[complaint.text for complaint in complaints],
            counters=self.admission.counters | self.counters() | self.gauges,
            started_ns=self.started_ns,
            host=self.host,
        )

    def complaints(self, now: int) -> list[Complaint]:
        """What is not as it should be: events and refusals of the last seconds, and what is waited for."""
        found = [
            Complaint(level, f"{code}: in the last 5 s")
            for (level, code), at in self._warnings.items()
            if now - at < REMEMBERED_NS
        ]
        waited = self._waited(now)
        if waited > PATIENCE_NS:
            level = "ERROR" if waited > LONG_NS else "WARN"
            found.append(Complaint(level, f"waiting for {self.waiting_for()} for {waited / SECOND:.1f} s"))
        refused, dropped = self.admission.refused.total(), self.gauges.get("dropped", 0.0)
        pairs = self._publishers.present(now)
        if self._refused.is_recent(refused, now):
            is_named = bool(pairs) and self.admission.last_reason == DUPLICATE_PUBLISHER  # in full, below
            last = self.admission.last_reason if is_named else self.admission.last_refusal
            found.append(Complaint("WARN", f"refused {refused} message(s) so far, last: {last}"))
        if (overload := overload_words(self.gauges)) is not None:
            found.append(Complaint("WARN", overload))
        if self._dropped.is_recent(dropped, now):
            text = f"{dropped:g} message(s) so far found no room in the queue and are asked for again"
            found.append(Complaint("WARN", text))
        if (lost := self.lost.complaint(now)) is not None:
            found.append(Complaint("WARN", lost))
        found += [Complaint("WARN", pair.words) for pair in pairs]
        if (twice := self._other_process.complaint(now)) is not None:
            found.append(Complaint("WARN", twice))
        queued_s = self.gauges.get("queue_ms", 0.0) * 1e-3
        if queued_s > PATIENCE_NS / SECOND:
            found.append(Complaint("WARN", f"messages wait {queued_s:.1f} s in its queue"))
        return found

    def _waited(self, now: int) -> int:
        """For how long the node has been waiting, in nanoseconds; it looks at each tick."""
        if not self.waiting_for():
            self._waiting_since = None
            return 0
        if self._waiting_since is None:
            self._waiting_since = now
        return now - self._waiting_since
