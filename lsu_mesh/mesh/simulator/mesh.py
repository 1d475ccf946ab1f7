"""The simulated mesh: processes with clocks and inboxes, a transport, a witness, and an agenda that a seed decides."""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable, Sequence
from typing import NamedTuple

from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.keys import key as key_of
from lsu_mesh.mesh.messages import Message, Reference, encode
from lsu_mesh.mesh.nodes.filter import FilterNode
from lsu_mesh.mesh.nodes.fusion import FusionNode
from lsu_mesh.mesh.nodes.node import SECOND, Node
from lsu_mesh.mesh.nodes.plant import PlantNode
from lsu_mesh.mesh.nodes.schedule import GridSchedule, Schedule
from lsu_mesh.mesh.nodes.sensor import SimulatedSensorNode
from lsu_mesh.mesh.simulator.decoding import Reader, SharedDecoder
from lsu_mesh.mesh.simulator.external_sensor import ExternalSensor
from lsu_mesh.mesh.simulator.faults import START_NS, FaultPlan, Skew
from lsu_mesh.mesh.simulator.invariants import Invariants
from lsu_mesh.mesh.simulator.recorder import RecorderSink
from lsu_mesh.mesh.simulator.transport import MILLISECOND, Links, Port, Transport

MAX_WAIT_NS = SECOND // 10
LAST_ANSWERED = 0.7
"""Chance that the question for the last own posterior, asked at the start of a process, finds somebody."""


class Arrival(NamedTuple):
    """A payload in an inbox, with the time of its arrival by the receiver's clock."""

    key: str
    payload: bytes
    at: int


class Agenda:
    """Calls in the order of their times; arrivals before runs, and otherwise as the seed wants it."""

    def __init__(self, rng: random.Random) -> None:
        self._random = rng.random
        self._calls: list[tuple[int, int, float, int, Callable[[int], None]]] = []
        self._count = 0

    def add(self, at: int, call: Callable[[int], None], phase: int = 0) -> None:
        """Call ``call(at)`` at a time."""
        self._count += 1
        heapq.heappush(self._calls, (at, phase, self._random(), self._count, call))

    def run(self, until: int) -> None:
        """Everything up to a time."""
        calls = self._calls
        while calls and calls[0][0] <= until:
            at, _, _, _, call = heapq.heappop(calls)
            call(at)


class Process:
    """One life of a peer: a node, its inbox, its session."""

    def __init__(self, mesh: SimulatedMesh, node: Node, skew: Skew, cache: int) -> None:
        self._mesh = mesh
        self.node = node
        self._skew = skew
        self.port = Port(node.name, node.boot, cache, self._arrive)
        self.next_run: int | None = None
        self._inbox: list[Arrival] = []
        self._presence: list[tuple[str, bool]] = []
        self._frozen = [outage for outage, _ in mesh.links.frozen if node.name in outage.names]

    def clock(self, at: int) -> int:
        """What the peer's clock says at a true time."""
        return at + self._skew.offset + int(self._skew.drift * (at - START_NS))

    def thawed(self, at: int) -> int:
        """The earliest time from ``at`` on at which the process runs."""
        for outage in self._frozen:
            if outage.begin <= at < outage.end:
                at = outage.end
        return at

    def wake(self, at: int) -> None:
        """Run at a time, or when the process thaws, or earlier."""
        at = self.thawed(at)
        if self.next_run is None or at < self.next_run:
            self.next_run = at
            self._mesh.agenda.add(at, self._run, phase=1)

    def record_presence(self, name: str, is_there: bool, at: int) -> None:
        """Liveliness of another peer."""
        if self.port.is_open:
            self._presence.append((name, is_there))
            self.wake(at)

    def _arrive(self, key: str, payload: bytes, at: int) -> None:
        if self.port.is_open:
            self._inbox.append(Arrival(key, payload, self.clock(self.thawed(at))))
            self.wake(at)

    def _run(self, at: int) -> None:
        """Drain the inbox, tick, publish."""
        if at != self.next_run or not self.port.is_open:
            return
        self.next_run = None
        for name, is_there in self._presence:
            self.node.record_alive(name, is_there, self.clock(at))
        self._presence.clear()
        inbox, self._inbox = self._inbox, []
        for arrival in inbox:
            self._publish(self._take(arrival), at)
        now = self.clock(at)
        self._publish(self.node.tick(now), at)
        self._mesh.witness.ran(self.node)
        wakeup = self.node.wakeup()
        wait = MAX_WAIT_NS if wakeup is None else min(MAX_WAIT_NS, max(MILLISECOND, wakeup - now))
        self.wake(at + wait)

    def _take(self, arrival: Arrival) -> list[Message]:
        """What ``Node.deliver`` does, with the witness between admission and node."""
        refused = self.node.admission.refused
        before = refused["future"] + refused["past"]
        message = self.node.admission.admit(arrival.key, arrival.payload, arrival.at)
        self._mesh.witness.untrue_times += refused["future"] + refused["past"] - before
        if message is None:
            return []
        self._mesh.witness.admitted(self.node, message)
        return self.node.receive(message, arrival.at)

    def _publish(self, messages: Sequence[Message], at: int) -> None:
        for message in messages:
            key, payload = self.node.key(message), encode(message)
            self._mesh.witness.published(self.node, self._mesh.reader.read(key, payload))
            self._mesh.spread(self, key, payload, at)


