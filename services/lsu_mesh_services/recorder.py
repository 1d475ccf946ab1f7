"""The recorder process: subscribes to what a mesh tells, owns the only recording."""

from __future__ import annotations

import gc
import os
import secrets
import socket
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from lsu_mesh.mesh.access import recorded, recorded_topics
from lsu_mesh.mesh.admission import Admission
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.duplicate_process import DuplicateProcess
from lsu_mesh.mesh.keys import key, parse
from lsu_mesh.mesh.lost_messages import LostMessages
from lsu_mesh.mesh.messages import VERSION, Health, encode, encoding
from lsu_mesh.mesh.nodes.node import overload_words
from lsu_mesh.mesh.nodes.source_timeout import SourceTimeouts
from lsu_mesh_services.bus import Bus, Clock, SessionSettings
from lsu_mesh_services.exit_codes import COULD_NOT_START, FAILURE, OK
from lsu_mesh_services.mesh_start import MeshStart
from lsu_mesh_services.network.processor_need import ProcessorNeed, Reading
from lsu_mesh_services.network.receive_queue import Arrival
from lsu_mesh_services.recording.part_files import next_part
from lsu_mesh_services.recording.recorder import Recorder
from lsu_mesh_services.session import connection_report
from lsu_mesh_services.stop import Stop

ROLE_NAME = "recorder"
AFTER_STOP_S = 0.5
"""How long the recorder still receives messages, at most, after it was asked to stop."""
QUIET_S = 0.2
"""When no message has arrived for so long, none is under way."""
BATCH_S = 0.02
"""So long the recorder waits for more, once something has come: messages are recorded together, on fewer wake-ups."""
MAX_AT_ONCE = 2048
"""Messages that are recorded before the recorder checks the stop flag and the time again."""


def run_recorder(
    configuration: Configuration,
    record: str | None,
    settings: SessionSettings,
    stop: Stop,
    serve_port: int | None = None,
) -> int:
    """Record until told to stop, and let viewers follow on ``serve_port`` of the loopback; returns the exit code."""
    clock, known_ns = Clock(), None
    template = record or configuration.recorder.path
    moment = time.strftime("%Y%m%d-%H%M%S")
    path = Path(template.replace("{mesh}", configuration.mesh.name).replace("{time}", moment))
    is_further = os.environ.get("LSU_MESH_RESTARTS", "0") != "0"
    while True:
        start = MeshStart(configuration, ROLE_NAME, ROLE_NAME, known_ns)
        code = _record(start, next_part(path) if is_further else path, Session(settings, clock, stop, serve_port), path)
        if code != OK or start.other_ns is None:
            return code
        known_ns, is_further = start.other_ns, True


@dataclass(frozen=True)
class Session:
    """What a recorder needs besides its mesh and its file."""

    settings: SessionSettings
    clock: Clock
    stop: Stop
    serve_port: int | None


def _record(start: MeshStart, part: Path, session: Session, path: Path) -> int:
    """Write one part of a recording, until told to stop or until the mesh turns out to have another start."""
    recorder: Recorder | None = None
    try:
        settings = session.settings
        with Bus(settings, session.clock) as bus, connection_report(ROLE_NAME, bus, settings):
            started = start.configuration(bus, session.clock, lambda: bool(session.stop))
            if started is None:
                return OK
            try:
                part.parent.mkdir(parents=True, exist_ok=True)
                continues = path if part != path else None
                recorder = Recorder(started, part, serve_port=session.serve_port, continues=continues)
            except OSError as error:
                print(
                    f"recorder: cannot write {path}: {error.strerror or error}; choose another place with --record",
                    file=sys.stderr,
                )
                return COULD_NOT_START
            service = RecorderService(started, recorder, bus, session.clock, start=start)
            service.declare()
            gc.collect()
            gc.freeze()  # as every peer does
            print(f"recorder: writing {part}", file=sys.stderr)
            while not session.stop and start.other_ns is None:
                service.turn()
            service.finish()
    finally:
        if recorder is not None:
            recorder.close()
            for problem in recorder.problems:
                print(f"recorder: {problem}", file=sys.stderr, flush=True)
            if not recorder.has_ended:
                os._exit(FAILURE)  # Rerun's own clean-up at the end of a process would hang as well
    return OK


