"""One peer: a node of the mesh with its session, its queue and its clock."""

from __future__ import annotations

import gc
import socket
import sys
import time
from collections.abc import Callable, Collection, Iterable
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Protocol

from lsu_mesh.mesh.access import taken_predictions
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.duplicate_process import DUPLICATE_PROCESS
from lsu_mesh.mesh.keys import key, last_key, model_key, parse
from lsu_mesh.mesh.messages import Event, Message, encode, encoding
from lsu_mesh.mesh.model_answer import encode_model, model_answer
from lsu_mesh.mesh.nodes.node import Node
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.exit_codes import OK, USAGE
from lsu_mesh_services.mesh_start import MeshStart, moment_text
from lsu_mesh_services.network.processor_need import ProcessorNeed, Reading
from lsu_mesh_services.network.receive_queue import Arrival
from lsu_mesh_services.session import connection_report
from lsu_mesh_services.stop import Stop

if TYPE_CHECKING:
    from lsu_mesh.mesh.nodes.estimator import Estimator
    from lsu_mesh.mesh.nodes.fusion import FusionNode

LOOK_AT_LINKS_NS = 100_000_000
STANDSTILL_NS = 1_000_000_000
"""So long between two turns of the loop, and the process stood still; so long after it, live data are not believed."""
SPARED = "input"
"""The topic that a late peer keeps for as long as it can: without inputs a set cannot be carried on."""
MAX_WAIT = 0.1
"""Seconds between looks at the stop flag and the parent."""


class Beside(Protocol):
    """A part in another network, whose arrivals come through the queue of the peer."""

    def look(self) -> None:
        """Note how it is connected; called ten times a second."""

    def take(self, arrival: Arrival) -> list[Message] | None:
        """What to publish after an arrival; None where it is not of that network."""


OpenBeside = Callable[[Node, Bus, Clock], AbstractContextManager[Beside]]


def run_peer(
    configuration: Configuration,
    who: tuple[str, str],
    make: Callable[[Configuration], Node | None],
    *,
    settings: SessionSettings,
    stop: Stop,
    beside: OpenBeside | None = None,
) -> int:
    """Run the node of ``(role, name)`` until it is told to stop; returns the exit code.

    ``make`` makes the node of a mesh whose start is known, or says why it cannot and returns None. Where the mesh turns
    out to have started earlier than this peer knew, the node begins again.
    """
    clock, known_ns = Clock(), None
    node = None if configuration.awaits_start else make(configuration)
    if node is None and not configuration.awaits_start:
        return USAGE
    while True:
        start = MeshStart(configuration, *who, known_ns=known_ns)
        with Bus(settings, clock) as bus, connection_report(" ".join(who), bus, settings):
            if node is None:
                started = start.configuration(bus, clock, lambda: bool(stop))
                if started is None:
                    return OK
                node = make(started)
                if node is None:
                    return USAGE
            with nullcontext() if beside is None else beside(node, bus, clock) as other:
                _run(node, bus, clock, stop=stop, start=start, is_moved=known_ns is not None, beside=other)
        if start.other_ns is None:
            return OK
        known_ns, node = start.other_ns, None


def _run(
    node: Node, bus: Bus, clock: Clock, *, stop: Stop, start: MeshStart, is_moved: bool, beside: Beside | None
) -> None:
    """Until the process is told to stop, or the mesh turns out to have another start."""
    node.started_ns, node.host = clock.now(), socket.gethostname()
    node.warm_up()
    gc.collect()
    gc.freeze()  # what is loaded stays: no later collection looks through all of it in the middle of a step
    bus.keep(node.configuration.cached * node.messages_per_step)
    peer = Peer(node, bus, clock, start, beside=beside)
    peer.declare()
    if is_moved:
        peer.tell_moved()
    said_finished = False
    while not stop and start.other_ns is None:
        peer.turn()
        if node.finished and not said_finished:
            said_finished = True
            print(
                f"{node.role} {node.name}: all steps are published; serving late joiners until stopped",
                file=sys.stderr,
            )
    peer.farewell()


