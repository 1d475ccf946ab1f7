"""A peer with its own queue, admission and recovery, and publishers with caches, all in virtual time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from lsu_mesh_services.network.gap_recovery import GapRecovery
from lsu_mesh_services.network.receive_queue import Arrival, ReceiveQueue

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key
from lsu_mesh.mesh.lost_messages import Loss
from lsu_mesh.mesh.messages import VERSION, Measurement, encode
from lsu_mesh.mesh.sequences import read_head

SECOND = 1_000_000_000
BOOT = "0" * 16
ANSWER_NS = 2_000_000
"""Until the first answer of a cache comes."""


@dataclass
class Publisher:
    """Sends measurements of a sensor and keeps those of the last seconds."""

    configuration: Configuration
    name: str
    kept: int

    def __post_init__(self) -> None:
        self.key = key("demo", "measurement", self.name)
        self.sent: list[int] = []
        """When each number was sent."""
        self.cache: deque[tuple[int, bytes]] = deque(maxlen=self.kept)

    def send(self, now: int) -> bytes:
        """The next message."""
        seq = len(self.sent)
        message = Measurement(
            v=VERSION, src=f"sensor/{self.name}", boot=BOOT, seq=seq, step=seq + 1, sent_ns=now, origin_ns=now,
            model=self.configuration.digest(), y=[0.5], time_ns=0,
        )  # fmt: skip
        self.sent.append(now)
        self.cache.append((seq, encode(message)))
        return self.cache[-1][1]


class VirtualMesh:
    """The time is ``now``; a message costs the peer ``1 / capacity`` seconds."""

    def __init__(self, configuration: Configuration, rate: float, capacity: float, most: int = 65536) -> None:
        self.now = 1000 * SECOND
        self.rate, self.capacity = rate, capacity
        self.admission = Admission(configuration, ["measurement"])
        self.kept_ns = 6 * SECOND
        self.publishers = [Publisher(configuration, name, int(6 * rate)) for name in ("s1", "s2", "s3")]
        self.queue = ReceiveQueue(most)
        self.queue.bound_age(self.kept_ns, lambda: self.now)
        self.recovery = GapRecovery(self.queue, self.ask, self.admission.is_cached, self.kept_ns)
        self.answers: deque[tuple[int, str, bytes]] = deque()
        self.losses: list[Loss] = []
        self.loses: Callable[[str, int], bool] = lambda name, seq: False
        """Which messages the network loses on their way."""
        self.answered = self.questions = 0
        self.longest_wait = 0
        self.taken: set[tuple[str, int]] = set()
        self._next_step = self.now

    def ask(self, address: str, span: tuple[int, int] | None) -> None:
        """A question to a cache; it is answered a little later."""
        self.questions += 1
        publisher = next(one for one in self.publishers if one.key == address)
        for seq, payload in publisher.cache:
            if span is None or span[0] <= seq <= span[1]:
                self.answered += 1
                self.answers.append((self.now + ANSWER_NS, address, payload))

    def run(self, seconds: float, *, sends: bool = True) -> None:
        """So much time passes."""
        end = self.now + int(seconds * SECOND)
        while self.now < end:
            self._deliver(sends=sends)
            self._record(self.recovery.check(self.now))
            arrival = self.queue.next(0)
            if arrival is None:
                self.now += 1_000_000
                continue
            self.longest_wait = max(self.longest_wait, self.now - arrival.arrival_ns)
            message = self.admission.admit(arrival.key, arrival.payload)
            if message is not None:
                self.taken.add((message.name, message.seq))
            self.now += int(SECOND / self.capacity)

    def _deliver(self, *, sends: bool) -> None:
        while self.answers and self.answers[0][0] <= self.now:
            at, address, payload = self.answers.popleft()
            self.queue.put_answer(Arrival("sample", address, payload, at), read_head(payload))
        while self._next_step <= self.now:
            for publisher in self.publishers if sends else ():
                payload = publisher.send(self._next_step)
                if not self.loses(publisher.name, len(publisher.sent) - 1):
                    arrival = Arrival("sample", publisher.key, payload, self._next_step)
                    self.queue.put(arrival, read_head(payload))
            self._next_step += int(SECOND / self.rate)

    def _record(self, losses: list[Loss]) -> None:
        self.losses += losses
        for loss in losses:
            self.admission.expect(loss.key, loss.boot, loss.first, loss.last)

    def missing(self) -> set[tuple[str, int]]:
        """The truth: what was sent and not taken."""
        return {(one.name, seq) for one in self.publishers for seq in range(len(one.sent))} - self.taken

    def named(self) -> list[tuple[str, int]]:
        """All that was given up, by name and number."""
        return [(loss.key.rpartition("/")[2], seq) for loss in self.losses for seq in range(loss.first, loss.last + 1)]
