"""Sets in three coordinates: translucent bodies with edges, the true state among them, seen from a frame that follows.

Bodies are thinned, numbers never are: once per ``1 / recorder.mesh_hz`` a step is chosen by the arrival of its first
set, and all sets of that step, and its truth, are drawn. Where drawing takes more than its share of the time, it is
done less often.
"""

from __future__ import annotations

import time
from collections import defaultdict
from typing import NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from lsu_mesh.mesh.messages import Posterior, SupportMessage, Truth
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from services.recording import frame
from services.recording.body import Body, body, project, rectangle
from services.recording.names import Names, path
from services.recording.palette import TRUTH, Color
from services.recording.timeline import Moment, Timelines

REMEMBERED = 256
"""Chosen steps, and truths, that are kept for sets and truths that come late."""
SHARE = 0.15
"""Largest share of the wall clock that may go into bodies."""

Array = NDArray[np.float64]


class _Set(NamedTuple):
    moment: Moment
    peer: str
    message: SupportMessage
    lower: Array
    upper: Array


class _Drawn(NamedTuple):
    moment: Moment
    body: Body


class Space:
    """Chooses the steps to draw, makes the bodies and sends them in batches."""

    def __init__(
        self, stream: rr.RecordingStream, timelines: Timelines, names: Names, colors: dict[str, Color]
    ) -> None:
        self._stream = stream
        self._timelines = timelines
        self._axes = names.axes()
        self._lanes = {peer: frame.LANE * (i + 1) for i, peer in enumerate(reversed(names.estimators))}
        self._interval_ns = self._pause_ns = int(1e9 / names.configuration.recorder.mesh_hz)
        self._next_ns = 0
        self._newest = -1
        self._chosen: dict[int, Moment] = {}
        self._truths: dict[int, list[float]] = {}
        self._waiting: list[_Set] = []
        self._points: list[tuple[Moment, list[float]]] = []
        self._frames = {name: frame.Frame(stream, timelines, names, name) for name in (frame.ALL, *names.estimators)}
        self._half_widths: dict[str, Array] = {}
        self._fusions = set(names.configuration.fusion)
        self._style(colors)
        body(
            ConstrainedZonotope(np.zeros(3), np.eye(3), np.ones((1, 3)), np.zeros(1))
        )  # loads the solvers now, not at the first set of the run

    def add(self, message: Posterior, arrival_ns: int) -> None:
        """A set, drawn at the next flush if its step is chosen."""
        step = message.step
        if step > self._newest and arrival_ns >= self._next_ns:
            self._choose(step, arrival_ns)
        if step in self._chosen:
            axes = list(self._axes)
            lower, upper = np.array(message.lower)[axes], np.array(message.upper)[axes]
            self._waiting.append(_Set(Moment(step, arrival_ns), message.name, message.support, lower, upper))

    def add_truth(self, message: Truth, arrival_ns: int) -> None:
        """The true state, drawn where its step is or will be chosen."""
        self._truths[message.step] = message.x
        if len(self._truths) > REMEMBERED:
            del self._truths[next(iter(self._truths))]
        if message.step in self._chosen:
            self._points.append((Moment(message.step, arrival_ns), message.x))

    def flush(self) -> None:
        """Make and send all bodies that wait."""
        waiting, self._waiting = self._waiting, []
        points, self._points = self._points, []
        began = time.perf_counter_ns()
        drawn: defaultdict[str, list[_Drawn]] = defaultdict(list)
        for one in waiting:
            shape = self._body(one)
            drawn[one.peer].append(_Drawn(one.moment, shape))
            self._look(one, shape)
        for view in self._frames.values():
            view.flush()
        for peer, bodies in drawn.items():
            self._send(peer, bodies)
        if points:
            self._send_points(points)
        if waiting:
            steps = len({one.moment.step for one in waiting})
            self._pause_ns = max(self._interval_ns, int((time.perf_counter_ns() - began) / steps / SHARE))

    def _choose(self, step: int, arrival_ns: int) -> None:
        self._newest = step
        self._chosen[step] = Moment(step, arrival_ns)
        if len(self._chosen) > REMEMBERED:
            del self._chosen[next(iter(self._chosen))]
        self._next_ns = max(self._next_ns, arrival_ns - self._pause_ns) + self._pause_ns
        if step in self._truths:
            self._points.append((Moment(step, arrival_ns), self._truths[step]))

    def _look(self, one: _Set, shape: Body) -> None:
        """Let the frames follow: each peer's own, and the common one, which follows the fusion where there is one."""
        if not len(shape.edges):
            return
        corners = shape.edges.reshape(-1, 3)[:, : len(self._axes)]
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        center, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        if one.peer in self._frames:
            self._frames[one.peer].look_at(one.moment, center, half)
        self._half_widths[one.peer] = half
        if one.peer in self._fusions or not self._fusions:
            widths = np.array(list(self._half_widths.values()))
            seen = np.minimum(widths.max(axis=0), frame.LARGEST_RATIO * widths.min(axis=0))
            self._frames[frame.ALL].look_at(one.moment, center, np.maximum(seen, half))

    def _body(self, one: _Set) -> Body:
        if len(self._axes) == 1:
            return rectangle(float(one.lower[0]), float(one.upper[0]), self._lanes.get(one.peer, 0.0), 0.4 * frame.LANE)
        return body(project(one.message, self._axes))

    def _send(self, peer: str, drawn: list[_Drawn]) -> None:
        times = self._timelines.columns([one.moment for one in drawn])
        corners = [3 * len(one.body.triangles) for one in drawn]
        positions = np.concatenate([one.body.triangles.reshape(-1, 3) for one in drawn])
        normals = np.concatenate([np.repeat(one.body.normals, 3, axis=0) for one in drawn])
        mesh = rr.Mesh3D.columns(vertex_positions=positions, vertex_normals=normals)
        self._stream.send_columns(path("space", "sets", peer), times, mesh.partition(corners))
        strips = np.concatenate([one.body.edges for one in drawn])
        lines = rr.LineStrips3D.columns(strips=strips).partition([len(one.body.edges) for one in drawn])
        self._stream.send_columns(path("space", "sets", peer, "edges"), times, lines)

    def _send_points(self, points: list[tuple[Moment, list[float]]]) -> None:
        heights = list(self._lanes.values()) if len(self._axes) == 1 else [0.0]
        places = np.zeros((len(points), len(heights), 3))
        places[:, :, : len(self._axes)] = np.array([x for _, x in points])[:, None, list(self._axes)]
        if len(self._axes) == 1:
            places[:, :, 1] = heights
        times = self._timelines.columns([moment for moment, _ in points])
        columns = rr.Points3D.columns(positions=places.reshape(-1, 3)).partition([len(heights)] * len(points))
        self._stream.send_columns(path("space", "truth"), times, columns)

    def _style(self, colors: dict[str, Color]) -> None:
        truth = rr.Points3D.from_fields(colors=[TRUTH], radii=rr.Radius.ui_points(6.0))
        self._stream.log(path("space", "truth"), truth, static=True)
        for peer, color in colors.items():
            mesh = rr.Mesh3D.from_fields(albedo_factor=(*color, 90 if peer in self._fusions else 25))
            self._stream.log(path("space", "sets", peer), mesh, static=True)
            edges = rr.LineStrips3D.from_fields(colors=[color], radii=rr.Radius.ui_points(1.2))
            self._stream.log(path("space", "sets", peer, "edges"), edges, static=True)
