"""Sets in three coordinates: translucent bodies with edges, the true state among them, seen from a frame that follows.

Bodies are thinned: once per ``1 / recorder.mesh_hz`` a step is chosen by the arrival of its first
set, and all sets of that step, and its truth, are drawn. Where drawing takes more than its share of the time, it is
done less often.
"""

from __future__ import annotations

import time
from collections import defaultdict
from typing import NamedTuple

import numpy as np
import rerun as rr

from lsu_mesh.array_types import Array
from lsu_mesh.mesh.messages import Posterior, SupportMessage, Truth
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh_services.recording import frame
from lsu_mesh_services.recording.entity_paths import EntityPaths, path
from lsu_mesh_services.recording.palette import TRUTH, Color
from lsu_mesh_services.recording.set_geometry import EMPTY, SetGeometry, body, project, rectangle
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines

MAX_PAUSE_NS = 2_000_000_000
"""Bodies that are drawn at least, however slow they are."""
GRACE_NS = 1_000_000_000
"""How long a chosen step waits for its last set, so that all sets that are shown together belong to one step."""
REMEMBERED = 256
"""Chosen steps, and truths, that are kept for sets and truths that come late."""
SHARE = 0.15
"""Largest share of the wall clock that may go into bodies."""

CROSS = 1.1
"""Length of the lines through the truth, in units of the view."""
IN_FRONT = 0.03
"""How far in front of flat sets the truth is drawn."""
FLAT = rr.components.PointShading.Flat


class _Set(NamedTuple):
    moment: Moment
    peer: str
    message: SupportMessage
    lower: float
    upper: float


class _Drawn(NamedTuple):
    moment: Moment
    body: SetGeometry


class _Truth(NamedTuple):
    moment: Moment
    place: Array
    reach: Array
    """How far the cross through it goes, per coordinate."""


