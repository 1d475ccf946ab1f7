"""What all nodes are: pure state machines that get messages and the time, and return messages.

No clock, socket, thread or random source in here. ``now`` is nanoseconds of a clock that never goes back.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.gate import Gate
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.messages import VERSION, Event, Health, Message

SECOND = 1_000_000_000


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
    publishes: ClassVar[tuple[str, ...]] = ()
    """Topics that the node publishes, besides health and events."""
    answers: ClassVar[tuple[str, ...]] = ()
    """Topics that come as answers to the node's queries, besides its subscriptions."""

    def __init__(self, configuration: Configuration, name: str, boot: str) -> None:
        self.configuration = configuration
        self.name = name
        self.boot = boot
        self._digest = configuration.digest()
        self._sequences: dict[str, int] = {}
        self._next_health = 0
        self._warnings: dict[str, int] = {}
        self._links = 0
        self.gate = Gate(configuration, {*(topic for topic, _ in self.subscriptions()), *self.answers})

    @abstractmethod
    def subscriptions(self) -> Sequence[tuple[str, str]]:
        """``(topic, name)`` of everything that the node listens to."""

    @abstractmethod
    def receive(self, message: Message, now: int) -> list[Message]:
        """Take a message that passed the gate; return what to publish."""

    @abstractmethod
    def advance(self, now: int) -> list[Message]:
        """Do what is due by ``now``; return what to publish."""

    def deliver(self, address: str, payload: bytes, now: int) -> list[Message]:
        """Gate and :meth:`receive`."""
        message = self.gate.admit(address, payload)
        return [] if message is None else self.receive(message, now)

    def tick(self, now: int) -> list[Message]:
        """:meth:`advance`, and a health message once a second."""
        messages = self.advance(now)
        if now >= self._next_health:
            self._next_health = now + SECOND
            messages.append(self.health(now))
        return messages

    def rehearse(self) -> None:
        """Do once, and forget, what a step does, so that the first real step finds all kernels loaded."""
        return

    def note_links(self, count: int) -> None:
        """How many peers and routers the process is connected to; the next tick tells."""
        self._links = count
        self._next_health = 0

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
        about: dict[str, str | int | float | None],
    ) -> Event:
        """A message for people; WARN and ERROR also colour the health of the next seconds."""
        if level != "INFO":
            self._warnings[code] = now
        return Event(**self.stamp("event", step, now), level=level, code=code, text=text, about=about)  # type: ignore[arg-type]

    def health(self, now: int) -> Health:
        """How the node does now."""
        reasons = [f"{code}: in the last 5 s" for code, at in self._warnings.items() if now - at < 5 * SECOND]
        waiting = self.waiting_for()
        if waiting:
            reasons.append(f"waiting for {waiting}")
        if self.gate.refused:
            reasons.append(f"refused {self.gate.refused.total()} message(s), last: {self.gate.last_refusal}")
        counters = self.gate.counters | self.counters() | {"links": float(self._links)}
        return Health(
            **self.stamp("health", self.step(), now),
            role=self.role,
            level="WARN" if reasons else "OK",
            reasons=reasons,
            counters=counters,
        )
