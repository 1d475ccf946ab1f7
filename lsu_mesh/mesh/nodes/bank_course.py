"""The course of steps of a node that combines batched messages: in order, once, with a deadline for what is missing."""

from __future__ import annotations

from abc import abstractmethod
from collections import defaultdict
from typing import Generic, TypeVar

from lsu_mesh.mesh.bank_messages import BankMessage
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Message
from lsu_mesh.mesh.nodes.node import SECOND, Complaint, Node
from lsu_mesh.mesh.nodes.source_timeout import SourceTimeouts

Kind = TypeVar("Kind", bound=BankMessage)
START_GRACE = SECOND // 2
"""How long a late joiner listens to the past before it chooses where to start."""
MAX_AT_ONCE = 8
"""Steps done in one tick, the next tick goes on."""
MAX_AHEAD = 4096
"""A message of a step that is farther ahead is not used."""
BEHIND = 3
"""A node that is more steps behind says so."""


class BankCourse(Node, Generic[Kind]):
    """A node that takes one message per source and step."""

    takes_at_once = 16
    """Few: they are large, and each may complete a step."""

    def __init__(self, configuration: Configuration, name: str, boot: str, sources: tuple[str, ...]) -> None:
        super().__init__(configuration, name, boot)
        self.sources = sources
        self.current: int | None = None
        """The step that is done next; None before the start."""
        self._waiting: defaultdict[int, dict[str, Kind]] = defaultdict(dict)
        self._signs: dict[int, int] = {}
        """When the first message of a step came."""
        self._newest = 0
        self._absent: set[str] = set()
        self._has_more = False
        self._timeouts = SourceTimeouts(configuration, self.subscriptions(), sources)
        self._counts: dict[str, float] = {"late": 0.0, "from the future": 0.0, "silent steps": 0.0}

    @property
    @abstractmethod
    def deadline(self) -> int:
        """How long to wait for a step's sources after its first sign, in nanoseconds."""

    @abstractmethod
    def first_step(self, oldest: int) -> int:
        """Where to begin, given the oldest step of which something has come; the set of that step is there then."""

    @abstractmethod
    def close(self, k: int, arrived: dict[str, Kind], now: int) -> list[Message]:
        """Do step k with what has come, which may be nothing."""

    def take(self, message: Kind, now: int) -> None:
        """Keep a source's message for its step; the first one of a step counts."""
        k, name = message.step, message.name
        self._timeouts.received(name, now)
        if k < 1 or (self.current is not None and k < self.current):
            self._counts["late"] += 1
        elif k > (self.current or self._newest or k) + MAX_AHEAD:
            self._counts["from the future"] += 1
        else:
            self._waiting[k].setdefault(name, message)
            self._signs.setdefault(k, now)
            self._newest = max(self._newest, k)

    def record_alive(self, name: str, is_there: bool, now: int) -> None:
        """Whoever has left is not waited for."""
        super().record_alive(name, is_there, now)
        if name in self.sources:
            (self._absent.discard if is_there else self._absent.add)(name)

    def advance(self, now: int) -> list[Message]:
        self._has_more = False
        if self.current is None and not self._starts(now):
            return []
        messages: list[Message] = []
        for _ in range(MAX_AT_ONCE):
            assert self.current is not None
            k = self.current
            if not self._is_ready(k, now):
                return messages
            arrived = self._waiting.pop(k, {})
            self._signs.pop(k, None)
            self._counts["silent steps"] += not arrived
            messages += self.close(k, arrived, now)
            self.current = k + 1
        self._has_more = True
        return messages

    def _starts(self, now: int) -> bool:
        if not self._waiting:
            return False
        oldest = min(self._waiting)
        if oldest > 1 and now < min(self._signs.values()) + START_GRACE:
            return False
        self.current = first = self.first_step(oldest)
        for k in [k for k in self._waiting if k < first]:
            self._counts["late"] += len(self._waiting.pop(k))
            del self._signs[k]
        return True

    def _is_ready(self, k: int, now: int) -> bool:
        """All sources that are there have sent, or the deadline since the first sign of the step is over."""
        if self._newest < k:
            return False
        arrived = self._waiting.get(k, {})
        if all(name in arrived or name in self._absent for name in self.sources):
            return bool(arrived) or self._newest > k
        return now >= self._due(k)

    def _due(self, k: int) -> int:
        return min(at for step, at in self._signs.items() if step >= k) + self.deadline

    def wakeup(self) -> int | None:
        if self._has_more:
            return 0
        if self.current is None:
            return min(self._signs.values()) + START_GRACE if self._signs else None
        return self._due(self.current) if self._newest >= self.current else None

    def step(self) -> int:
        return (self.current or 1) - 1

    def waiting_for(self) -> str:
        return ""

    def counters(self) -> dict[str, float]:
        return self._counts | {"newest": float(self._newest)}

    def complaints(self, now: int) -> list[Complaint]:
        """As of every node, how far it is behind, and which sources have fallen silent."""
        found = super().complaints(now)
        if self.current is not None and (late := self._newest - self.current) > BEHIND:
            found.append(Complaint("WARN", f"behind by {late} steps"))
        last = self.configuration.mesh.steps
        has_ended = last is not None and self._newest >= last
        return found + ([] if has_ended or not self._newest else self._timeouts.complaints(now))
