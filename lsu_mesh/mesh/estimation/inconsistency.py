"""What a filter node does when data contradict its set: leave strips out, or widen the bounds. Never a silent clip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter, OutputPrediction
from lsu_mesh.filters.held_inputs import Input as Drive
from lsu_mesh.kernels.runtime.rounding import EPSILON

WIDEST = 1e9
PRECISION = 0.01


@dataclass(frozen=True)
class Dropped:
    """Rows of the step's data that were left out."""

    alone: tuple[int, ...]
    """Rows that contradict the prediction by themselves."""
    together: tuple[int, ...]
    """Rows that only together, or with others, contradict it."""
    band: OutputPrediction

    def strips(self, y: Vector, name: Callable[[int], tuple[str, str]]) -> list[DroppedStrip]:
        """What is told of them; ``name`` gives the sensor and the output of a row."""
        return [
            DroppedStrip(
                *name(row),
                y=float(y[row]),
                lower=float(self.band.lower[row]),
                upper=float(self.band.upper[row]),
                is_alone=row in self.alone,
            )
            for row in (*self.alone, *self.together)
        ]


@dataclass(frozen=True)
class DroppedStrip:
    """One measured value that was left out, with the band that it had to lie in."""

    sensor: str
    output: str
    y: float
    lower: float
    upper: float
    is_alone: bool
    """Whether it contradicts the set by itself."""
    time_ns: int | None = None
    """Its moment, where it has one of its own."""

    @property
    def gap(self) -> float:
        """How far the value lies outside the band."""
        return max(self.lower - self.y, self.y - self.upper)


def update_without_contradicting_strips(engine: Filter, y: Vector, r: Vector | None = None, u: Drive = None) -> Dropped:
    """Update with what is left of y (m,) after the strips that alone contradict the prediction were dropped.

    If none does alone, or the rest is contradictory too, all of the step is dropped. r (m,) and u as of the update.
    """
    # without u no value sees an input, and the band of an output that would is not asked for
    seen = np.zeros(engine.model.input_count) if u is None and engine.model.D is not None else u
    band = engine.predict_output() if seen is None else engine.predict_output(seen)
    band = widened(band, r, engine.model.r)
    outside = (y < band.lower) | (y > band.upper)
    alone = tuple(np.flatnonzero(outside).tolist())
    kept = np.where(outside, np.nan, y)
    together: tuple[int, ...] = ()
    rest = tuple(np.flatnonzero(~np.isnan(kept)).tolist())
    if not alone:
        together = rest
    elif rest:
        try:
            engine.update(kept, r) if u is None else engine.update(kept, r, u=u)
        except InconsistentData:
            together = rest
    return Dropped(alone, together, band)


def widened(band: OutputPrediction, r: Vector | None, usual: Vector) -> OutputPrediction:
    """A band of outputs with half-widths r in place of the usual ones, each (m,)."""
    if r is None:
        return band
    more = np.maximum(r - usual, 0.0) * (1.0 + 2.0 * EPSILON)
    lower = np.where(more > 0.0, np.nextafter(band.lower - more, -np.inf), band.lower)
    upper = np.where(more > 0.0, np.nextafter(band.upper + more, np.inf), band.upper)
    return OutputPrediction(lower, upper, band.point)


def widen(engine: Filter, update: Callable[[float], None]) -> float | None:
    """Update with r widened by the smallest factor, to 1 %, that explains the data; None where no factor does (r = 0).

    ``update(factor)`` does it, from the engine's set; ``InconsistentData`` where the data still contradict it.
    """
    low, high = 1.0, 2.0
    while not _explains(engine, update, high):
        low, high = high, 2.0 * high
        if high > WIDEST:
            return None
    while high - low > PRECISION * low:
        middle = 0.5 * (low + high)
        if _explains(engine, update, middle):
            high = middle
        else:
            low = middle
    update(high)
    return high


def _explains(engine: Filter, update: Callable[[float], None], factor: float) -> bool:
    """Whether so much wider strips are not proved to miss the engine's set; it stays as it is."""
    before = engine.snapshot()
    try:
        update(factor)
    except InconsistentData:
        return False
    finally:
        engine.restore(before)
    return True