class SimulatedMesh:
    """All peers of a configuration under one plan of faults."""

    def __init__(self, configuration: Configuration, plan: FaultPlan, rng: random.Random, witness: Invariants) -> None:
        self.configuration = configuration
        self.witness = witness
        self.agenda = Agenda(rng)
        self.links = Links(plan, rng)
        self.transport = Transport(plan, rng, self.links, self.agenda.add, is_live=self._is_live)
        self.processes: dict[str, Process] = {}
        self.stored: list[Reference] = []
        """What the recorder has on its disk."""
        self._plan = plan
        self._rng = rng
        self._boots = 0
        self._decoder = SharedDecoder()
        self.reader = Reader(configuration, self._decoder)
        self._listeners: dict[str, list[str]] = {}
        for role, name in configuration.peers():
            self._begin(role, name)

    def run(self, steps: float) -> None:
        """Until a step is due, counted from step 1."""
        self.agenda.run(self.time_of(steps))

    def time_of(self, step: float) -> int:
        """True time at which a step is due."""
        return self.start_time(self.configuration, step)

    @staticmethod
    def start_time(configuration: Configuration, step: float) -> int:
        """True time at which a step of a configuration is due."""
        return START_NS + int((step - 1) / configuration.mesh.rate * SECOND)

    # -- lives of peers

    def _begin(self, role: str, name: str) -> None:
        """Start a peer within the first moments, and plan its deaths."""
        self.agenda.add(START_NS - self._rng.randint(0, 300) * MILLISECOND, lambda at: self._start(role, name, at))
        for outage in self._plan.kills:
            if name in outage.names:
                self.agenda.add(outage.begin, lambda at: self._kill(name, at))
                self.agenda.add(outage.end, lambda at: self._start(role, name, at))

    def _start(self, role: str, name: str, at: int) -> None:
        if name in self.processes:
            return
        self._boots += 1
        node = self._made(role, name, f"{self._boots:08x}{self._rng.getrandbits(32):08x}")
        node.admission.decoder = self._decoder.read
        process = Process(self, node, self._plan.skews.get(name, Skew()), self.configuration.cached)
        self.witness.began(node)
        self._greet(process, at)
        self.processes[name] = process
        self._listeners.clear()
        process.wake(at)

    def _made(self, role: str, name: str, boot: str) -> Node:
        if role == "plant":
            is_live, rate = self.configuration.mesh.is_live, self.configuration.mesh.rate
            schedule = GridSchedule(self.configuration.grid) if is_live else Schedule(START_NS, rate)
            return PlantNode(self.configuration, name, boot, schedule)
        if role == "sensor" and self.configuration.sensors[name].is_live:
            steps = self._plan.clock_steps.get(name, ())
            last = (self.configuration.mesh.steps or 0) + 1
            return ExternalSensor(self.configuration, name, boot, clock_steps=steps, steps=last)
        if role == "sensor":
            return SimulatedSensorNode(self.configuration, name, boot)
        if role == "filter":
            return FilterNode(self.configuration, name, boot)
        if role == "fusion":
            return FusionNode(self.configuration, name, boot)
        return RecorderSink(self.configuration, name, boot, self.stored)

    def _greet(self, process: Process, at: int) -> None:
        """Liveliness of the others, their caches, and the last own posterior."""
        node, delay = process.node, self._rng.randint(5, 200) * MILLISECOND
        for other in self.processes.values():
            self._announce(process, other, at)
            for key in other.port.caches:
                if self._listens(node, key) and not self._is_live(key):
                    self.agenda.add(at + delay, self._history_of(other, process, key))
            if isinstance(other.node, FusionNode) and node.name in other.node.sources and node.role == "filter":
                self.agenda.add(at + delay, self._last_of(other, process))

    def _history_of(self, sender: Process, receiver: Process, key: str) -> Callable[[int], None]:
        return lambda at: self.transport.send_history(sender.port, receiver.port, key, at)

    def _last_of(self, fusion: Process, asking: Process) -> Callable[[int], None]:
        def answer(at: int) -> None:
            assert isinstance(fusion.node, FusionNode)
            last = fusion.node.last.get(asking.node.name)
            is_heard = self._rng.random() < LAST_ANSWERED
            if last is not None and is_heard and self.links.are_joined(fusion.port.name, asking.port.name, at):
                address = key_of(self.configuration.mesh.name, "posterior", asking.node.name)
                asking.port.receive(address, encode(last), at)

        return answer

    def _announce(self, one: Process, other: Process, at: int) -> None:
        """Each learns of the other, and of changes of the link between them."""
        for here, there in ((one, other), (other, one)):
            changes = [(at + MILLISECOND, True), *self.links.changes(here.port.name, there.port.name)]
            for moment, is_there in changes:
                if moment >= at:
                    self.agenda.add(moment, self._presence_of(here, there, is_there))

    @staticmethod
    def _presence_of(here: Process, there: Process, is_there: bool) -> Callable[[int], None]:
        def tell(at: int) -> None:
            if there.port.is_open or not is_there:
                here.record_presence(there.port.name, is_there, at)

        return tell

    def _kill(self, name: str, at: int) -> None:
        process = self.processes.pop(name, None)
        if process is None:
            return
        process.port.is_open = False
        self._listeners.clear()
        for other in self.processes.values():
            self.agenda.add(at + self._rng.randint(1, 20) * MILLISECOND, self._loss_of(other, name))

    def _loss_of(self, here: Process, name: str) -> Callable[[int], None]:
        """A peer whose link is lost counts as gone, unless the link is open again."""

        def tell(at: int) -> None:
            if name not in self.processes:
                here.record_presence(name, False, at)

        return tell

    # -- messages

    def spread(self, sender: Process, key: str, payload: bytes, at: int) -> None:
        """A publication to everybody who listens."""
        sample = sender.port.sample(key, payload)
        listeners = self._listeners.get(key)
        if listeners is None:
            listeners = [name for name, process in self.processes.items() if self._listens(process.node, key)]
            self._listeners[key] = listeners
        for name in listeners:
            self.transport.send(sample, sender.port, self.processes[name].port, at)

    def _is_live(self, key: str) -> bool:
        _, _, _, topic, name = key.split("/")
        return self.configuration.is_live(topic, name)

    def _listens(self, node: Node, key: str) -> bool:
        _, _, mesh, topic, name = key.split("/")
        own = mesh == self.configuration.mesh.name
        return own and name != node.name and any(t == topic and n in (name, "*") for t, n in node.subscriptions())
