"""The rows of a sensor's file, each with the step and the time that its message says."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Integers, Vector
from lsu_mesh.mesh.config.settings import Configuration
from lsu_mesh.mesh.data_files import DataFile, read
from lsu_mesh.mesh.data_files.account import Placement, place
from lsu_mesh.mesh.measurement_time import goes_to_nearest


class PlayedRow(NamedTuple):
    """Outputs (m,), NaN = missing, measured at ``time_ns ± error_ns``."""

    time_ns: int
    error_ns: int
    y: Vector


class PlayedRows:
    """Every row of the steps 1 to the last one of the run, by step.

    A row on the grid is of t_k exactly: where the interval of its time holds t_k, or, for a discrete model, where it is
    within the sensor's tolerance. Any other row keeps its own time. ``time_error`` of the sensor is added to each.
    Raises :class:`lsu_mesh.mesh.data_files.DataFileError`.
    """

    def __init__(self, configuration: Configuration, name: str) -> None:
        settings = configuration.sensors[name]
        assert settings.file is not None
        grid, data = configuration.grid, read(settings.file, len(settings.C))
        tolerance = 0
        if configuration.continuous is None:
            given = settings.tolerance_ns
            tolerance = max(1, data.digit_ns // 2) if given is None else given
        last = configuration.mesh.steps
        placed = place(data, grid, last, nearest=goes_to_nearest(configuration, settings), tolerance_ns=tolerance)
        kept = np.flatnonzero(~placed.is_before & ~placed.is_after)
        steps = placed.steps[kept]
        self._values = data.values[kept]
        self._times, self._errors = _times(data, placed, tolerance, grid_times=grid.times_of(placed.steps))
        self._times, self._errors = self._times[kept], self._errors[kept] + settings.time_error_ns
        self.is_by_time = data.time_ns is not None
        self.before = int(placed.is_before.sum())
        """Rows before step 1, which are left out."""
        self.after = int(placed.is_after.sum())
        self.first = int(steps[0]) if len(steps) else 1
        self.last = int(steps[-1]) if len(steps) else 0
        found, begins, counts = np.unique(steps, return_index=True, return_counts=True)
        self._places = {int(k): slice(int(i), int(i + n)) for k, i, n in zip(found, begins, counts, strict=True)}
        self.most_per_step = int(counts.max(initial=1))

    def of(self, k: int) -> list[PlayedRow]:
        """The rows of step k, in the order of their times."""
        rows = self._places.get(k, slice(0))
        return [
            PlayedRow(int(time), int(error), y)
            for time, error, y in zip(self._times[rows], self._errors[rows], self._values[rows], strict=True)
        ]


def _times(data: DataFile, placed: Placement, tolerance: int, grid_times: Integers) -> tuple[Integers, Integers]:
    if data.time_ns is None:
        return grid_times, np.zeros(data.row_count, dtype=np.int64)
    on_grid = placed.distance_ns <= np.maximum(data.time_half_ns, tolerance)
    return np.where(on_grid, grid_times, data.time_ns), np.where(on_grid, 0, data.time_half_ns)