class Sets3D:
    """Chooses the steps to draw, makes the bodies and sends them in batches."""

    def __init__(self, stream: Stream, timelines: Timelines, names: EntityPaths, colors: dict[str, Color]) -> None:
        self._stream = stream
        self._timelines = timelines
        self._axes = names.axes()
        self._lanes = {peer: frame.LANE * (i + 1) for i, peer in enumerate(reversed(names.estimators))}
        self._interval_ns = self._pause_ns = int(1e9 / names.configuration.recorder.mesh_hz)
        self._next_ns = 0
        self._newest = -1
        self._chosen: dict[int, Moment] = {}
        self._truths: dict[int, list[float]] = {}
        self._waiting: dict[int, list[_Set]] = {}
        self._newest_ns = 0
        self._drawn_steps: dict[int, None] = {}
        self._failed: Exception | None = None
        self._shown: set[str] = set()
        self._estimators = set(names.estimators)
        self._points: list[_Truth] = []
        self._bodies: defaultdict[str, list[_Drawn]] = defaultdict(list)
        self._frames = {name: frame.Frame(stream, timelines, names, name) for name in (frame.ALL, *names.estimators)}
        self._extents: dict[str, tuple[Array, Array]] = {}
        """Of every peer's last body, (lower, upper)."""
        self._fusions = set(names.configuration.fusion)
        self._style(colors)
        _load_solvers()

    def add(self, message: Posterior, arrival_ns: int) -> None:
        """A set, drawn at the next flush if its step is chosen."""
        step = message.step
        self._newest_ns = max(self._newest_ns, arrival_ns)
        if step > self._newest and arrival_ns >= self._next_ns:
            self._choose(step, arrival_ns)
        if step in self._chosen:
            first = self._axes[0]
            interval = message.lower[first], message.upper[first]
            one = _Set(Moment(step, arrival_ns), message.name, message.support, *interval)
            self._waiting.setdefault(step, []).append(one)

    def add_truth(self, message: Truth, arrival_ns: int) -> None:
        """The true state, drawn where its step is or will be chosen."""
        self._truths[message.step] = message.x
        if len(self._truths) > REMEMBERED:
            del self._truths[next(iter(self._truths))]
        if message.step in self._drawn_steps:
            self._record_truth(Moment(message.step, arrival_ns), message.x)

    def flush(self) -> None:
        """Make the bodies that are due, and send all that wait."""
        self.draw()
        self._send_all()

    def draw(self) -> None:
        """Make the bodies of the steps whose sets are all there or have waited long enough; they wait to be sent."""
        ready = [step for step, sets in self._waiting.items() if self._is_complete(sets) or self._has_waited(sets)]
        self._draw(ready)

    def finish(self) -> None:
        """Send the rest; a last step that lacks sets is left out, it would stand beside sets of an earlier step."""
        self.flush()
        if not self._drawn_steps:
            self._draw(list(self._waiting))
            self._send_all()

    def _draw(self, steps: list[int]) -> None:
        began = time.perf_counter_ns()
        for step in sorted(steps):
            self._draw_step(step, self._waiting.pop(step), self._bodies)
        failed, self._failed = self._failed, None
        if steps:
            spent = (time.perf_counter_ns() - began) / len(steps)
            self._pause_ns = min(max(self._interval_ns, int(spent / SHARE)), MAX_PAUSE_NS)
        if failed is not None:
            raise failed

    def _send_all(self) -> None:
        bodies, self._bodies = self._bodies, defaultdict(list)
        for view in self._frames.values():
            view.flush()
        for peer, drawn in bodies.items():
            self._send(peer, drawn)
        self._send_points()

    def _draw_step(self, step: int, sets: list[_Set], drawn: defaultdict[str, list[_Drawn]]) -> None:
        for one in sorted(sets, key=lambda one: one.peer in self._fusions):  # the common frame sees fusions last
            try:
                shape = self._body(one)
            except Exception as error:  # the other sets are drawn; the error is raised when they are
                self._failed = error
                shape = EMPTY
            drawn[one.peer].append(_Drawn(one.moment, shape))
            self._look(one, shape)
            self._shown.add(one.peer)
        if step not in self._drawn_steps:
            self._drawn_steps[step] = None
            if step in self._truths:
                self._record_truth(sets[0].moment, self._truths[step])
            for peer in self._shown - {one.peer for one in sets}:  # whoever is silent must not show an old set
                drawn[peer].append(_Drawn(sets[0].moment, EMPTY))
                self._shown.discard(peer)
        if len(self._drawn_steps) > REMEMBERED:
            del self._drawn_steps[next(iter(self._drawn_steps))]

    def _is_complete(self, sets: list[_Set]) -> bool:
        return self._estimators <= {one.peer for one in sets}

    def _has_waited(self, sets: list[_Set]) -> bool:
        return self._newest_ns - sets[0].moment.wall_ns > GRACE_NS or sets[0].moment.step in self._drawn_steps

    def _choose(self, step: int, arrival_ns: int) -> None:
        self._newest = step
        self._chosen[step] = Moment(step, arrival_ns)
        if len(self._chosen) > REMEMBERED:
            del self._chosen[next(iter(self._chosen))]
        due = self._next_ns + self._pause_ns
        self._next_ns = due if due > arrival_ns else arrival_ns + self._pause_ns

    def _look(self, one: _Set, shape: SetGeometry) -> None:
        """Let the frames follow: each peer's own, and the common one, which follows the fusion where there is one."""
        if not len(shape.edges):
            return
        corners = shape.edges.reshape(-1, 3)[:, : len(self._axes)]
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        center, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        if one.peer in self._frames:
            self._frames[one.peer].look_at(one.moment, center, half)
        self._extents[one.peer] = lower, upper
        if one.peer in self._fusions or not self._fusions:
            extents = np.array(list(self._extents.values()))
            reach = np.maximum(extents[:, 1] - center, center - extents[:, 0]).max(axis=0)
            widths = 0.5 * (extents[:, 1] - extents[:, 0])
            seen = np.minimum(reach, frame.MAX_RATIO * widths.min(axis=0))
            self._frames[frame.ALL].look_at(one.moment, center, np.maximum(seen, half))

    def _body(self, one: _Set) -> SetGeometry:
        if len(self._axes) == 1:
            return rectangle(one.lower, one.upper, self._lanes.get(one.peer, 0.0), 0.4 * frame.LANE)
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

    def _record_truth(self, moment: Moment, x: list[float]) -> None:
        """The true state, and how far its cross must go to be seen outside of the sets that hold it."""
        place, reach = np.zeros(3), np.zeros(3)
        place[: len(self._axes)] = np.array(x)[list(self._axes)]
        if len(self._axes) < 3:
            place[2] = IN_FRONT
        scale = self._frames[frame.ALL].scale
        if scale is not None and len(self._axes) == 3:
            reach[:] = CROSS * scale
        self._points.append(_Truth(moment, place, reach))

    def _send_points(self) -> None:
        points, self._points = self._points, []
        if not points:
            return
        heights = list(self._lanes.values()) if len(self._axes) == 1 else [0.0]
        places = np.repeat(np.array([point.place for point in points])[:, None, :], len(heights), axis=1)
        places[:, :, 1] += heights
        times = self._timelines.columns([point.moment for point in points])
        columns = rr.Points3D.columns(positions=places.reshape(-1, 3)).partition([len(heights)] * len(points))
        self._stream.send_columns(path("space", "truth"), times, columns)
        if len(self._axes) == 3:
            arms = np.concatenate([_cross(point) for point in points])
            lines = rr.LineStrips3D.columns(strips=arms).partition([3] * len(points))
            self._stream.send_columns(path("space", "truth", "cross"), times, lines)

    def _style(self, colors: dict[str, Color]) -> None:
        truth = rr.Points3D.from_fields(colors=[TRUTH], radii=rr.Radius.ui_points(6.0), point_shading=FLAT)
        self._stream.log(path("space", "truth"), truth, static=True)
        cross = rr.LineStrips3D.from_fields(colors=[TRUTH], radii=rr.Radius.ui_points(0.6))
        self._stream.log(path("space", "truth", "cross"), cross, static=True)
        for peer, color in colors.items():
            mesh = rr.Mesh3D.from_fields(albedo_factor=(*color, 50 if peer in self._fusions else 25))
            self._stream.log(path("space", "sets", peer), mesh, static=True)
            width = 1.2 if peer in self._fusions or not self._fusions else 0.9
            edges = rr.LineStrips3D.from_fields(colors=[color], radii=rr.Radius.ui_points(width))
            self._stream.log(path("space", "sets", peer, "edges"), edges, static=True)


def _cross(point: _Truth) -> Array:
    """Three lines through the truth, along the axes: (3, 2, 3)."""
    arms = np.diag(point.reach)
    return np.stack([point.place - arms, point.place + arms], axis=1)


def _load_solvers() -> None:
    """Load everything that a body needs now, not at the first set of the run."""
    generators = np.hstack([np.eye(3), np.ones((3, 1))])
    body(ConstrainedZonotope(np.zeros(3), generators, np.ones((1, 4)), np.zeros(1)))
