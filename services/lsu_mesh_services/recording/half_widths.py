"""Half-widths of the noise over time: those in force at each filter, and those that an identifier suggests.

Drawn where they can change: where a filter estimates them itself, or an identifier watches.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np
import rerun as rr

from lsu_mesh.mesh.messages import Posterior, Suggestion
from lsu_mesh_services.recording.entity_paths import EntityPaths, path
from lsu_mesh_services.recording.palette import IDENTIFIER, OTHER, Color
from lsu_mesh_services.recording.thinning import Thinning
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines

POINTS = rr.components.MarkerShape.Diamond
STEPS = rr.components.InterpolationMode.StepAfter


class _Told(NamedTuple):
    moment: Moment
    rho: list[float]
    r: list[float]


class HalfWidths:
    """Collects half-widths and sends them in batches."""

    def __init__(self, stream: Stream, timelines: Timelines, names: EntityPaths, colors: dict[str, Color]) -> None:
        self._stream = stream
        self._timelines = timelines
        self._names = names
        self._thinning = Thinning(names.configuration)
        self._rows: defaultdict[str, list[_Told]] = defaultdict(list)
        self._factors: defaultdict[str, list[tuple[Moment, float]]] = defaultdict(list)
        self.is_drawn = bool(names.learners)
        if self.is_drawn:
            self._style(colors)

    def add(self, message: Posterior, arrival_ns: int) -> None:
        """The half-widths by which a filter's set was made."""
        is_filter = message.name in self._names.configuration.filters
        if self.is_drawn and is_filter and self._thinning.draws(message.name, message.step):
            moment = Moment(message.step, arrival_ns)
            self._rows[message.name].append(_Told(moment, message.bounds.rho, message.bounds.r))

    def add_suggestion(self, message: Suggestion, arrival_ns: int) -> None:
        """What an identifier found; drawn at the last step that it looked at."""
        moment = Moment(message.step, arrival_ns)
        sensors = sorted(self._names.configuration.identifiers[message.name].sensors)
        r = [value for sensor in sensors for value in message.r[sensor]]
        self._rows[message.name].append(_Told(moment, message.rho, r))
        self._factors[message.name].append((moment, message.factor))

    def flush(self) -> None:
        """Send all rows that wait."""
        rows, self._rows = self._rows, defaultdict(list)
        factors, self._factors = self._factors, defaultdict(list)
        for peer, told in rows.items():
            times = self._timelines.columns([one.moment for one in told])
            values = np.array([[*one.rho, *one.r] for one in told])
            for i, entity in enumerate(self._entities(peer)):
                self._stream.send_columns(entity, times, rr.Scalars.columns(scalars=values[:, i]))
        for name, found in factors.items():
            times = self._timelines.columns([moment for moment, _ in found])
            pairs = np.array([(factor, 1.0) for _, factor in found])
            self._stream.send_columns(path("factor", name), times, rr.Scalars.columns(scalars=pairs))

    def _entities(self, peer: str) -> list[str]:
        """One entity per half-width of a filter or an identifier: rho, then r."""
        disturbances = [path("half_widths", "rho", part, peer) for part in self._names.disturbances]
        outputs = self._names.outputs_of_watcher(peer)
        return disturbances + [output.half_width(peer) for output in outputs]

    def _style(self, colors: dict[str, Color]) -> None:
        configuration = self._names.configuration
        for peer in configuration.filters:
            line = rr.SeriesLines(colors=[colors[peer]], widths=[1.5], names=[peer], interpolation_mode=STEPS)
            for entity in self._entities(peer):
                self._stream.log(entity, line, static=True)
        for name in configuration.identifiers:
            points = rr.SeriesPoints(colors=[IDENTIFIER], markers=[POINTS], marker_sizes=[5.0], names=[name])
            for entity in self._entities(name):
                self._stream.log(entity, points, static=True)
            names = [name, "1: explained"]
            pair = rr.SeriesLines(colors=[IDENTIFIER, OTHER], widths=[2.0, 1.5], names=names)
            self._stream.log(path("factor", name), pair, static=True)
