"""Files of data that a mesh plays: their columns, and what becomes of every row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from lsu_mesh.mesh.config.problem import DataProblem, data_problem
from lsu_mesh.mesh.data_files import DataFileError, look, read
from lsu_mesh.mesh.data_files.account import Account, account
from lsu_mesh.mesh.data_files.unplayable import nearest_doubt, off_grid_error

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


def read_columns(settings: MeasurementFileSettings, default_count: int) -> Columns:
    """The columns of a file, from its header alone; the rows are not read.

    Without named columns all but the index column are taken, if they are ``default_count``.
    Raises :class:`FileProblems`.
    """
    return Columns(look(settings, default_count))


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
