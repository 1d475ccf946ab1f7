"""A case of ``lsu-mesh bench mesh``: rate, number of filters, recorder or not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from lsu_mesh.errors import ModelError

MIN_RATE, MAX_RATE = 10.0, 1000.0
"""Steps a second."""
MAX_FILTERS = 12


class MeshCase(NamedTuple):
    """What is measured: steps a second, filters, whether a recorder listens to everything."""

    rate: float
    filters: int
    recorder: bool = False

    @property
    def words(self) -> str:
        """For people."""
        plural = "s" if self.filters > 1 else ""
        return f"{self.rate:g} Hz, {self.filters} filter{plural}{', recorder' if self.recorder else ''}"


GRID = (MeshCase(50.0, 4), MeshCase(200.0, 4), MeshCase(50.0, 12))
"""What is measured where nothing is asked for."""


def cases(rates: Sequence[float], filters: Sequence[int], *, recorder: bool) -> list[MeshCase]:
    """Every rate with every number of filters; the grid where neither is given.

    Raises
    ------
    ModelError
        For a rate or a number of filters outside of the limits.
    """
    for rate in rates:
        if not MIN_RATE <= rate <= MAX_RATE:
            raise ModelError(f"--rate {rate:g}: expected {MIN_RATE:g} to {MAX_RATE:g} Hz")
    for count in filters:
        if not 1 <= count <= MAX_FILTERS:
            raise ModelError(f"--filters {count}: expected 1 to {MAX_FILTERS} filters")
    if not rates and not filters:
        return [case._replace(recorder=recorder) for case in GRID]
    return [
        MeshCase(rate, count, recorder) for rate in rates or [GRID[0].rate] for count in filters or [GRID[0].filters]
    ]
