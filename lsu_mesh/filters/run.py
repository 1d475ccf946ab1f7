"""A filter over a whole record of data."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, LsuMeshError, ModelError, UnboundedSupport
from lsu_mesh.filters.compiled import CompiledFilter
from lsu_mesh.filters.filter import Filter
from lsu_mesh.kernels import batch_run


class FilterRun(NamedTuple):
    """The results of a filter at each of T steps; row k is step k + 1.

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


def run_filter(filter: Filter, Y: ArrayLike, U: ArrayLike | None = None) -> FilterRun:
    """Update with ``Y[k]`` and predict with ``U[k]`` for every row; afterwards the filter holds the last posterior.

    Y is (T, m), NaN for a missing output; U is (T, p), its last row is not used (T − 1 rows are enough), ``None`` for a
    model without inputs. LSUO, LSUP and LSUPB run in one compiled loop, with the same bits as step by step.

    Raises
    ------
    InconsistentData
        Names the row; the filter is then left as it was before that step (row k's prediction, or where the prediction
        from row k misses the domain, row k's posterior).
    ModelError
        Y or U have a wrong shape or infinite entries.
    """
    outputs = _table("Y", Y, filter.model.output_count)
    if np.isinf(outputs).any():
        raise ModelError("Y must be finite or NaN (missing)")
    inputs = _inputs(U, len(outputs), filter.model.input_count)
    n, m, rows = filter.model.state_count, filter.model.output_count, len(outputs)
    run = FilterRun(
        points=np.empty((rows, n)), lower=np.empty((rows, n)), upper=np.empty((rows, n)), volumes=np.empty(rows),
        y_lower=np.empty((rows, m)), y_upper=np.empty((rows, m)), y_points=np.empty((rows, m)),
    )  # fmt: skip
    if isinstance(filter, CompiledFilter) and filter.has_compiled_loop:
        row, where = filter.sweep(outputs, inputs, batch_run.Record(*(table[np.newaxis] for table in run)))
        if where == batch_run.IN_UPDATE:
            _update(filter, outputs, row)
        elif where == batch_run.IN_PREDICT:
            _predict(filter, inputs, row - 1)
        return run
    for k in range(rows):
        run.y_lower[k], run.y_upper[k], run.y_points[k] = filter.predict_output()
        _update(filter, outputs, k)
        run.points[k], run.volumes[k] = filter.point, filter.volume()
        run.lower[k], run.upper[k] = filter.bounds()
        if k + 1 < rows:
            _predict(filter, inputs, k)
    return run


def _table(name: str, value: ArrayLike, columns: int) -> Matrix:
    table = np.array(value, dtype=np.float64)
    if table.ndim == 1 and columns <= 1:
        table = table.reshape(-1, columns) if columns else np.zeros((table.size, 0))
    if table.ndim != 2 or table.shape[1] != columns:
        raise ModelError(f"{name} must have shape (steps, {columns}), it has shape {table.shape}")
    return np.ascontiguousarray(table)


def _inputs(U: ArrayLike | None, rows: int, columns: int) -> Matrix:
    """U (rows, p); a last row that is not given is 0, as it is not used."""
    if U is None:
        if columns and rows > 1:
            raise ModelError(f"the model has {columns} input(s): give U of shape ({rows}, {columns})")
        return np.zeros((rows, columns))
    table = _table("U", U, columns)
    if len(table) == rows - 1:
        table = np.vstack([table, np.zeros((1, columns))])
    if len(table) != rows:
        raise ModelError(f"U must have {rows} rows, one per row of Y, it has {len(table)}")
    if not np.isfinite(table[: rows - 1]).all():
        raise ModelError("U must hold finite numbers only")
    return table


def _update(filter: Filter, Y: Matrix, row: int) -> None:
    try:
        filter.update(Y[row])
    except LsuMeshError as error:
        raise _at(row, error) from error


def _predict(filter: Filter, U: Matrix, row: int) -> None:
    try:
        filter.predict(U[row] if U.shape[1] else None)
    except LsuMeshError as error:
        raise _at(row, error) from error


def _at(row: int, error: LsuMeshError) -> LsuMeshError:
    """The same error, with the row in front."""
    message = f"row {row} (step {row + 1}): {error}"
    if isinstance(error, InconsistentData):
        return InconsistentData(message, error.rows, error.gap)
    return UnboundedSupport(message) if isinstance(error, UnboundedSupport) else type(error)(message)
