"""What a filter said over a record of data."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal, NamedTuple

import numpy as np

from lsu_mesh.array_types import Array, Matrix, Vector
from lsu_mesh.errors import InconsistentData, LsuMeshError, UnboundedSupport
from lsu_mesh.filters.filter import Filter, Guarantee, OutputPrediction

Status = Literal["ok", "missing", "held", "reset", "widened"]
"""What became of a row: its data are in the set; it had none; they contradict the set, which kept the prediction; the
set was started again from the domain; the row's r was widened until its data agree with the set."""


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


VOLUMES = Tables._fields.index("volumes")


class FilterRun(Tables):
    """What a filter said at each of T steps, see :class:`Tables`, what became of each row, and what the sets are worth.

    Volumes that cost much are computed when they are read for the first time, from the sets of the rows.
    """

    guarantee: Guarantee = "declared"
    """As of the filter; ``"none"`` where data were taken at other moments than their own, or their r was widened."""
    status: list[Status]
    """What became of each of the T rows, such as ``"ok"``, ``"missing"``, ``"held"``, ``"reset"``, ``"widened"``."""
    done: int
    """Rows that are filled."""
    sets: list[object]
    """Snapshots of the filter after each row, as long as the volumes are not computed."""
    filter: Filter | None
    has_points: bool = True
    """Whether points are computed; else they are NaN."""

    @property
    def volumes(self) -> Vector:
        """Volumes (T,) of the posteriors; NaN where the run was made without them."""
        self.complete()
        volumes: Vector = tuple.__getitem__(self, VOLUMES)
        return volumes

    def __iter__(self) -> Iterator[Array]:
        self.complete()
        return super().__iter__()

    def __getitem__(self, index: int) -> Array:  # type: ignore[override]
        self.complete()
        table: Array = tuple.__getitem__(self, index)
        return table

    def first(self, rows: int) -> FilterRun:
        """The run of the first rows only."""
        run = FilterRun(*(tuple.__getitem__(self, i)[:rows] for i in range(len(self))))
        run.guarantee, run.filter, run.done = self.guarantee, self.filter, rows
        run.status, run.sets = self.status[:rows], self.sets[:rows]
        return run

    def drop_points(self) -> None:
        """No points of states and outputs."""
        self.points[:], self.y_points[:] = np.nan, np.nan

    def complete(self) -> FilterRun:
        """This run with its volumes computed: each waiting set is seen through the filter that held it."""
        filter, sets = getattr(self, "filter", None), getattr(self, "sets", [])
        if filter is None or not sets:
            return self
        volumes: Vector = tuple.__getitem__(self, VOLUMES)
        now = filter.snapshot()
        try:
            for row, held in enumerate(sets):
                filter.restore(held)
                volumes[row] = filter.volume()
        finally:
            filter.restore(now)
        self.sets, self.filter = [], None
        return self


def blank_run(rows: int, n: int, m: int, guarantee: Guarantee) -> FilterRun:
    """A run of so many rows, to be filled."""
    run = FilterRun(
        points=np.full((rows, n), np.nan), lower=np.empty((rows, n)), upper=np.empty((rows, n)),
        volumes=np.full(rows, np.nan),
        y_lower=np.empty((rows, m)), y_upper=np.empty((rows, m)), y_points=np.full((rows, m), np.nan),
    )  # fmt: skip
    run.guarantee, run.status, run.done = guarantee, ["missing"] * rows, 0
    run.sets, run.filter = [], None
    return run


def store_output(run: FilterRun, row: int, predicted: OutputPrediction) -> None:
    """Store the output prediction of a row."""
    run.y_lower[row], run.y_upper[row] = predicted.lower, predicted.upper
    if run.has_points:
        run.y_points[row] = predicted.point


def store_set(run: FilterRun, row: int, filter: Filter) -> None:
    """Store the posterior of a row; its volume is computed later, where ``run.filter`` is set."""
    if run.has_points:
        run.points[row] = filter.point
    run.lower[row], run.upper[row] = filter.bounds()
    if run.filter is not None:
        run.sets.append(filter.snapshot())
    run.done = row + 1


@contextmanager
def naming(row: int) -> Iterator[None]:
    """Errors of this context name the row."""
    try:
        yield
    except LsuMeshError as error:
        raise named_row(row, error) from error


def named_row(row: int, error: LsuMeshError) -> LsuMeshError:
    """The same error, with the row in front."""
    message = f"row {row} (step {row + 1}): {error}"
    if isinstance(error, InconsistentData):
        return InconsistentData(message, error.rows, error.gap)
    return UnboundedSupport(message) if isinstance(error, UnboundedSupport) else type(error)(message)
