"""The thread that hears the mesh and writes it on the board."""

from __future__ import annotations

import threading
from dataclasses import replace

import msgspec

from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.keys import key, model_key, parse
from lsu_mesh.mesh.messages import TYPES
from lsu_mesh.mesh.model_answer import ModelAnswer
from lsu_mesh.mesh.nodes.node import SECOND
from lsu_mesh_services.bus import Bus, Clock
from lsu_mesh_services.gateway.board import Board, Connection
from lsu_mesh_services.network.receive_queue import Arrival

LIVE = ("posterior", "fused", "health")
CHECK_NS = SECOND // 4
ASK_NS = SECOND
SILENT_NS = 3 * SECOND
"""A mesh of which nothing came for so long is over."""


class MeshReader:
    """Use it as a context manager; the thread ends with it."""

    def __init__(self, configuration: Configuration, bus: Bus, clock: Clock, trying: tuple[str, ...]) -> None:
        self.configuration = replace(configuration, mesh=replace(configuration.mesh, steps=None))
        """Of a mesh that agrees on its start when it begins, with that start as soon as it is known."""
        self.board = Board(self.configuration, clock.now())
        self._admission = Admission(self.configuration, TYPES)
        self._bus, self._clock, self._trying = bus, clock, trying
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="mesh reader", daemon=True)
        self._next_check = self._next_question = self._admitted_ns = 0
        self.failure: Exception | None = None

    def __enter__(self) -> MeshReader:
        mesh = self.configuration.mesh.name
        self._bus.watch_alive(key(mesh, "live", "*"))
        for topic in LIVE:
            self._bus.subscribe_live(key(mesh, topic, "*"))
        self._bus.subscribe(key(mesh, "event", "*"))
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._ends.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._ends.is_set():
                arrival = self._bus.next(0.1)
                while arrival is not None:
                    self._take(arrival)
                    arrival = self._bus.next(0)
                self._check(self._clock.now())
        except Exception as error:  # told by the server, which ends
            self.failure = error

    def _take(self, arrival: Arrival) -> None:
        address = parse(arrival.key)
        if arrival.what != "sample":
            if address is not None:
                self.board.record_presence(address.name, arrival.what == "alive")
                self._next_check = 0
        elif arrival.key == model_key(self.configuration.mesh.name):
            self._learn_start(arrival.payload, arrival.arrival_ns)
        else:
            message = self._admission.admit(arrival.key, arrival.payload)
            if message is not None:
                self._admitted_ns = arrival.arrival_ns
                self.board.record(message, arrival.arrival_ns)

    def _check(self, now: int) -> None:
        if now < self._next_check:
            return
        self._next_check = now + CHECK_NS
        refused = self._admission.refused
        last = self._admission.last_refusal
        self.board.check(now, Connection(self._bus.links(), self._trying, refused.total(), last))
        if self.configuration.mesh.starts_now and now >= self._next_question:
            self._next_question = now + ASK_NS
            self._bus.ask_all(model_key(self.configuration.mesh.name))

    def _learn_start(self, payload: bytes, now: int) -> None:
        """The time of step 0, which the digest of what follows holds.

        Of two starts the earlier stands. A later one is that of a mesh that was started again, if the other is silent.
        """
        try:
            told_ns = msgspec.msgpack.decode(payload, type=ModelAnswer).start_ns
        except msgspec.DecodeError:
            return
        known_ns = self.configuration.mesh.start_ns
        if told_ns is None or told_ns == known_ns:
            return
        if known_ns is None or told_ns < known_ns or now - self._admitted_ns > SILENT_NS:
            self.configuration = self.configuration.started(told_ns)
            self._admission = Admission(self.configuration, TYPES)
            self._admitted_ns = now