class RecorderService:
    """The loop around the recording: drain the queue, record, flush, tell its health."""

    def __init__(
        self, configuration: Configuration, recorder: Recorder, bus: Bus, clock: Clock, *, start: MeshStart
    ) -> None:
        self._start = start
        self._configuration = configuration
        self._recorder = recorder
        self._bus = bus
        self._clock = clock
        self._mesh = configuration.mesh.name
        self._admission = Admission(configuration, recorded_topics(configuration))
        bus.recover(self._admission.is_cached, self._admission.kept_ns)
        # without a bound on age: a recording wants all that it can get
        self._lost, self._copies, self._waited_ns = LostMessages(), 0, 0
        self._need = ProcessorNeed(self._reading())
        self._boot = secrets.token_hex(8)
        self._started_ns, self._host = clock.now(), socket.gethostname()
        self._sequence = 0
        self._next_health = 0
        self._links = -1
        self._queue = self._longest_ns = 0
        """The longest queue and turn since the last health message."""
        self._other_process = DuplicateProcess(f"{ROLE_NAME}/{ROLE_NAME}", self._boot)
        self._roles = {name: role for role, name in configuration.peers()}
        others = [
            name for role, name in configuration.peers()
            if name != ROLE_NAME and not configuration.is_external(role, name)
        ]  # fmt: skip
        self._source_timeouts = SourceTimeouts(configuration, [("health", name) for name in others], others)
        """Every peer of the mesh tells its health every second; of whom nothing is heard, nothing is recorded."""

    def declare(self) -> None:
        """Subscribe to what is recorded, watch the peers, show that the recorder is there."""
        self._bus.announce(key(self._mesh, "health", ROLE_NAME))
        for topic, name in recorded(self._configuration):
            self._bus.subscribe(key(self._mesh, topic, name))
        self._bus.watch_alive(key(self._mesh, "live", "*"))
        self._bus.declare_alive(key(self._mesh, "live", ROLE_NAME))

    def turn(self) -> None:
        """Take what has come, then flush if it is time."""
        began, self._queue = self._clock.now(), max(self._queue, self._bus.waiting())
        taken = self._take_all(MAX_AT_ONCE)
        now = self._clock.now()
        self._need.measure(self._reading())
        losses = self._bus.arrivals.take_losses()
        self._lost.record(losses, now)
        for loss in losses:
            self._admission.expect(loss.key, loss.boot, loss.first, loss.last)
        self._admission.duplicates += self._bus.copies - self._copies
        self._copies = self._bus.copies
        self._recorder.tick(now)
        self._start.check(self._bus, now)
        links = self._bus.links()
        if now >= self._next_health or links != self._links:
            self._links = links
            self._next_health = now + 1_000_000_000
            self._tell_health(now)
        if taken:
            self._longest_ns = max(self._longest_ns, self._clock.now() - began)

    def finish(self) -> None:
        """Take what is under way, hear no more, and record all that has come; the file is closed by who opened it."""
        end = time.monotonic() + AFTER_STOP_S
        quiet_since = time.monotonic()
        while (now := time.monotonic()) < end and now - quiet_since < QUIET_S:
            if self._take_all(MAX_AT_ONCE):
                quiet_since = now
        self._bus.close()
        while self._take_all(MAX_AT_ONCE, 0.0):
            pass

    def _take_all(self, most: int, patience: float = 0.05) -> int:
        """Record what has come, waiting for the first of it so many seconds; returns how much it was."""
        taken = 0
        waits_since = self._clock.now()
        arrival = self._bus.next(patience)
        if arrival is not None and patience:
            time.sleep(BATCH_S)
        self._waited_ns += self._clock.now() - waits_since
        while arrival is not None:
            self._take(arrival)
            taken += 1
            arrival = self._bus.next(0.0) if taken < most else None
        return taken

    def _reading(self) -> Reading:
        queue = self._bus.arrivals
        return Reading(
            self._clock.now(), self._waited_ns, time.process_time_ns(), queue.taken, waiting=len(queue), too_old=0
        )

    def _take(self, arrival: Arrival) -> None:
        if arrival.what == "sample":
            if self._start.receives(arrival.key, arrival.payload):
                return
            duplicates = self._admission.duplicates
            message = self._admission.admit(arrival.key, arrival.payload)
            if message is not None or self._admission.duplicates == duplicates:
                self._recorder.record(arrival.key, arrival.payload, arrival.arrival_ns, message)
            if isinstance(message, Health) and message.name != ROLE_NAME:
                self._source_timeouts.received(message.name, arrival.arrival_ns)
            elif isinstance(message, Health):
                self._other_process.record(message, self._started_ns, arrival.arrival_ns)
            return
        if arrival.what == "alive":
            self._start.somebody_came(arrival.arrival_ns)
        address = parse(arrival.key)
        if address is not None:
            role = self._roles.get(address.name, "peer")
            self._recorder.peer_changed(role, address.name, arrival.what == "alive", arrival.arrival_ns)

    def _tell_health(self, now: int) -> None:
        problems = list(self._recorder.problems)
        twice = self._other_process.complaint(now)
        problems += [] if twice is None else [twice]
        if self._other_process.take_news(now) is not None:
            print(f"{ROLE_NAME}: {twice}", file=sys.stderr)
        problems += [complaint.text for complaint in self._source_timeouts.complaints(now)]
        if (given_up := self._lost.take_news(now)) is not None:
            print(f"{ROLE_NAME}: {given_up[0]}", file=sys.stderr)
        overload = overload_words(self._need.gauges)
        problems += [] if overload is None else [overload]
        if self._lost.count:
            problems.append(f"{self._lost.count} message(s) are not in the recording, last: {self._lost.last}")
        counters = self._admission.counters | {"queue": float(self._queue), "dropped": float(self._bus.dropped)}
        counters |= self._need.gauges | {"links": float(self._links), "step_ms": self._longest_ns * 1e-6}
        self._queue = self._longest_ns = 0
        counters |= {f"flushed {flushed}": float(seq) for flushed, seq in self._recorder.flushed.items()}
        health = Health(
            v=VERSION, src=f"{ROLE_NAME}/{ROLE_NAME}", boot=self._boot, seq=self._sequence, step=0, sent_ns=now,
            origin_ns=now, model=self._configuration.digest(), role=ROLE_NAME,
            level="WARN" if problems else "OK", reasons=problems[:16], counters=counters,
            started_ns=self._started_ns, host=self._host,
        )  # fmt: skip
        self._sequence += 1
        self._bus.publish(key(self._mesh, "health", ROLE_NAME), encode(health), encoding("health"))
