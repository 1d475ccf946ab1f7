"""Truth, bands, errors, widths, volumes and latencies of posteriors and fused sets, at the steps that are drawn.

A set that misses the truth is always drawn.
"""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple, TypeVar

import numpy as np
import rerun as rr

from lsu_mesh.array_types import Array
from lsu_mesh.mesh.messages import Posterior, Smoothed, Truth
from lsu_mesh_services.recording.bands import (
    band_columns,
    band_style,
    darker,
    error_columns,
    error_style,
    line_style,
    smoothed_style,
)
from lsu_mesh_services.recording.entity_paths import EntityPaths, path
from lsu_mesh_services.recording.palette import TRUTH, Color
from lsu_mesh_services.recording.thinning import Thinning
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines

REMEMBERED = 4096
"""Steps for which a truth waits for sets and sets wait for the truth."""

Kept = TypeVar("Kept")


class _Row(NamedTuple):
    moment: Moment
    lower: list[float]
    point: list[float]
    upper: list[float]
    log_volume: float | None
    gain: float | None
    latency_ms: float


class _Waiting(NamedTuple):
    peer: str
    row: _Row
    is_drawn: bool


class _Error(NamedTuple):
    moment: Moment
    row: _Row
    truth: list[float]


class Estimates:
    """Collects estimates and truths, joins them by step, and sends them in batches."""

    def __init__(self, stream: Stream, timelines: Timelines, names: EntityPaths, colors: dict[str, Color]) -> None:
        self._stream = stream
        self._timelines = timelines
        self._names = names
        self._truths: dict[int, list[float]] = {}
        self._thinning = Thinning(names.configuration)
        self._untold: dict[int, list[_Waiting]] = {}
        self._truth_rows: list[tuple[Moment, list[float]]] = []
        self._rows: defaultdict[str, list[_Row]] = defaultdict(list)
        self._errors: defaultdict[str, list[_Error]] = defaultdict(list)
        self._smoothed: defaultdict[str, list[tuple[Moment, Smoothed]]] = defaultdict(list)
        self._style(colors)

    def add_truth(self, message: Truth, arrival_ns: int) -> None:
        """The true state of a step; sets of this step that came before it get their errors now."""
        moment = Moment(message.step, arrival_ns)
        if self._thinning.draws("truth", message.step):
            self._truth_rows.append((moment, message.x))
        _remember(self._truths, message.step, message.x)
        for peer, row, is_drawn in self._untold.pop(message.step, ()):
            if not is_drawn and _misses(row, message.x):
                self._rows[peer].append(row)
                is_drawn = True
            if is_drawn:
                self._errors[peer].append(_Error(row.moment, row, message.x))

    def add(self, message: Posterior, arrival_ns: int) -> None:
        """A posterior or a fused set."""
        moment = Moment(message.step, arrival_ns)
        latency = (arrival_ns - message.origin_ns) / 1e6
        row = _Row(
            moment=moment,
            lower=message.lower,
            point=message.point,
            upper=message.upper,
            log_volume=message.log_volume,
            gain=message.gain,
            latency_ms=latency,
        )
        truth = self._truths.get(message.step)
        is_drawn = self._thinning.draws(message.name, message.step) or (truth is not None and _misses(row, truth))
        if is_drawn:
            self._rows[message.name].append(row)
        if truth is None:
            waiting = self._untold.get(message.step)
            if waiting is None:
                _remember(self._untold, message.step, [_Waiting(message.name, row, is_drawn)])
            else:
                waiting.append(_Waiting(message.name, row, is_drawn))
        elif is_drawn:
            self._errors[message.name].append(_Error(moment, row, truth))

    def add_smoothed(self, message: Smoothed, arrival_ns: int) -> None:
        """A smoothed set, drawn at the step of its state."""
        if self._thinning.draws(f"smoothed {message.name}", message.step):
            self._smoothed[message.name].append((Moment(message.step, arrival_ns), message))

    def flush(self) -> None:
        """Send all rows that wait."""
        rows, self._rows = self._rows, defaultdict(list)
        errors, self._errors = self._errors, defaultdict(list)
        truths, self._truth_rows = self._truth_rows, []
        smoothed, self._smoothed = self._smoothed, defaultdict(list)
        if truths:
            self._send_truth(truths)
        for peer, of_peer in rows.items():
            self._send_rows(peer, of_peer)
        for peer, errors_of_peer in errors.items():
            self._send_errors(peer, errors_of_peer)
        for peer, smoothed_of_peer in smoothed.items():
            self._send_smoothed(peer, smoothed_of_peer)

    def _send_truth(self, rows: list[tuple[Moment, list[float]]]) -> None:
        times = self._timelines.columns([moment for moment, _ in rows])
        states = np.array([x for _, x in rows])
        for i, state in enumerate(self._names.states):
            self._stream.send_columns(path("truth", state), times, rr.Measurements.columns(values=states[:, i]))

    def _send_rows(self, peer: str, rows: list[_Row]) -> None:
        times = self._timelines.columns([row.moment for row in rows])
        series = _series(rows)
        for i, state in enumerate(self._names.states):
            columns = band_columns(series[:, 0, i], series[:, 1, i], series[:, 2, i])
            self._stream.send_columns(path("bands", state, peer), times, columns)
        widths = series[:, 2] - series[:, 0]
        self._stream.send_columns(path("widths", peer), times, rr.Scalars.columns(scalars=widths))
        latencies = np.array([row.latency_ms for row in rows])
        self._stream.send_columns(path("latency", peer), times, rr.Scalars.columns(scalars=latencies))
        self._send_known("log_volume", peer, [(row.moment, row.log_volume) for row in rows])
        self._send_known("gain", peer, [(row.moment, row.gain) for row in rows])

    def _send_smoothed(self, peer: str, rows: list[tuple[Moment, Smoothed]]) -> None:
        times = self._timelines.columns([moment for moment, _ in rows])
        lower, upper = np.array([one.lower for _, one in rows]), np.array([one.upper for _, one in rows])
        middle = lower + 0.5 * (upper - lower)
        for i, state in enumerate(self._names.states):
            columns = band_columns(lower[:, i], middle[:, i], upper[:, i])
            self._stream.send_columns(path("smoothed", state, peer), times, columns)

    def _send_known(self, what: str, peer: str, rows: list[tuple[Moment, float | None]]) -> None:
        known = [(moment, value) for moment, value in rows if value is not None]
        if known:
            values = np.array([value for _, value in known])
            times = self._timelines.columns([moment for moment, _ in known])
            self._stream.send_columns(path(what, peer), times, rr.Scalars.columns(scalars=values))

    def _send_errors(self, peer: str, errors: list[_Error]) -> None:
        times = self._timelines.columns([error.moment for error in errors])
        series = _series([error.row for error in errors]) - np.array([error.truth for error in errors])[:, None, :]
        for i, state in enumerate(self._names.states):
            columns = error_columns(series[:, 0, i], series[:, 1, i], series[:, 2, i])
            self._stream.send_columns(path("errors", state, peer), times, columns)

    def _style(self, colors: dict[str, Color]) -> None:
        for state in self._names.states:
            self._stream.log(path("truth", state), line_style("truth", TRUTH, 2.0), static=True)
            for peer, color in colors.items():
                self._stream.log(path("bands", state, peer), band_style(peer, color), static=True)
                self._stream.log(path("errors", state, peer), error_style(peer, color), static=True)
            for peer in self._names.smoothers:
                self._stream.log(path("smoothed", state, peer), smoothed_style(peer, colors[peer]), static=True)
        labels = [self._names.label(i) for i in range(len(self._names.states))]
        for peer, color in colors.items():
            shades = [_shade(color, i, len(labels)) for i in range(len(labels))]
            self._line(path("widths", peer), shades, [f"{peer} {label}" for label in labels])
            for what in ("log_volume", "gain", "latency"):
                self._line(path(what, peer), [color], [peer])

    def _line(self, entity: str, colors: list[Color], names: list[str]) -> None:
        self._stream.log(entity, rr.SeriesLines(colors=colors, widths=[1.5] * len(names), names=names), static=True)


def _misses(row: _Row, truth: list[float]) -> bool:
    return any(not low <= x <= high for low, x, high in zip(row.lower, truth, row.upper, strict=True))


def _series(rows: list[_Row]) -> Array:
    """(rows, 3, n): lower, point, upper."""
    return np.array([(row.lower, row.point, row.upper) for row in rows])


def _remember(memory: dict[int, Kept], step: int, value: Kept) -> None:
    memory[step] = value
    while len(memory) > REMEMBERED:
        del memory[next(iter(memory))]


def _shade(color: Color, i: int, count: int) -> Color:
    """Shades of one colour for several series of one peer: from the colour itself towards its dark."""
    return darker(color, 1.0 - 0.55 * (i / max(count - 1, 1)))
