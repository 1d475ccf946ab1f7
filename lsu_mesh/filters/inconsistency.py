"""The error that says which measurement contradicts a filter's set, and by how much."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData


def strip_contradiction(names: Sequence[str], low: Vector, high: Vector, y: Vector, r: Vector) -> InconsistentData:
    """The contradiction of strips ``|y − C x| ≤ r`` with a set whose image is ``low ≤ C x ≤ high``; each (m,).

    ``rows`` are the strips that miss the set alone, ``gap`` the distance of the first; where none does, all strips of
    this step take part.
    """
    gaps = np.fmax(low - (y + r), (y - r) - high)
    alone = [int(i) for i in np.flatnonzero(gaps > 0)]
    if alone:
        listed = ", ".join(f"{names[i]} (by {gaps[i]:.3g})" for i in alone)
        return InconsistentData(f"outside its predicted interval: {listed}", alone, float(gaps[alone[0]]))
    rows = [int(i) for i in np.flatnonzero(~np.isnan(y))]
    listed = ", ".join(names[i] for i in rows)
    return InconsistentData(f"the strips of {listed} and the prediction have no point in common", rows)
