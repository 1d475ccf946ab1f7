"""Recorded measurements and inputs by step, from files of data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.mesh.data_files import DataFileError, look, read
from lsu_mesh.mesh.data_files.account import Account, account, place
from lsu_mesh.mesh.data_files.moments import exact_dt, start_time_ns
from lsu_mesh.mesh.grid import Grid

if TYPE_CHECKING:
    from lsu_mesh.mesh.config.settings import Configuration, MeasurementFileSettings

FileProblems = DataFileError
"""A measurement file is wrong; ``lines`` say file, line, column, value and remedy."""


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

    Raises :class:`FileProblems` with the lines of all files that are wrong, or of which nothing can be played.
    """
    mesh = configuration.mesh
    files = {f"sensors.{name}": sensor.file for name, sensor in configuration.sensors.items()}
    files["plant"] = None if configuration.plant is None else configuration.plant.file
    grid, found, lines = grid_of(mesh.dt, mesh.start_time), {}, []
    for table, settings in files.items():
        if settings is None:
            continue
        try:
            found[table] = account(read(settings), grid, mesh.steps)
        except FileProblems as error:
            lines += error.lines
            continue
        if found[table].error is not None:
            lines.append(f"{settings.path}: {found[table].error}")
    if lines:
        raise FileProblems(lines)
    return found
