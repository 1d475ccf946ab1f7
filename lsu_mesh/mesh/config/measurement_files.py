"""Recorded measurements and inputs by step, from files of data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.mesh.config.problem import DataProblem, data_problem
from lsu_mesh.mesh.data_files import DataFileError, look, read
from lsu_mesh.mesh.data_files.account import Account, account, place
from lsu_mesh.mesh.data_files.moments import exact_dt, start_time_ns
from lsu_mesh.mesh.data_files.unplayable import nearest_doubt, off_grid_error
from lsu_mesh.mesh.grid import Grid

if TYPE_CHECKING:
    from lsu_mesh.mesh.config.settings import Configuration, MeasurementFileSettings, SensorSettings

FileProblems = DataFileError
"""A measurement file is wrong; ``lines`` say file, line, column, value and remedy."""


class PlayedFileError(DataFileError):
    """Files that a mesh plays are wrong; ``records`` hold the mistakes, ``lines`` their lines for people."""

    def __init__(self, records: Sequence[DataProblem]) -> None:
        super().__init__([str(record) for record in records])
        self.records = tuple(records)


@dataclass(frozen=True)
class Columns:
    """The value columns of a file."""

    columns: tuple[str, ...]


@dataclass(frozen=True)
class Playback:
    """Values by step: ``values[k]`` belongs to ``steps[k]``, ascending.

    ``collisions`` rows shared a step with an earlier row and were left out.
    """

    steps: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    values: NDArray[np.float64]
    collisions: int


def read_columns(settings: MeasurementFileSettings, default_count: int) -> Columns:
    """The columns of a file, from its header alone; the rows are not read.

    Without named columns all but the index column are taken, if they are ``default_count``.
    Raises :class:`FileProblems`.
    """
    return Columns(look(settings, default_count))


def read_playback(settings: MeasurementFileSettings, dt: object, start_time: object) -> Playback:
    """The file's values by step; a row with a time is put on the step whose t_k is nearest.

    The first row of a step counts.
    Rows before step 1 are left out. Raises :class:`FileProblems`.
    """
    data = read(settings)
    placed = place(data, grid_of(dt, start_time))
    order = np.flatnonzero(placed.is_delivered)
    order = order[np.argsort(placed.steps[order], kind="stable")]
    times = np.zeros(len(placed.steps), dtype=np.int64) if data.time_ns is None else np.maximum(data.time_ns, 0)
    return Playback(placed.steps[order], times[order], data.values[order], int(placed.is_sharing.sum()))


def grid_of(dt: object, start_time: object) -> Grid:
    """The grid of a mesh; without a start it begins at 0."""
    return Grid(0 if start_time is None else start_time_ns(start_time)[0], exact_dt(dt))


def accounts(configuration: Configuration) -> dict[str, Account]:
    """What becomes of every row of every file that is played, by the table that names it.

    Raises :class:`PlayedFileError` with the mistakes of all files that are wrong, of which nothing can be played, or
    that hold rows which the model cannot use.
    """
    found: dict[str, Account] = {}
    problems: list[DataProblem] = []
    for table, settings, timing in _played(configuration):
        try:
            found[table] = one = _account(configuration, settings, timing)
        except DataFileError as error:
            problems += [data_problem(table, settings.path, line) for line in error.lines]
            continue
        if one.error is not None:
            problems.append(data_problem(table, settings.path, f"{settings.path}: {one.error}"))
    if problems:
        raise PlayedFileError(problems)
    return found


def _played(
    configuration: Configuration,
) -> Iterator[tuple[str, MeasurementFileSettings, SensorSettings | None]]:
    for name, sensor in configuration.sensors.items():
        if sensor.file is not None:
            yield f"sensors.{name}", sensor.file, sensor
    plant = configuration.plant
    if plant is not None and plant.file is not None:
        yield "plant", plant.file, None


def _account(configuration: Configuration, file: MeasurementFileSettings, sensor: SensorSettings | None) -> Account:
    """Every row at its own moment; a discrete model takes rows on the grid, or as the sensor says."""
    data, grid, last = read(file), configuration.grid, configuration.mesh.steps
    if configuration.continuous is not None:
        return account(data, grid, last, nearest=False, tolerance_ns=0)
    tolerance = None if sensor is None else sensor.tolerance_ns
    is_nearest = sensor is not None and sensor.off_grid == "nearest"
    found = account(data, grid, last, nearest=is_nearest, shares=True, tolerance_ns=tolerance)
    if not found.off_grid or found.error is not None or (sensor is not None and sensor.rate):
        return found
    if is_nearest:
        return replace(found, doubts=(*found.doubts, nearest_doubt(found.off_grid, found.largest_distance_ns)))
    place = None if sensor is None else sensor.name
    text = off_grid_error(found.off_grid, found.rows, found.largest_distance_ns, place)
    return replace(found, error=text)