class Peer:
    """The loop around a node: drain the queue, tick, publish."""

    def __init__(self, node: Node, bus: Bus, clock: Clock, start: MeshStart, *, beside: Beside | None = None) -> None:
        self._node = node
        self._beside = beside
        self._start = start
        self._bus = bus
        self._clock = clock
        self._mesh = node.configuration.mesh.name
        self._links = -1
        self._next_look = 0
        self._turned_at, self._settled_at = clock.now(), 0
        self._measured_until = self._worst_queue = self._worst_ns = self._worst_age_ns = 0
        kept_ns = node.admission.kept_ns
        bus.recover(node.admission.is_cached, kept_ns)
        if kept_ns is not None:
            max_spared_ns = None if node.needs_all_inputs else kept_ns
            bus.bound_age(kept_ns, lambda address: f"/{SPARED}/" in address, max_spared_ns)
        node.admission.wanted_again = self._want_again
        self._waited_ns = 0
        self._need = ProcessorNeed(self._reading())
        self._copies = 0

    def declare(self) -> None:
        """Publishers, subscriptions, the liveliness token, queries and answers."""
        for topic in (*self._node.publishes, "health", "event"):
            self._bus.announce(key(self._mesh, topic, self._node.name))
        for topic, name in self._node.subscriptions():
            is_live = self._node.configuration.is_live(topic, name)
            (self._bus.subscribe_live if is_live else self._bus.subscribe)(key(self._mesh, topic, name))
        self._bus.subscribe_live(key(self._mesh, "health", self._node.name))  # another process of the own name
        self._bus.watch_alive(key(self._mesh, "live", "*"))
        self._bus.declare_alive(key(self._mesh, "live", self._node.name))
        if self._node.role in ("filter", "fusion"):
            self._declare_estimator()

    def _declare_estimator(self) -> None:
        """Questions and answers of filters and fusions, whose modules the other peers do not load."""
        from lsu_mesh.mesh.nodes.bank_filter import BankFilterNode
        from lsu_mesh.mesh.nodes.bank_fusion import BankFusionNode
        from lsu_mesh.mesh.nodes.estimator import Estimator
        from lsu_mesh.mesh.nodes.filter import FilterNode
        from lsu_mesh.mesh.nodes.fusion import FusionNode
        from lsu_mesh_services.bank_answers import BankAnswers

        self._answer_model()
        if isinstance(self._node, BankFilterNode | BankFusionNode):
            BankAnswers(self._node).declare(self._bus)
            return
        assert isinstance(self._node, Estimator)
        if isinstance(self._node, FilterNode):
            self._bus.ask(last_key(self._mesh, self._node.name))
            self._node.predicts = self._node.name in taken_predictions(self._node.configuration)
            if not self._node.predicts:
                self._bus.watch_listeners(key(self._mesh, "prediction", self._node.name))
        if isinstance(self._node, FusionNode):
            for name in self._node.sources:
                self._answer_last(self._node, name)
        self._answer_latest(self._node)

    def _answer_last(self, node: FusionNode, name: str) -> None:
        def answers() -> tuple[str, bytes, str] | None:
            last = node.last.get(name)
            if last is None:
                return None
            return last_key(self._mesh, name), encode(last), encoding(last.topic)

        self._bus.answer(last_key(self._mesh, name), answers)

    def _answer_latest(self, node: Estimator) -> None:
        topic = "fused" if node.role == "fusion" else "posterior"
        own_key = key(self._mesh, topic, node.name)

        def latest() -> tuple[str, bytes, str] | None:
            last = node.last_posterior
            return None if last is None else (own_key, encode(last), encoding(last.topic))

        self._bus.answer(own_key, latest)

    def _answer_model(self) -> None:
        model = encode_model(model_answer(self._node.configuration, self._node.boot))
        asked = model_key(self._mesh)
        self._bus.answer(asked, lambda: (asked, model, "application/msgpack"))

    def tell_moved(self) -> None:
        """That the mesh has an earlier start than this peer knew, and that it has begun again."""
        start_ns = self._node.configuration.grid.start_ns
        text = f"the mesh has started earlier, at {moment_text(start_ns)}; begun again with that start"
        about: dict[str, str | int | float | None] = {"start_ns": start_ns}
        self._publish([self._node.event("WARN", "start-changed", text, now=self._clock.now(), step=0, about=about)])

    def turn(self) -> None:
        """Wait for something to do, then do all of it."""
        self._watch_links()
        self._start.check(self._bus, self._clock.now())
        self._look_for_standstill(self._clock.now())
        self._node.record_lost(self._bus.arrivals.take_losses(), self._clock.now())
        waits_since = self._clock.now()
        arrival = self._bus.next(self._patience())
        self._waited_ns += self._clock.now() - waits_since
        began, queued = self._clock.now(), self._bus.waiting() + (arrival is not None)
        age_ns = 0 if arrival is None else began - arrival.arrival_ns
        for taken in range(1, self._node.takes_at_once + 1):
            if arrival is None:
                break
            self._publish(self._take(arrival))
            arrival = self._bus.next(0) if taken < self._node.takes_at_once else None
        self._node.admission.duplicates += self._bus.copies - self._copies
        self._copies = self._bus.copies
        self._node.is_late = self._bus.waiting() >= self._node.takes_at_once
        self._publish(self._node.work(self._clock.now()))
        self._measure(queued, age_ns, self._clock.now() - began)

    def _want_again(self, address: str, boot: str, numbers: Collection[int]) -> None:
        self._bus.arrivals.want(address, boot, numbers, self._clock.now())

    def _measure(self, queued: int, age_ns: int, took_ns: int) -> None:
        """What the next health message tells of the process: the worst since the last one."""
        if self._node.next_health != self._measured_until:
            self._measured_until = self._node.next_health
            self._worst_queue = self._worst_ns = self._worst_age_ns = 0
        self._worst_queue, self._worst_ns = max(self._worst_queue, queued), max(self._worst_ns, took_ns)
        self._worst_age_ns = max(self._worst_age_ns, age_ns)
        self._need.measure(self._reading())
        self._node.gauges |= self._need.gauges | {
            "queue": float(self._worst_queue),
            "queue_ms": self._worst_age_ns * 1e-6,
            "dropped": float(self._bus.dropped),
            "too old": float(self._bus.arrivals.too_old),
            "step_ms": self._worst_ns * 1e-6,
        }

    def _reading(self) -> Reading:
        queue = self._bus.arrivals
        return Reading(
            self._clock.now(),
            self._waited_ns,
            time.process_time_ns(),
            queue.taken,
            waiting=len(queue),
            too_old=queue.too_old,
        )

    def _look_for_standstill(self, now: int) -> None:
        """A process that was stopped cannot tell how long ago came what waited for it."""
        if now - self._turned_at > STANDSTILL_NS:
            self._settled_at = now + STANDSTILL_NS
        self._turned_at = now
        self._node.admission.stood_still = now < self._settled_at

    def _watch_links(self) -> None:
        now = self._clock.now()
        if now < self._next_look:
            return
        self._next_look = now + LOOK_AT_LINKS_NS
        if self._beside is not None:
            self._beside.look()
        links = self._bus.links()
        if links != self._links:
            self._links = links
            self._node.record_links(links, now)

    def farewell(self) -> None:
        """A last health message, so that the counts of the whole run are known."""
        self._publish([self._node.health(self._clock.now())])

    def _patience(self) -> float:
        wakeup = self._node.wakeup()
        if wakeup is None:
            return MAX_WAIT
        return min(MAX_WAIT, max(0.0005, (wakeup - self._clock.now()) * 1e-9))

    def _take(self, arrival: Arrival) -> list[Message]:
        if self._beside is not None and (found := self._beside.take(arrival)) is not None:
            return found
        if arrival.what == "sample":
            if self._start.receives(arrival.key, arrival.payload):
                return []
            return self._node.deliver(self._canonical(arrival.key), arrival.payload, arrival.arrival_ns)
        if arrival.what in ("listened", "unheard"):
            from lsu_mesh.mesh.nodes.estimator import Estimator

            assert isinstance(self._node, Estimator)
            self._node.predicts = arrival.what == "listened"
            return []
        if arrival.what == "alive":
            self._start.somebody_came(arrival.arrival_ns)
        address = parse(arrival.key)
        if address is not None:
            self._node.record_alive(address.name, arrival.what == "alive", arrival.arrival_ns)
        return []

    def _canonical(self, sample_key: str) -> str:
        """Answers to ``last/NAME`` are posteriors of NAME."""
        if sample_key == last_key(self._mesh, self._node.name):
            topic = "posterior" if self._node.configuration.instances is None else "bank_posterior"
            return key(self._mesh, topic, self._node.name)
        return sample_key

    def _publish(self, messages: Iterable[Message]) -> None:
        for message in messages:
            if isinstance(message, Event) and message.code == DUPLICATE_PROCESS:
                print(f"{self._node.role} {self._node.name}: {message.text}", file=sys.stderr)
            self._bus.publish(self._node.key(message), encode(message), encoding(message.topic))
