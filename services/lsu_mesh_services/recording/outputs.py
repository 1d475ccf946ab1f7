"""Measured outputs, and the interval in which each filter expects them before the data."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import rerun as rr

from lsu_mesh.mesh.messages import Measurement, Prediction
from lsu_mesh_services.recording.bands import band_columns, band_style
from lsu_mesh_services.recording.entity_paths import EntityPaths, Output
from lsu_mesh_services.recording.palette import OTHER, Color
from lsu_mesh_services.recording.thinning import Thinning
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines


class Outputs:
    """Collects measurements and output predictions and sends them in batches."""

    def __init__(self, stream: Stream, timelines: Timelines, names: EntityPaths, colors: dict[str, Color]) -> None:
        self._stream = stream
        self._timelines = timelines
        self._names = names
        self._thinning = Thinning(names.configuration)
        self._start_ns = names.configuration.grid.start_ns
        self._measured: defaultdict[Output, list[tuple[Moment, float]]] = defaultdict(list)
        self._predicted: defaultdict[str, list[tuple[Moment, Prediction]]] = defaultdict(list)
        self._of_sensor: defaultdict[str, list[Output]] = defaultdict(list)
        for output in names.outputs:
            self._of_sensor[output.sensor].append(output)
        self._style(colors)

    def add_measurement(self, message: Measurement, arrival_ns: int) -> None:
        """Measured outputs of one sensor, at their own moment; missing ones leave no point."""
        if not self._thinning.draws(message.src, message.step):
            return
        since = None if message.time_error_ns is None else message.time_ns - self._start_ns
        moment = Moment(message.step, arrival_ns, since)
        for output, value in zip(self._of_sensor[message.name], message.y, strict=True):
            if value is not None:
                self._measured[output].append((moment, value))

    def add_prediction(self, message: Prediction, arrival_ns: int) -> None:
        """Predicted outputs of one filter."""
        if self._thinning.draws(message.src, message.step):
            self._predicted[message.name].append((Moment(message.step, arrival_ns), message))

    def flush(self) -> None:
        """Send all rows that wait."""
        measured, self._measured = self._measured, defaultdict(list)
        predicted, self._predicted = self._predicted, defaultdict(list)
        for output, points in measured.items():
            times = self._timelines.columns([moment for moment, _ in points])
            values = np.array([value for _, value in points])
            self._stream.send_columns(output.measured(), times, rr.Scalars.columns(scalars=values))
        for peer, rows in predicted.items():
            self._send_predicted(peer, rows)

    def _send_predicted(self, peer: str, rows: list[tuple[Moment, Prediction]]) -> None:
        times = self._timelines.columns([moment for moment, _ in rows])
        series = np.array([(message.y_lower, message.y_point, message.y_upper) for _, message in rows])
        for i, output in enumerate(self._names.outputs_of_filter(peer)):
            columns = band_columns(series[:, 0, i], series[:, 1, i], series[:, 2, i])
            self._stream.send_columns(output.predicted(peer), times, columns)

    def _style(self, colors: dict[str, Color]) -> None:
        for output in self._names.outputs:
            points = rr.SeriesPoints(colors=[OTHER], markers=["circle"], marker_sizes=[2.5], names=["measured"])
            self._stream.log(output.measured(), points, static=True)
        for peer in self._names.configuration.filters:
            for output in self._names.outputs_of_filter(peer):
                band = band_style(peer, colors[peer])
                self._stream.log(output.predicted(peer), band, static=True)
