"""Lanes of status, on change only: of the sets, of the processes, and of the sources in the eyes of the fusion.

A lane tells of the newest step. What is said again of an older one, after something came late, does not change it: the
lane would go on with that state up to the next change.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

import rerun as rr

from lsu_mesh.mesh.config import Configuration
from lsu_mesh.mesh.messages import Fused, Health, Posterior
from lsu_mesh_services.recording.entity_paths import path
from lsu_mesh_services.recording.palette import HEALTH, STATUS, TRUST, Color
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines

GONE = "gone"


class StatusLanes:
    """Collects changes of status and sends them in batches."""

    def __init__(self, stream: Stream, timelines: Timelines, configuration: Configuration) -> None:
        self._stream = stream
        self._timelines = timelines
        self._sources = {name: set(fusion.sources) for name, fusion in configuration.fusion.items()}
        self._shown: dict[str, str] = {}
        self._newest: defaultdict[str, int] = defaultdict(int)
        self._rows: defaultdict[str, list[tuple[Moment, str]]] = defaultdict(list)
        for name in (*configuration.filters, *configuration.fusion):
            self._style(path("status", name), STATUS)
        for _, name in configuration.peers():
            self._style(path("health", name), HEALTH)
        for name, fusion in configuration.fusion.items():
            for source in fusion.sources:
                self._style(path("trust", name, source), TRUST)

    def add(self, message: Posterior, arrival_ns: int) -> None:
        """Status of a posterior or fused set; of a fused set also the trust in its sources."""
        if message.step < self._newest[message.name]:
            return
        self._newest[message.name] = message.step
        moment = Moment(message.step, arrival_ns)
        self._change(path("status", message.name), moment, message.status)
        if isinstance(message, Fused):
            self._add_trust(message, moment)

    def _add_trust(self, message: Fused, moment: Moment) -> None:
        rejected = {rejection.source.rpartition("/")[2] for rejection in message.rejected}
        quarantined = {source.rpartition("/")[2] for source in message.quarantined}
        accepted = {source.rpartition("/")[2] for topic, source, _, _ in message.used if topic == "posterior"}
        for source in accepted - rejected - quarantined:
            self._change(path("trust", message.name, source), moment, "accepted")
        for source in rejected - quarantined:
            self._change(path("trust", message.name, source), moment, "rejected")
        for source in quarantined:
            self._change(path("trust", message.name, source), moment, "quarantined")
        for source in self._sources[message.name] - accepted - rejected - quarantined:
            self._change(path("trust", message.name, source), moment, "silent")

    def add_health(self, message: Health, moment: Moment) -> None:
        """Level of a peer's health."""
        self._change(path("health", message.name), moment, message.level)

    def peer_changed(self, name: str, alive: bool, moment: Moment) -> None:
        """A peer came or went."""
        status = path("status", name)
        if not alive:
            self._change(path("health", name), moment, GONE)
            if status in self._shown:
                self._change(status, moment, GONE)
        elif self._shown.get(path("health", name), GONE) == GONE:
            self._change(path("health", name), moment, "OK")

    def flush(self) -> None:
        """Send all changes that wait."""
        rows, self._rows = self._rows, defaultdict(list)
        for entity, changes in rows.items():
            times = self._timelines.columns([moment for moment, _ in changes])
            columns = rr.StateChange.columns(state=[state for _, state in changes])
            self._stream.send_columns(entity, times, columns)

    def _change(self, entity: str, moment: Moment, state: str) -> None:
        if self._shown.get(entity) != state:
            self._shown[entity] = state
            self._rows[entity].append((moment, state))

    def _style(self, entity: str, colors: Mapping[str, Color]) -> None:
        style = rr.StateConfiguration(values=list(colors), colors=list(colors.values()))
        self._stream.log(entity, style, static=True)
