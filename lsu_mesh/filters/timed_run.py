"""A filter over data with times of their own, or with a model for each row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.filter import Filter, OutputPrediction
from lsu_mesh.filters.grid import OffGrid, check_times, grid_half_widths, held_rows, step_of
from lsu_mesh.filters.inconsistent_rows import RowRule
from lsu_mesh.filters.run_record import FilterRun, naming, store_output, store_set
from lsu_mesh.filters.timed_data import TimedDatum, carry, half_widths_at
from lsu_mesh.kernels.runtime.rounding import EPSILON
from lsu_mesh.model import ContinuousModel, LSUModel

Models = Sequence[LSUModel | ContinuousModel]


class Rows(NamedTuple):
    """The arguments of :func:`lsu_mesh.run_filter`; Y (T, m) and U (T, p) are checked already."""

    Y: Matrix
    U: Matrix
    times: ArrayLike | None
    models: Models | None
    time_errors: int | Sequence[int]
    dt_ns: int | None
    rate: ArrayLike | None
    off_grid: OffGrid
    keeps_sets: bool = False
    """Whether volumes may be asked for later."""


def run_rows(filter: Filter, rows: Rows, rule: RowRule, run: FilterRun) -> FilterRun:
    """Fill ``run``: per-step models without times, a continuous model with times, or a discrete one on its grid."""
    if rows.off_grid not in ("refuse", "nearest"):
        raise ModelError(f'off_grid must be "refuse" or "nearest", it is {rows.off_grid!r}')
    models = _models(filter, rows)
    run.filter = filter if rows.keeps_sets else None
    if rows.times is None:
        if np.any(rows.time_errors):
            raise ModelError("time_errors need times")
        return _run_steps(filter, rows, models, rule=rule, run=run)
    times = check_times(rows.times, len(rows.Y))
    errors = _errors(rows.time_errors, len(times))
    flows = [model if isinstance(model, ContinuousModel) else model.flow for model in models]
    if all(flow is not None for flow in flows):
        return _run_continuous(
            filter,
            rows,
            [flow for flow in flows if flow is not None],
            times=times,
            errors=errors,
            rule=rule,
            run=run,
        )
    if rows.models is not None:
        raise ModelError("models with times must be continuous ones: LSUModel.continuous(…)")
    if rows.dt_ns is None or rows.dt_ns <= 0:
        raise ModelError("a discrete model knows no time: give dt_ns, the length of its step, or a continuous model")
    if rows.off_grid == "nearest" and rows.rate is None:
        run.guarantee = "none"
    return _run_on_grid(filter, rows, times, errors=errors, dt_ns=rows.dt_ns, rule=rule, run=run)


def _models(filter: Filter, rows: Rows) -> list[LSUModel | ContinuousModel]:
    count = len(rows.Y)
    if rows.models is None:
        return [filter.model] * count
    models = list(rows.models)
    if len(models) == count - 1:
        models.append(models[-1])
    if len(models) != count:
        raise ModelError(f"models must have {count} entries, one per row of Y, it has {len(models)}")
    for k, model in enumerate(models):
        own, given = filter.model, (model.state_count, model.input_count, model.output_count)
        if given != (own.state_count, own.input_count, own.output_count):
            raise ModelError(
                f"models[{k}] must have {own.state_count} states, {own.input_count} inputs and {own.output_count} "
                f"outputs, it has {given}"
            )
    return models


def _errors(time_errors: int | Sequence[int], count: int) -> list[int]:
    errors = np.asarray(time_errors)
    if errors.dtype.kind not in "iu" or (errors < 0).any() or errors.shape not in ((), (count,)):
        raise ModelError(f"time_errors must be whole nanoseconds ≥ 0, one or {count} of them, they are {time_errors!r}")
    return [int(error) for error in np.broadcast_to(errors, (count,))]


def _run_steps(
    filter: Filter, rows: Rows, models: Sequence[LSUModel | ContinuousModel], rule: RowRule, run: FilterRun
) -> FilterRun:
    """One step per row, each with its own model."""
    steps = [model for model in models if isinstance(model, LSUModel)]
    if len(steps) != len(models):
        raise ModelError("a continuous model per row needs times; discretise it, or give times")
    for k, model in enumerate(steps):
        u = rows.U[k]
        with naming(k):
            store_output(run, k, filter.predict_output(u, model))
        rule.update(k, rows.Y[k], model=model, u=u)
        store_set(run, k, filter)
        if k + 1 < len(steps):
            rule.advance(k, partial(filter.predict, u if u.size else None, model=model))
    return run


def _run_continuous(
    filter: Filter, rows: Rows, flows: list[ContinuousModel], times: list[int], errors: list[int],
    rule: RowRule, run: FilterRun,
) -> FilterRun:  # fmt: skip
    """Carry over the true lengths between the rows."""
    inputs = held_rows(times, rows.U)
    for k, (flow, time) in enumerate(zip(flows, times, strict=True)):
        outputs = flow.rates if rows.models is not None else filter.model
        datum = TimedDatum(time, rows.Y[k], errors[k], outputs)
        with naming(k):
            r = half_widths_at(filter, flow, datum, inputs)
            if r is None:
                raise ModelError(
                    f"the error of the time, {errors[k]} ns, is too long for this model: leave the row out"
                )
            u = inputs.hull(time - errors[k], time + errors[k])
            store_output(run, k, _widened(filter.predict_output(u, outputs), r, outputs.r))
        rule.update(k, rows.Y[k], r=r, model=outputs, u=u)
        store_set(run, k, filter)
        if k + 1 < len(times):
            rule.advance(k, partial(carry, filter, flow, time, end_ns=times[k + 1], inputs=inputs))
    return run


def _run_on_grid(
    filter: Filter, rows: Rows, times: list[int], errors: list[int], dt_ns: int, rule: RowRule, run: FilterRun
) -> FilterRun:
    """Steps of a discrete model from ``times[0]`` on; U[k] drives every step from that of row k to that of the next."""
    model, has_inputs = filter.model, rows.U.shape[1] > 0
    is_nearest = rows.off_grid == "nearest" and rows.rate is None
    steps = [step_of(time - dt_ns // 2 if is_nearest else time, times[0], dt_ns) for time in times]
    for k, (step, time) in enumerate(zip(steps, times, strict=True)):
        at = times[0] + step * dt_ns
        u = rows.U[k] if has_inputs else None
        around = (rows.U[max(0, k - 1)] if has_inputs else None, u)
        with naming(k):
            r = grid_half_widths(
                model, None, time, error_ns=errors[k], step_ns=at, rate=rows.rate, off_grid=rows.off_grid, inputs=around
            )
            store_output(run, k, _widened(filter.predict_output(u), r, model.r))
        rule.update(k, rows.Y[k], r=r, u=u)
        store_set(run, k, filter)
        following = steps[k + 1] if k + 1 < len(steps) else steps[k]
        rule.advance(k, partial(_repeat, partial(filter.predict, u), following - steps[k]))
    return run


def _repeat(step: Callable[[], object], times: int) -> None:
    for _ in range(times):
        step()


def _widened(predicted: OutputPrediction, r: Vector, usual: Vector) -> OutputPrediction:
    """The interval of an output with half-widths r in place of the usual ones, each (m,)."""
    more = np.maximum(r - usual, 0.0) * (1.0 + 2.0 * EPSILON)
    lower = np.where(more > 0.0, np.nextafter(predicted.lower - more, -np.inf), predicted.lower)
    upper = np.where(more > 0.0, np.nextafter(predicted.upper + more, np.inf), predicted.upper)
    return OutputPrediction(lower, upper, predicted.point)
