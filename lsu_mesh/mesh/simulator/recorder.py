"""The recorder without its file: what it has received, what it has flushed, and its health."""

from __future__ import annotations

from collections.abc import Sequence

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.ledger import Ledger
from lsu_mesh.mesh.messages import TYPES, Message, Reference
from lsu_mesh.mesh.nodes.node import SECOND, Node

NAME = "recorder"


class RecorderSink(Node):
    """Takes every message; ``stored`` is the disk, which outlives the process."""

    role = "recorder"

    def __init__(self, configuration: Configuration, name: str, boot: str, stored: list[Reference]) -> None:
        super().__init__(configuration, name, boot)
        self.admission = Admission(configuration, TYPES)
        self.ledger = Ledger()
        self.stored = stored
        self._waiting: list[Reference] = []
        self._flush_ns = int(configuration.recorder.flush * SECOND)
        self._next_flush = 0

    def subscriptions(self) -> Sequence[tuple[str, str]]:
        return [(topic, "*") for topic in TYPES]

    def receive(self, message: Message, now: int) -> list[Message]:
        self._waiting.append(message.reference)
        self.ledger.record(self.key_of(message), message.boot, message.seq)
        return []

    def key_of(self, message: Message) -> str:
        """The key that a message came under."""
        return f"{message.topic}/{message.name}"

    def advance(self, now: int) -> list[Message]:
        if now >= self._next_flush:
            self._next_flush = now + self._flush_ns
            self.stored += self._waiting
            self._waiting = []
            self.ledger.flush()
        return []

    def wakeup(self) -> int | None:
        return self._next_flush

    def counters(self) -> dict[str, float]:
        return {f"flushed {key}": float(seq) for key, seq in self.ledger.flushed.items()}
