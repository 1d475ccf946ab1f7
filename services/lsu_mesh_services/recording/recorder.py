"""The recorder: everything that comes goes into one file, raw and drawn."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from lsu_mesh.mesh.bank_messages import BankSets, BankTruth
from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.ledger import Ledger
from lsu_mesh.mesh.live_times import can_be_true
from lsu_mesh.mesh.messages import (
    Event,
    Health,
    Measurement,
    Message,
    Posterior,
    Prediction,
    Smoothed,
    Suggestion,
    Truth,
)
from lsu_mesh_services.recording import palette
from lsu_mesh_services.recording.banks import BankDrawings
from lsu_mesh_services.recording.entity_paths import EntityPaths
from lsu_mesh_services.recording.estimates import Estimates
from lsu_mesh_services.recording.events import Events
from lsu_mesh_services.recording.half_widths import HalfWidths
from lsu_mesh_services.recording.outputs import Outputs
from lsu_mesh_services.recording.parted_stream import PartedStream
from lsu_mesh_services.recording.raw import RawStore
from lsu_mesh_services.recording.sets_3d import Sets3D
from lsu_mesh_services.recording.status import StatusLanes
from lsu_mesh_services.recording.stream import run_description
from lsu_mesh_services.recording.timeline import Moment, Timelines
from lsu_mesh_services.recording.timeout import ends_within
from lsu_mesh_services.recording.topology import Topology

NOTHING: Mapping[str, str] = MappingProxyType({})
FLUSH_TIMEOUT_S = 5.0
HANGS_S = 20.0
"""Drawing, sending and a flush that keeps its own time limit take less on a busy machine; more never ends."""
LEAST_FREE = 2**20
"""Bytes that are left on the disk, beside what two flushes take."""
CLOSING_S = 60.0
"""How long a sound file may take to end."""
WRITER_ENDED = "File-writer thread shut down"
"""What a flush says after an error of the disk, from which Rerun's writer does not come back."""
GOING_ON_NS = 300_000_000
"""Data that arrive so long after a departure show that the mesh continues."""
AFTERMATH_NS = 3_000_000_000
"""How long a departure may be the beginning of the end of the run."""
DRAWING_INTERVAL_S = 5.0
"""How often drawings are written where no viewer follows; raw payloads are written at every flush."""
MAX_WAITING_BYTES = 4 * 2**20
"""So many bytes of payloads are written before the interval of flushes is over."""


class _Presence(NamedTuple):
    role: str
    name: str
    alive: bool
    moment: Moment


