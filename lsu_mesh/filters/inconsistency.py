"""The error that says which measurement contradicts a filter's set, and by how much."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData
from lsu_mesh.kernels.runtime.rounding import EPSILON

LAST_BITS = 4.0
"""Units in the last place: one of the datum, one of its half-width, one of each side of the set."""


def strip_contradiction(names: Sequence[str], low: Vector, high: Vector, y: Vector, r: Vector) -> InconsistentData:
    """The contradiction of strips ``|y − C x| ≤ r`` with a set whose image is ``low ≤ C x ≤ high``; each (m,).

    ``rows`` are the strips that miss the set alone, ``gap`` the distance of the first; where none does, all strips of
    this step take part, and the gap is 0.
    """
    gaps = np.fmax(low - (y + r), (y - r) - high)
    alone = [int(i) for i in np.flatnonzero(gaps > 0)]
    if alone:
        listed = ", ".join(f"{names[i]} (by {gaps[i]:.3g})" for i in alone)
        return InconsistentData(f"outside its predicted interval: {listed}", alone, float(gaps[alone[0]]))
    rows = [int(i) for i in np.flatnonzero(~np.isnan(y))]
    listed = ", ".join(names[i] for i in rows)
    return InconsistentData(f"the strips of {listed} and the prediction have no point in common", rows, 0.0)


def known_to_last_bits(C: Matrix, y: Vector, r: Vector, bounds: tuple[Vector, Vector]) -> Vector:
    """r (m,) of strips ``|y − C x| ≤ r`` whose decimals, and those of the set, are known to their last bits only.

    Data that were simulated in floating point, or written as decimals, can leave declared corners by an ulp: that is
    no contradiction. The share is of all numbers that meet in a row, so that it grows with their size alone.
    """
    reach = np.abs(C) @ np.maximum(np.abs(bounds[0]), np.abs(bounds[1]))
    return np.asarray(r + LAST_BITS * EPSILON * (np.abs(y) + r + reach))
