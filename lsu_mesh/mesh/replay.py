"""Running the filters and fusions of a mesh again on recorded measurements and inputs, as fast as it goes.

The nodes are those of the live mesh. Their clock is that of the recording: a message comes at the time at which the
recorder got it, and what waits for a deadline waits as long as it did.
"""

from __future__ import annotations

import hashlib
import heapq
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.messages import Fused, Input, Measurement, Message, Posterior, Suggestion, Truth
from lsu_mesh.mesh.nodes.estimator import START_GRACE, Estimator
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode
from lsu_mesh.mesh.nodes.node import SECOND

DRAINED_NS = 2_000_000
"""Messages that came within so short a time, or within half a step, are taken together, as a peer drains its queue."""
SOURCES = (Truth, Input, Measurement, Suggestion)


class Timed(NamedTuple):
    """A message and when it came, in nanoseconds since 1970."""

    now: int
    message: Message


class Replay:
    """Filters and fusions of ``configuration``, driven by recorded messages.

    Parameters
    ----------
    configuration:
        Whose filters and fusions run; need not be the one that was recorded, as long as it has the sensors and the
        plant that its filters listen to under the recorded names.
    recorded:
        Messages in the order of arrival. Measurements and inputs are given to the nodes. Of the recorded sets only
        the first of an estimator is used, and only where the recording begins after step 1: to start from.
    """

    def __init__(self, configuration: Configuration, recorded: Iterable[Timed]) -> None:
        self._recorded = list(recorded)
        self.nodes: dict[str, Estimator] = {}
        for name in configuration.filters:
            self.nodes[name] = FilterNode(configuration, name, _boot("filter", name))
        for name in configuration.fusion:
            self.nodes[name] = FusionNode(configuration, name, _boot("fusion", name))
        self._listeners: dict[tuple[str, str], list[Estimator]] = {}
        for node in self.nodes.values():
            for address in node.subscriptions():
                self._listeners.setdefault(address, []).append(node)
        self._together = min(DRAINED_NS, int(0.5 * SECOND / configuration.mesh.rate))
        self._pending: set[str] = set()
        self._order = {name: i for i, name in enumerate(self.nodes)}

    def run(self) -> Iterator[Timed]:
        """Everything that the nodes publish, but for health, in order."""
        self._offer_starts()
        now = 0
        for batch in self._batches():
            yield from self._until(batch[0].now)
            now = batch[-1].now
            for _, message in batch:
                yield from self._hand_over(message, now)
            yield from self._settle(now)
        yield from self._until(now + self._longest_wait())

    def _batches(self) -> Iterator[list[Timed]]:
        """Sources' messages that came together."""
        batch: list[Timed] = []
        for timed in self._recorded:
            if not isinstance(timed.message, SOURCES):
                continue
            if batch and timed.now - batch[0].now > self._together:
                yield batch
                batch = []
            batch.append(timed)
        if batch:
            yield batch

    def _offer_starts(self) -> None:
        """Where the recording begins in the middle of a run: a recorded set of each estimator to start from."""
        steps = [message.step for _, message in self._recorded if isinstance(message, Measurement | Input)]
        if not steps or min(steps) <= 1:
            return
        sound = [m for _, m in self._recorded if isinstance(m, Posterior) and m.status in ("ok", "predicted")]
        for name, node in self.nodes.items():
            own = [message for message in sound if message.name == name]
            fused = [message for message in sound if isinstance(message, Fused) and message.guarantee == "declared"]
            for start in (own or fused)[:1]:
                node.take_candidate(start)

    def _until(self, end: int) -> Iterator[Timed]:
        """Let the clock run to ``end``; nodes that are due before act at their time."""
        while True:
            waking = [(at, i, name) for name, i in self._order.items() if (at := self.nodes[name].wakeup()) is not None]
            due = [entry for entry in waking if entry[0] < end]
            if not due:
                return
            heapq.heapify(due)
            at, _, name = due[0]
            self._pending.add(name)
            before = self.nodes[name].wakeup()
            yield from self._settle(at)
            if self.nodes[name].wakeup() == before:
                return  # it waits for a message, whatever the clock says

    def _settle(self, now: int) -> Iterator[Timed]:
        """Let all nodes act that got something, filters first, until nothing moves."""
        while self._pending:
            name = min(self._pending, key=self._order.__getitem__)
            self._pending.remove(name)
            for message in list(self.nodes[name].advance(now)):
                yield Timed(now, message)
                yield from self._hand_over(message, now)

    def _hand_over(self, message: Message, now: int) -> Iterator[Timed]:
        for node in self._listeners.get((message.topic, message.name), ()):
            self._pending.add(node.name)
            for said in node.receive(message, now):
                yield Timed(now, said)

    def _longest_wait(self) -> int:
        """After the last message: until every deadline has passed."""
        return START_GRACE + sum(node.deadline for node in self.nodes.values()) + 1


def _boot(role: str, name: str) -> str:
    """A replay's boot identifiers are always the same, so that its messages are."""
    return hashlib.blake2b(f"replay {role} {name}".encode(), digest_size=8).hexdigest()
