"""Events and the coming and going of peers, as text."""

from __future__ import annotations

from collections import defaultdict

import rerun as rr

from lsu_mesh.mesh.messages import Event
from lsu_mesh_services.recording.entity_paths import path
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines


class Events:
    """Collects lines of text and sends them in batches."""

    def __init__(self, stream: Stream, timelines: Timelines) -> None:
        self._stream = stream
        self._timelines = timelines
        self._rows: defaultdict[str, list[tuple[Moment, str, str]]] = defaultdict(list)

    def add(self, message: Event, moment: Moment) -> None:
        """An event that a peer told."""
        text = message.text.removeprefix(f"step {moment.step}: ")
        self.tell(message.name, moment, message.level, f"{message.code}: {text}")

    def tell(self, peer: str, moment: Moment, level: str, text: str) -> None:
        """A line of text about a peer."""
        self._rows[path("events", peer)].append((moment, level, f"step {moment.step}, {peer}: {text}"))

    def flush(self) -> None:
        """Send all lines that wait."""
        rows, self._rows = self._rows, defaultdict(list)
        for entity, lines in rows.items():
            times = self._timelines.columns([moment for moment, _, _ in lines])
            columns = rr.TextLog.columns(text=[text for _, _, text in lines], level=[level for _, level, _ in lines])
            self._stream.send_columns(entity, times, columns)
