"""What a filter said over a record of data."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, LsuMeshError, UnboundedSupport
from lsu_mesh.filters.filter import Filter, Guarantee, OutputPrediction


class Tables(NamedTuple):
    """What a filter said at each of T steps; row k is step k + 1.

    points, lower, upper (T, n): point estimate and interval hull of the posterior; volumes (T,): ``filter.volume()``;
    y_lower, y_upper, y_points (T, m): output prediction before the data.
    """

    points: Matrix
    lower: Matrix
    upper: Matrix
    volumes: Vector
    y_lower: Matrix
    y_upper: Matrix
    y_points: Matrix


class FilterRun(Tables):
    """What a filter said at each of T steps, see :class:`Tables`, and what the sets are worth."""

    guarantee: Guarantee = "declared"
    """As of the filter, or ``"none"`` where data were taken at other moments than their own."""


def blank_run(rows: int, n: int, m: int, guarantee: Guarantee) -> FilterRun:
    """A run of so many rows, to be filled."""
    run = FilterRun(
        points=np.empty((rows, n)), lower=np.empty((rows, n)), upper=np.empty((rows, n)), volumes=np.empty(rows),
        y_lower=np.empty((rows, m)), y_upper=np.empty((rows, m)), y_points=np.empty((rows, m)),
    )  # fmt: skip
    run.guarantee = guarantee
    return run


def store_output(run: FilterRun, row: int, predicted: OutputPrediction) -> None:
    """Store the output prediction of a row."""
    run.y_lower[row], run.y_upper[row], run.y_points[row] = predicted


def store_set(run: FilterRun, row: int, filter: Filter) -> None:
    """Store the posterior of a row."""
    run.points[row], run.volumes[row] = filter.point, filter.volume()
    run.lower[row], run.upper[row] = filter.bounds()


def named_row(row: int, error: LsuMeshError) -> LsuMeshError:
    """The same error, with the row in front."""
    message = f"row {row} (step {row + 1}): {error}"
    if isinstance(error, InconsistentData):
        return InconsistentData(message, error.rows, error.gap)
    return UnboundedSupport(message) if isinstance(error, UnboundedSupport) else type(error)(message)
