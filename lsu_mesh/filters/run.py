"""A filter over a whole record of data."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix
from lsu_mesh.errors import LsuMeshError, ModelError
from lsu_mesh.filters.compiled_loop import CompiledLoop
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.grid import OffGrid
from lsu_mesh.filters.inconsistent_rows import OnInconsistency, RowRule
from lsu_mesh.filters.run_record import FilterRun, blank_run, store_output, store_set
from lsu_mesh.filters.timed_run import Models, Rows, run_rows
from lsu_mesh.filters.validation import numbers
from lsu_mesh.kernels import run_tables
from lsu_mesh.model import ContinuousModel, LSUModel


def run_filter(
    filter: Filter,
    Y: ArrayLike,
    U: ArrayLike | None = None,
    *,
    times: ArrayLike | None = None,
    models: Models | None = None,
    time_errors: int | Sequence[int] = 0,
    dt_ns: int | None = None,
    rate: ArrayLike | None = None,
    off_grid: OffGrid = "refuse",
    on_inconsistency: OnInconsistency = "raise",
    volumes: bool | None = None,
    points: bool = True,
) -> FilterRun:
    """Update with ``Y[k]`` and predict with ``U[k]`` for every row; afterwards the filter holds the last posterior.

    Parameters
    ----------
    filter:
        Holds the prior of the first row's state.
    Y, U:
        (T, m), NaN or a masked entry for a missing output; (T, p), ``None`` for a model without inputs.
        The last row of U is not used (T − 1 rows are enough) unless D ≠ 0. LSUO, LSUP and LSUPB run plain models in one
        compiled loop, with the same bits as step by step; LSUCZ and ZonotopicKalman do so where no points are asked
        for, or those of the rule ``"centre"``.
    times:
        Times (T,) of the rows in whole nanoseconds, or ``datetime64``, not decreasing. The filter's model (or every
        model of ``models``) is one of a continuous model, and the set is carried over the true lengths: row k of the
        result is the set of x(times[k]). ``U[k]`` acts from times[k] on. With a discrete model ``dt_ns`` is needed.
    models:
        Models of one row each, T of them (T − 1 are enough): row k's outputs are theirs, and its dynamics drive it on.
    time_errors:
        What is not known of the times, in ns, one for all or one per row; each strip is widened by what it costs. What
        acts before times[0] is then taken to be ``U[0]``.
    dt_ns, rate, off_grid:
        Of a discrete model with times: the grid ``times[0] + k dt_ns``. A row off the grid is refused, unless ``rate``
        (m,), the bound of the noise-free |dy/dt| per second, widens it, or ``off_grid="nearest"``, by which the sets
        are no longer guaranteed. Row k of the result is then the set of its step.
    on_inconsistency:
        What to do with a row whose data are proved to miss the set. ``"raise"``; ``"hold"``: leave its data out;
        ``"reset"``: start again from ``model.domain``, with its data; ``"widen"``: widen its r by the smallest factor,
        to 1 %, that explains them, or hold where none does; the run then promises no guarantee. A prediction that
        misses the domain is replaced by the domain, but with ``"raise"``. ``run.status`` tells what became of each row.
    volumes:
        ``None``: ``run.volumes`` is computed when it is first read, from the sets of the rows, which are kept until
        then; ``True``: at once; ``False``: never, it is NaN, and no set is kept. (A compiled loop always has them.)
    points:
        ``False``: points of states and of outputs are not computed, and are NaN.

    Raises
    ------
    InconsistentData
        Names the row; ``error.run`` is the run of the rows before it. The filter is then left as it was before that
        step (row k's prediction, or where the prediction from row k misses the domain, row k's posterior).
    ModelError
        Y, U, times or models have a wrong shape or entries, or a row is off the grid.
    """
    outputs = _table("Y", Y, filter.model.output_count)
    if np.isinf(outputs).any():
        raise ModelError("Y must be finite or NaN (missing)")
    all_models: list[LSUModel | ContinuousModel] = [filter.model] if models is None else list(models)
    needs_last = any((m.rates if isinstance(m, ContinuousModel) else m).D is not None for m in all_models)
    inputs = _inputs(U, len(outputs), filter.model.input_count, needs_last)
    run = blank_run(len(outputs), filter.model.state_count, filter.model.output_count, filter.guarantee)
    run.has_points = points
    rule = RowRule(filter, run, on_inconsistency)
    try:
        if times is not None or models is not None:
            rows = Rows(
                Y=outputs,
                U=inputs,
                times=times,
                models=models,
                time_errors=time_errors,
                dt_ns=dt_ns,
                rate=rate,
                off_grid=off_grid,
                keeps_sets=volumes is not False,
            )
            run_rows(filter, rows, rule=rule, run=run)
        elif np.any(time_errors) or dt_ns is not None or rate is not None:
            raise ModelError("time_errors, dt_ns and rate need times")
        elif (
            isinstance(filter, CompiledLoop)
            and filter.has_compiled_loop
            and (filter.has_compiled_points or filter.point_rule == "centre" or not points)
        ):
            run.filter = None if volumes is False or filter.has_compiled_volumes else filter
            _sweep(filter, outputs, inputs, rule=rule, run=run)
        else:
            run.filter = None if volumes is False else filter
            _step(filter, outputs, inputs, rule=rule, run=run)
    except LsuMeshError as error:
        error.run = run.first(run.done)
        raise
    finally:
        if not points:  # a compiled loop has the centres, which cost it nothing
            run.drop_points()
    return run.complete() if volumes else run


def _step(filter: Filter, Y: Matrix, U: Matrix, rule: RowRule, run: FilterRun) -> None:
    """All rows, step by step."""
    is_plain = filter.model.has_plain_outputs  # filters of other packages need not know u then
    for k in range(len(Y)):
        store_output(run, k, filter.predict_output() if is_plain else filter.predict_output(U[k]))
        rule.update(k, Y[k], u=U[k])
        store_set(run, k, filter)
        if k + 1 < len(Y):
            rule.advance(k, partial(filter.predict, U[k] if U.shape[1] else None))


def _sweep(filter: CompiledLoop, Y: Matrix, U: Matrix, rule: RowRule, run: FilterRun) -> None:
    """All rows in the compiled loop, which stops at a contradiction and goes on after what the rule makes of it."""
    tables, row = [tuple.__getitem__(run, i) for i in range(len(run))], 0
    is_missing = np.asarray(np.isnan(Y).all(axis=1))
    run.status[:] = ["missing" if missing else "ok" for missing in is_missing.tolist()]
    while row < len(Y):
        record = run_tables.Record(*(table[np.newaxis, row:] for table in tables))
        sets = None if run.filter is None else run.sets
        done, where = filter.sweep(Y[row:], U[row:], record, run.has_points, sets=sets)
        row += done
        run.done = row
        if where == run_tables.IN_OUTPUT:
            store_output(run, row, filter.predict_output())
        if where in (run_tables.IN_UPDATE, run_tables.IN_OUTPUT):
            rule.update(row, Y[row], u=U[row])
            store_set(run, row, filter)
            if filter.has_compiled_volumes:
                run.volumes[row] = filter.volume()
            row += 1
        if where != run_tables.DONE and row < len(Y):
            rule.advance(row - 1, partial(filter.predict, U[row - 1] if U.shape[1] else None))
            if rule.has_started_again():
                run.status[row] = "reset"


def _table(name: str, value: ArrayLike, columns: int) -> Matrix:
    table = numbers(name, value)
    if table.ndim == 1 and columns <= 1:
        table = table.reshape(-1, columns) if columns else np.zeros((table.size, 0))
    if table.ndim != 2 or table.shape[1] != columns:
        raise ModelError(f"{name} must have shape (steps, {columns}), it has shape {table.shape}")
    return np.ascontiguousarray(table)


def _inputs(U: ArrayLike | None, rows: int, columns: int, needs_last: bool) -> Matrix:
    """U (rows, p); a last row that is not given is 0, as it is not used."""
    if U is None:
        if columns and (rows > 1 or needs_last):
            raise ModelError(f"the model has {columns} input(s): give U of shape ({rows}, {columns})")
        return np.zeros((rows, columns))
    table = _table("U", U, columns)
    if len(table) == rows - 1 and not needs_last:
        table = np.vstack([table, np.zeros((1, columns))])
    if len(table) != rows:
        raise ModelError(f"U must have {rows} rows, one per row of Y, it has {len(table)}")
    if not np.isfinite(table[: rows if needs_last else rows - 1]).all():
        raise ModelError("U must hold finite numbers only")
    return table
