"""What a filter node does when data contradict its set: leave strips out, or widen the bounds. Never a silent clip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.filters.filter import Filter, OutputPrediction

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

    def gap(self, row: int, y: Vector) -> float:
        """How far a measured value lies outside the band."""
        return float(max(self.band.lower[row] - y[row], y[row] - self.band.upper[row]))


def update_without_contradicting_strips(engine: Filter, y: Vector) -> Dropped:
    """Update with what is left of y (m,) after the strips that alone contradict the prediction were dropped.

    If none does alone, or the rest is contradictory too, all of the step is dropped.
    """
    band = engine.predict_output()
    outside = (y < band.lower) | (y > band.upper)
    alone = tuple(np.flatnonzero(outside).tolist())
    kept = np.where(outside, np.nan, y)
    together: tuple[int, ...] = ()
    rest = tuple(np.flatnonzero(~np.isnan(kept)).tolist())
    if not alone:
        together = rest
    elif rest:
        try:
            engine.update(kept)
        except InconsistentData:
            together = rest
    return Dropped(alone, together, band)


def widen(engine: Filter, y: Vector) -> float | None:
    """Update with r widened by the smallest factor, to 1 %, that explains y; None where no factor does (r = 0)."""
    r = engine.model.r
    low, high = 1.0, 2.0
    while not explains(engine, y, high * r):
        low, high = high, 2.0 * high
        if high > WIDEST:
            return None
    while high - low > PRECISION * low:
        middle = 0.5 * (low + high)
        if explains(engine, y, middle * r):
            high = middle
        else:
            low = middle
    engine.update(y, high * r)
    return high


def explains(engine: Filter, y: Vector, r: Vector | None = None) -> bool:
    """Whether the data y (m,) with half-widths r are not proved to miss the engine's set; it stays as it is."""
    before = engine.snapshot()
    try:
        engine.update(y, r)
    except InconsistentData:
        return False
    engine.restore(before)
    return True