class Recorder:
    """Owns one recording.

    Parameters
    ----------
    configuration:
        The mesh; gives names, units, colours and layout.
    path:
        A new ``.rrd`` file.
    run_properties:
        Stored with the recording beside what it tells of itself (configuration, model, seed, versions, processor).
    serve_port:
        Port of the loopback on which viewers may follow; ``None``: no network.

    continues:
        An earlier part of the same run, after a restart of the recorder; ``mend`` joins the parts.

    Raises
    ------
    OSError
        The file exists already or cannot be written.

    After that nothing is raised: what cannot be drawn is counted in :attr:`problems`, and its payload is stored all
    the same.
    """

    def __init__(
        self,
        configuration: Configuration,
        path: Path,
        *,
        run_properties: Mapping[str, str] = NOTHING,
        serve_port: int | None = None,
        continues: Path | None = None,
    ) -> None:
        self._configuration = configuration
        self._names = names = EntityPaths(configuration)
        timelines = Timelines(configuration.mesh.dt)
        colors = palette.colors(configuration)
        self._ledger = Ledger()
        described = run_description(configuration) | dict(run_properties)
        self._stream = stream = PartedStream(names, path, described, serve_port=serve_port, continues=continues)
        self._part_ns: int | None = None
        """When the part began."""
        self._raw = RawStore(stream)
        self._estimates = Estimates(stream, timelines, names, colors)
        self._space = Sets3D(stream, timelines, names, colors)
        self._outputs = Outputs(stream, timelines, names, colors)
        self._half_widths = HalfWidths(stream, timelines, names, colors)
        self._banks = BankDrawings(stream, timelines, names, colors)
        self._status = StatusLanes(stream, timelines, configuration)
        self._events = Events(stream, timelines)
        self._topology = Topology(stream, timelines, configuration, colors)
        self._interval_ns = int(configuration.recorder.flush * 1e9)
        self._next_flush_ns = self._next_drawing_ns = 0
        # Every batch costs about 1.3 KiB and 0.2 ms per entity. Nobody waits for drawings where no viewer follows.
        patience = 0 if serve_port is not None else int(DRAWING_INTERVAL_S * 1e9)
        self._drawing_interval_ns = max(self._interval_ns, patience)
        self._latest_step = 0
        self._departures: list[_Presence] = []
        self._broken = ""
        """Why nothing more is recorded, once that is so."""
        self._unflushed: list[tuple[str, str, int]] = []
        self._size = 0
        """Of the file, when it was last looked at."""
        self._counts: Counter[str] = Counter()
        self._closed = False
        self.has_ended = True
        """False after :meth:`close` where Rerun hangs: the process should then end without waiting for its threads."""

    @property
    def path(self) -> Path:
        """The part that is being written."""
        return self._stream.path

    @property
    def flushed(self) -> dict[str, int]:
        """Per key the ``seq`` up to which everything since this recorder's first message of it is in the file."""
        return self._ledger.flushed

    @property
    def problems(self) -> list[str]:
        """What went wrong so far, each kind once with its count."""
        return [
            f"{text}: {count}" if text == self._broken else text if count == 1 else f"{text} ({count} times)"
            for text, count in self._counts.items()
        ]

    def record(self, key: str, payload: bytes, arrival_ns: int, message: Message | None) -> None:
        """Keep a payload, and draw its message; ``None`` where the payload was refused.

        A datum of a live source whose time cannot be true is kept at the present step and not drawn: where a clock is
        an hour ahead, the axis would reach to the steps of that hour.
        """
        if self._broken:
            self._counts[self._broken] += 1
            return
        if message is None:
            self._raw.add(key, payload, None, arrival_ns)
            return
        is_drawn = can_be_true(self._configuration, message, arrival_ns)
        moment = Moment(message.step, arrival_ns) if is_drawn else self._now(arrival_ns)
        self._raw.add(key, payload, moment, arrival_ns)
        self._unflushed.append((key, message.boot, message.seq))
        if is_drawn:
            self._guarded(f"drawing {message.topic} of {message.src}", lambda: self._draw(message, arrival_ns))

    def peer_changed(self, role: str, name: str, alive: bool, now_ns: int) -> None:
        """A peer came or went. At the end of a run all go: a departure is drawn once the mesh continues without it."""
        if alive:
            self._draw_departures(now_ns, patience_ns=0)
            presence = _Presence(role, name, True, self._now(now_ns))
            self._guarded(f"drawing the presence of {name}", lambda: self._draw_presence(presence))
        else:
            self._departures.append(_Presence(role, name, False, self._now(now_ns)))

    def tick(self, now_ns: int) -> None:
        """Flush when the interval is over."""
        self._draw_departures(now_ns, AFTERMATH_NS)
        is_due = now_ns >= self._next_flush_ns or self._raw.waiting_bytes > MAX_WAITING_BYTES
        if is_due and not self._broken:
            self._next_flush_ns = now_ns + self._interval_ns
            draws = now_ns >= self._next_drawing_ns
            if draws:
                self._next_drawing_ns = now_ns + self._drawing_interval_ns
            self._put(lambda: self._store(draws))
            self._end_part(now_ns)

    def _end_part(self, now_ns: int) -> None:
        """Begin a new part when this one is as large or as old as one may be."""
        settings = self._configuration.recorder
        began = self._part_ns = now_ns if self._part_ns is None else self._part_ns
        is_large = settings.part_size and self._size >= settings.part_size
        is_old = settings.part_time and now_ns - began >= settings.part_time * 1e9
        if (is_large or is_old) and not self._broken:
            self._part_ns, self._size = now_ns, 0
            self._put(lambda: self._store(draws=True))
            self._guarded("beginning a new part", self._stream.begin_next)

    def flush(self) -> None:
        """Write everything that waits to the file."""
        self._put(lambda: self._store(draws=True))

    def _put(self, store: Callable[[], None]) -> None:
        """Hand what waits to Rerun and have it written; any of its calls may hang once its file writer has ended."""
        if not self._broken:
            self._guarded(f"looking at {self.path.parent}", self._check_free_space)
        if not self._broken and not ends_within(HANGS_S, store):
            self._guarded("giving up", self._give_up)

    def _check_free_space(self) -> None:
        """Give up while there is room to end the file: after an error of the disk Rerun may hang for ever."""
        size, free = self.path.stat().st_size, shutil.disk_usage(self.path.parent).free
        grown, self._size = size - (self._size or size), size
        if free < LEAST_FREE + 2 * grown:
            self._stop(f"only {free} bytes are free there")

    def _send_drawings(self) -> None:
        parts = self._estimates, self._space, self._outputs, self._half_widths, self._banks
        for part in (*parts, self._status, self._events, self._topology):
            self._guarded(f"drawing {type(part).__name__.lower()}", part.flush)

    def _store(self, draws: bool) -> None:
        if draws:
            self._send_drawings()
        else:
            self._guarded("drawing sets3d", self._space.draw)
        unflushed, self._unflushed = self._unflushed, []
        stored = self._guarded("storing raw payloads", self._raw.flush)
        written = self._guarded(f"writing {self.path}", self._write)
        if stored and written and not self._broken:
            for key, boot, seq in unflushed:
                self._ledger.record(key, boot, seq)
            self._ledger.flush()

    def _write(self) -> None:
        try:
            self._stream.flush(timeout_sec=FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            if WRITER_ENDED not in str(error):
                raise
            self._give_up()

    def _give_up(self) -> None:
        free = shutil.disk_usage(self.path.parent).free
        self._stop(f"only {free} bytes are free there" if free < LEAST_FREE else "Rerun's file writer has ended")

    def _stop(self, reason: str) -> None:
        self._broken = f"{self.path} takes no more data: {reason}; messages that are lost"
        self._counts[self._broken] = len(self._unflushed)

    def close(self) -> None:
        """Flush, and end the file; the second call does nothing."""
        if self._closed:
            return
        self._closed = True
        if self._departures:
            names = ", ".join(presence.name for presence in self._departures)
            moment = self._departures[-1].moment
            self._guarded(
                "drawing events", lambda: self._events.tell("recorder", moment, "INFO", f"the run ended: {names}")
            )
        if not self._broken:
            self._put(self._finish)
        self._guarded("closing the file", self._disconnect)

    def _finish(self) -> None:
        self._guarded("drawing space", self._space.finish)
        self._guarded("describing the run", self._stream.describe)
        self._store(draws=True)

    def _disconnect(self) -> None:
        self.has_ended = ends_within(HANGS_S if self._broken else CLOSING_S, self._stream.disconnect)

    def _draw(self, message: Message, arrival_ns: int) -> None:
        self._names.check(message)
        moment = Moment(message.step, arrival_ns)
        self._latest_step = max(self._latest_step, message.step)
        if isinstance(message, Posterior | Truth | Measurement | BankSets | BankTruth):
            self._draw_departures(arrival_ns, GOING_ON_NS)
        if isinstance(message, Posterior):
            self._estimates.add(message, arrival_ns)
            self._space.add(message, arrival_ns)
            self._half_widths.add(message, arrival_ns)
            self._status.add(message, arrival_ns)
        elif isinstance(message, Smoothed):
            self._estimates.add_smoothed(message, arrival_ns)
        elif isinstance(message, Suggestion):
            self._half_widths.add_suggestion(message, arrival_ns)
        elif isinstance(message, Truth):
            self._estimates.add_truth(message, arrival_ns)
            self._space.add_truth(message, arrival_ns)
        elif isinstance(message, Measurement):
            self._outputs.add_measurement(message, arrival_ns)
        elif isinstance(message, Prediction):
            self._outputs.add_prediction(message, arrival_ns)
        elif isinstance(message, BankSets):
            self._banks.add(message, arrival_ns)
        elif isinstance(message, BankTruth):
            self._banks.add_truth(message, arrival_ns)
        elif isinstance(message, Health):
            self._status.add_health(message, self._now(arrival_ns))
        elif isinstance(message, Event):
            self._events.add(message, moment if message.step else self._now(arrival_ns))

    def _draw_departures(self, now_ns: int, patience_ns: int) -> None:
        due = [presence for presence in self._departures if now_ns - presence.moment.wall_ns >= patience_ns]
        if due:
            self._departures = [presence for presence in self._departures if presence not in due]
            for presence in due:
                self._guarded(f"drawing the presence of {presence.name}", partial(self._draw_presence, presence))

    def _draw_presence(self, presence: _Presence) -> None:
        role, name, alive, moment = presence
        self._status.peer_changed(name, alive, moment)
        self._topology.peer_changed(role, name, alive, moment)
        text = f"{role} {'is there' if alive else 'is gone'}"
        self._events.tell(name, moment, "INFO" if alive else "WARN", text)

    def _now(self, now_ns: int) -> Moment:
        """The moment of what belongs to no step of its own."""
        return Moment(self._latest_step, now_ns)

    def _guarded(self, doing: str, work: Callable[[], None]) -> bool:
        """Do the work; an error becomes a counted problem. The recording of everything else must go on."""
        try:
            work()
        except Exception as error:
            self._counts[f"{doing}: {type(error).__name__}: {error}"] += 1
            return False
        return True
