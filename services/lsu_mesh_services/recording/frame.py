"""Places and scales at which the views of sets look: views follow the sets, and every axis has a readable unit.

A view whose origin is a frame shows ``(x − center) / scale``. The data themselves stay in their own units.
"""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from lsu_mesh.array_types import Array
from lsu_mesh_services.recording.entity_paths import EntityPaths, path
from lsu_mesh_services.recording.palette import OTHER
from lsu_mesh_services.recording.timeline import Moment, Stream, Timelines, one_row

ALL = "all peers"
"""The frame of views that show several peers; no peer can have this name."""
LANE = 0.3
"""Height of the lane of a peer where there is only one state and sets are bars."""
UNIFORM = 5.0
"""Axes whose scales differ by no more than this factor share one scale, so that angles are true."""
READABLE = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
MAX_RATIO = 4.0
"""A set wider than this many times the narrowest does not widen the common frame."""


def entity(name: str) -> str:
    """Entity of the frame of a peer, or of ``ALL``."""
    return path("space", "frames", name)


class Frame:
    """One frame: its centre and scale (3,) each, changed in readable jumps only."""

    def __init__(self, stream: Stream, timelines: Timelines, names: EntityPaths, name: str) -> None:
        self._stream = stream
        self._timelines = timelines
        self._entity = entity(name)
        self._axes = names.axes()
        self._labels = [names.states[axis] for axis in self._axes]
        self._units = [names.configuration.base_model.units[axis] for axis in self._axes]
        self.scale: Array | None = None
        """What is shown as one unit, per axis."""
        self._rows: dict[int, tuple[Moment, Array, Array]] = {}
        self._axes_rows: list[tuple[Moment, Array]] = []

    def look_at(self, moment: Moment, center: Array, half_widths: Array) -> None:
        """Centre (d,) and half-widths (d,) of what is to be seen at a step."""
        scale = self.scale
        if scale is None or not _fits(half_widths, scale):
            scale = self.scale = readable_scale(half_widths)
            self._axes_rows.append((moment, scale))
        self._rows[moment.step] = (moment, center, scale)

    def flush(self) -> None:
        """Send all places that wait."""
        rows, self._rows = list(self._rows.values()), {}
        axes_rows, self._axes_rows = self._axes_rows, []
        if rows:
            times = self._timelines.columns([moment for moment, _, _ in rows])
            centers = np.array([_padded(center, 0.0) for _, center, _ in rows])
            scales = np.array([_padded(scale, 1.0) for _, _, scale in rows])
            columns = rr.Transform3D.columns(translation=centers, scale=scales)
            self._stream.send_columns(self._entity, times, columns)
        for moment, scale in axes_rows:
            self._stream.send_columns(f"{self._entity}/axes", self._timelines.columns([moment]), self._arrows(scale))

    def _arrows(self, scale: Array) -> list[rr.ComponentColumn]:
        d = len(self._axes)
        corner = np.array([-1.0] * d + [0.0] * (3 - d)) if d > 1 else np.array([-1.0, 0.0, 0.0])
        labels = [
            f"{label}: {size:g} {unit}".rstrip()
            for label, size, unit in zip(self._labels, scale, self._units, strict=True)
        ]
        arrows = rr.Arrows3D(
            origins=np.tile(corner, (d, 1)),
            vectors=np.eye(3)[:d],
            labels=labels,
            colors=[OTHER] * d,
            radii=rr.Radius.ui_points(1.5),
            show_labels=True,
        )
        return one_row(arrows)


def readable_scale(half_widths: Array) -> Array:
    """Scale per axis: the next readable number above the half-width; one for all where they hardly differ."""
    largest = float(half_widths.max())
    filled = np.where(half_widths > 0, half_widths, largest if largest > 0 else 1.0)
    scale = np.array([_readable(width) for width in filled])
    return np.full_like(scale, scale.max()) if scale.max() <= UNIFORM * scale.min() else scale


def _readable(width: float) -> float:
    decade = 10.0 ** math.floor(math.log10(width))
    return next((step * decade for step in READABLE if width <= step * decade), 10.0 * decade)


def _fits(half_widths: Array, scale: Array) -> bool:
    """Whether what is shown fills the view: on every axis, or on the largest where all share one scale."""
    shares = half_widths / scale
    is_shared = bool((scale == scale[0]).all())
    extended = shares[shares > 0]
    smallest = 0.5 / UNIFORM if is_shared else 0.3
    return bool(0.5 <= shares.max() <= 1.1 and extended.min() >= smallest)


def _padded(values: Array, filling: float) -> Array:
    return np.concatenate([values, np.full(3 - len(values), filling)])
