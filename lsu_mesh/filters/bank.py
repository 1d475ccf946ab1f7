"""Many independent filters of one kind, in step with each other."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.array_types import Flags, Matrix, Stack
from lsu_mesh.errors import LsuMeshError, ModelError
from lsu_mesh.filters.compiled_loop import CompiledLoop, LoopData, LoopResult, stacked_models
from lsu_mesh.filters.density import Density
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.filters.run import run_filter
from lsu_mesh.filters.run_record import FilterRun
from lsu_mesh.filters.validation import checked_prior, kernel_model, numbers, with_offset
from lsu_mesh.kernels import run_tables
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.support import Support


class FilterBank:
    """The same filter over a leading axis of N independent instances (Monte Carlo runs, many targets).

    Parameters
    ----------
    kind:
        LSUO, LSUP, LSUPB, LSUCZ or ZonotopicKalman, the class.
    models:
        One model for all instances, or N models of equal shape.
    priors:
        N priors, or one for all (then N is the number of models).
    threads:
        Cores to use; all by default.
    options:
        Options of the class, as ``time_update`` of LSUP.

    Every instance gives the same bits as a filter of its own. An instance whose data contradict its bounds (or whose
    set overflows) keeps the set that it had, and the others continue. Points of LSUCZ and ZonotopicKalman are computed
    in compiled code by the rule ``"centre"`` only; their volumes are not computed, they are NaN.
    """

    def __init__(
        self,
        kind: type[CompiledLoop],
        models: LSUModel | Sequence[LSUModel],
        priors: Support | Sequence[Support],
        threads: int | None = None,
        **options: Any,
    ) -> None:
        model_list = [models] if isinstance(models, LSUModel) else list(models)
        prior_list = [priors] if isinstance(priors, Support) else list(priors)
        count = max(len(model_list), len(prior_list))
        if {len(model_list), len(prior_list)} - {1, count} or not count:
            raise ModelError(f"{len(model_list)} models and {len(prior_list)} priors do not make a bank")
        made: Any = kind
        first: Any = made(model_list[0], prior_list[0], **options)
        _check_parts(model_list)
        if not isinstance(first, CompiledLoop) or not first.has_compiled_loop:
            raise ModelError(f"{kind.__name__} with these options has no compiled bank; make a list of filters")
        self.kind = kind
        self._options = options
        self._filter = first
        self._model = model_list[0]
        self._model_list = model_list
        self._models = _stack(model_list)
        self._states, self._estimates = _started(first, [checked_prior(model_list[0], prior) for prior in prior_list])
        if len(self._states) != count:
            self._states, means, covariances = (
                np.repeat(stack, count, axis=0)
                for stack in (self._states, self._estimates.means, self._estimates.covariances)
            )
            self._estimates = self._estimates._replace(means=means, covariances=covariances)
        self._threads = max(1, min(threads or os.cpu_count() or 1, count // first.min_share))

    def __len__(self) -> int:
        """N"""
        return len(self._states)

    @property
    def point_rule(self) -> PointRule:
        """How the points are chosen."""
        return self._filter.point_rule

    @property
    def points(self) -> Matrix:
        """Point estimates (N, n)."""
        return np.array([self._at(i).point for i in range(len(self))])

    def bounds(self) -> tuple[Matrix, Matrix]:
        """Interval hulls ``(lower, upper)``, each (N, n)."""
        described = [self._at(i).bounds() for i in range(len(self))]
        return np.array([row[0] for row in described]), np.array([row[1] for row in described])

    def support(self, i: int) -> Support:
        """The set of instance i."""
        return self._at(i).support

    def _at(self, i: int) -> CompiledLoop:
        """The filter of the first model, with the set of instance i."""
        densities = self._filter.density is not None
        density = Density(self._estimates.means[i], self._estimates.covariances[i]) if densities else None
        self._filter.hold_loop_state(self._states[i].copy(), density)
        return self._filter

    def _own(self, i: int) -> CompiledLoop:
        """The filter of instance i, in its present state, to be stepped."""
        self._at(i)
        engine: Any = self._filter
        if len(self._model_list) > 1:
            made: Any = self.kind
            engine = made(self._model_list[i], self._filter.support.interval_hull(), **self._options)
        density = self._filter.density
        if density is not None:
            density = Density(density.mean.copy(), density.covariance.copy())
        engine.hold_loop_state(self._states[i].copy(), density)
        held: CompiledLoop = engine
        return held

    def _keep(self, i: int, engine: CompiledLoop) -> None:
        """Take the state of instance i from its filter."""
        state, density = engine.loop_state, engine.density
        if self._states.ndim == 2 and state.size > self._states.shape[1]:
            self._states = _longer(self._states, state.size)
        self._states[i] = 0.0
        self._states[i, : len(state)] = state
        if density is not None:
            self._estimates.means[i], self._estimates.covariances[i] = density

    def estimates(self, rows: Sequence[int]) -> tuple[Matrix, Matrix, Matrix]:
        """Points and interval hulls ``(points, lower, upper)`` of these instances, each (len(rows), n)."""
        found = np.empty((3, len(rows), self._model.state_count))
        for k, i in enumerate(rows):
            engine = self._at(i)
            found[0, k], (found[1, k], found[2, k]) = engine.point, engine.bounds()
        return found[0], found[1], found[2]

    def reset(self, rows: Sequence[int], support: Support) -> None:
        """Start these instances again from ``support``, as the ``reset`` of a filter does."""
        states, densities = _started(self._filter, [checked_prior(self._model, support)])
        indices, state = list(rows), states[0]
        if self._states.ndim == 2 and state.size > self._states.shape[1]:
            self._states = _longer(self._states, state.size)
        self._states[indices] = 0.0
        self._states[indices, : len(state)] = state
        self._estimates.means[indices] = densities.means[0]
        self._estimates.covariances[indices] = densities.covariances[0]

    def update(self, Y: ArrayLike) -> Flags:
        """Data update with Y (N, m), NaN or masked: missing; ``False``: the data contradict that instance's set."""
        outputs = self._table("Y", Y, self._models.C.shape[1])[:, np.newaxis]
        _check_outputs(outputs)
        outcome = self._sweep(outputs, self._no_inputs(1), updates=True, last_prediction=False)[1]
        return self._finished(outcome, lambda engine, i: engine.update(outputs[i, 0]))

    def predict(self, U: ArrayLike | None = None) -> Flags:
        """Time update with U (N, p); ``False`` marks an instance whose prediction misses its domain."""
        p = self._model.input_count
        if U is None and p:
            raise ModelError(f"the models have {p} input(s): give U of shape ({len(self)}, {p})")
        inputs = self._no_inputs(1) if U is None else self._table("U", U, p)[:, np.newaxis]
        _check_finite(inputs)
        outputs = np.zeros((len(self), 1, self._models.C.shape[1]))
        outcome = self._sweep(outputs, inputs, updates=False, last_prediction=True)[1]
        return self._finished(outcome, lambda engine, i: engine.predict(inputs[i, 0]))

    def _finished(self, outcome: NDArray[np.int64], step: Callable[[CompiledLoop, int], object]) -> Flags:
        """Which instances are done; those that compiled code has left are done in Python, or contradict their data."""
        done = np.equal(outcome[:, 1], run_tables.DONE)
        for i in np.flatnonzero(~done):
            engine = self._own(int(i))
            try:
                step(engine, int(i))
            except LsuMeshError:
                continue
            self._keep(int(i), engine)
            done[i] = True
        return done

    def run(
        self,
        Y: ArrayLike,
        U: ArrayLike | None = None,
        *,
        times: object = None,
        models: object = None,
        points: bool = True,
    ) -> tuple[FilterRun, NDArray[np.int64]]:
        """All rows of Y (N, T, m), NaN or masked where missing, with inputs U (N, T, p).

        Returns the record, with a leading axis N, and the rows done (N,).
        Without ``points`` those of states and outputs are not computed, and are NaN.
        An instance with fewer rows done than T met a contradiction there; its further rows are NaN. Times of the rows
        and models of one row each are refused: :func:`lsu_mesh.run_filter` takes them.
        """
        if times is not None or models is not None:
            raise ModelError(
                "a bank knows no times and no models of one row; use run_filter with each filter by itself"
            )
        m, p = self._models.C.shape[1], self._model.input_count
        outputs = numbers("Y", Y)
        if outputs.ndim != 3 or outputs.shape[0] != len(self) or outputs.shape[2] != m:
            raise ModelError(f"Y must have shape ({len(self)}, steps, {m}), it has shape {outputs.shape}")
        _check_outputs(outputs)
        if U is None and p:
            raise ModelError(f"the models have {p} input(s): give U of shape {(*outputs.shape[:2], p)}")
        inputs = self._no_inputs(outputs.shape[1]) if U is None else numbers("U", U)
        if inputs.shape != (*outputs.shape[:2], p):
            raise ModelError(f"U must have shape {(*outputs.shape[:2], p)}, it has shape {inputs.shape}")
        _check_finite(inputs[:, :-1])
        rule = self._filter.point_rule
        if points and rule != "centre" and not self._filter.has_compiled_points:
            record = _record(len(self), outputs.shape[1], self._model.state_count, m)
            done = np.zeros(len(self), dtype=np.int64)
            for instance in range(len(self)):
                self._continue(instance, outputs, inputs, record=record, done=done, points=True)
        else:
            record, outcome = self._sweep(outputs, inputs, updates=True, last_prediction=False, points=points)
            done = outcome[:, 0].copy()
            for i in np.flatnonzero(outcome[:, 1] != run_tables.DONE):
                at_posterior = outcome[i, 1] == run_tables.IN_PREDICT
                self._continue(
                    int(i), outputs, inputs, record=record, done=done, points=points, at_posterior=bool(at_posterior)
                )
        if not points:
            record.points[:], record.y_points[:] = np.nan, np.nan
        return FilterRun(*record), done

    def _continue(
        self, i: int, Y: Stack, U: Stack, *, record: run_tables.Record, done: NDArray[np.int64], points: bool,
        at_posterior: bool = False,
    ) -> None:  # fmt: skip
        """The rows of instance i that are left, by a filter of its own: compiled code stopped, or has no points."""
        engine, row = self._own(i), int(done[i])
        try:
            if at_posterior:
                engine.predict(U[i, row - 1] if U.shape[2] else None)
            volumes = None if engine.has_compiled_volumes else False
            run: FilterRun | None = run_filter(engine, Y[i, row:], U[i, row:], points=points, volumes=volumes)
        except LsuMeshError as error:
            run = error.run
        self._keep(i, engine)
        rows = 0 if run is None else run.done
        for table, found in zip(record, () if run is None else run, strict=False):
            table[i, row : row + rows] = found[:rows]
        for table in record:
            table[i, row + rows :] = np.nan
        done[i] = row + rows

    def _table(self, name: str, value: ArrayLike, columns: int) -> Matrix:
        table = numbers(name, value)
        if table.shape != (len(self), columns):
            raise ModelError(f"{name} must have shape ({len(self)}, {columns}), it has shape {table.shape}")
        return table

    def _no_inputs(self, rows: int) -> Stack:
        return np.zeros((len(self), rows, self._model.input_count))

    def _sweep(
        self, Y: Stack, U: Stack, *, updates: bool, last_prediction: bool, points: bool = False
    ) -> tuple[run_tables.Record, NDArray[np.int64]]:
        record = _record(len(self), Y.shape[1] if updates else 0, self._model.state_count, Y.shape[2])
        outcome = np.zeros((len(self), 2), dtype=np.int64)
        data = LoopData(Y, with_offset(self._model, U), updates, last_prediction, points=points)
        kept = np.empty((len(self), 0, 0))

        def share(first: int, last: int) -> None:
            self._filter.run_states(
                self._states,
                self._models,
                self._estimates,
                data,
                result=LoopResult(record, outcome),
                first=first,
                last=last,
                kept=kept,
            )

        _in_shares(share, len(self), self._threads)
        return record, outcome


def _check_outputs(Y: Stack) -> None:
    if np.isinf(Y).any():
        raise ModelError("Y must be finite or NaN (missing)")


def _check_finite(inputs: Stack) -> None:
    if not np.isfinite(inputs).all():
        raise ModelError("U must hold finite numbers only")


def _in_shares(work: Callable[[int, int], None], count: int, threads: int) -> None:
    """Call ``work(first, last)`` for as many shares of ``range(count)``; kernels release the interpreter's lock."""
    if threads == 1:
        work(0, count)
        return
    edges = [count * k // threads for k in range(threads + 1)]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, edges[:-1], edges[1:]))


def _check_parts(models: Sequence[LSUModel]) -> None:
    """Raises ``ModelError`` where a model has a part for which each step must look at its set or its input."""
    for model in models:
        parts = {"D": model.D, "d": model.d, "period": model.period, "radii (a continuous model)": model.radii}
        given = [name for name, part in parts.items() if part is not None]
        if given:
            raise ModelError(f"a bank knows no {', '.join(given)}; make a list of filters")


def _stack(models: Sequence[LSUModel]) -> run_tables.Models:
    """Arrays of the models with a leading axis; ``ModelError`` where their shapes or their having a domain differ."""
    shapes = {tuple(array.shape for array in kernel_model(model)) for model in models}
    with_domain = [model.domain for model in models if model.domain is not None]
    if len(shapes) > 1 or len(with_domain) not in (0, len(models)):
        raise ModelError("the models of a bank must have equal shapes, and all of them a domain or none")
    return stacked_models(models)


def _started(first: CompiledLoop, priors: Sequence[Support]) -> tuple[Stack, run_tables.Estimates]:
    """States and densities of filters that start from these priors, each like the first one."""
    states, densities = [], []
    for prior in priors:
        first.reset(prior)
        states.append(first.loop_state)
        densities.append(first.density)
    if states[0].ndim == 1:
        size = max(state.size for state in states)
        states = [np.concatenate([state, np.zeros(size - state.size)]) for state in states]
    return np.array(states), first.estimates(densities)


def _longer(states: Matrix, size: int) -> Matrix:
    """The same lines of memory with more room each."""
    return np.hstack([states, np.zeros((len(states), size - states.shape[1]))])


def _record(count: int, rows: int, n: int, m: int) -> run_tables.Record:
    def blank(*shape: int) -> Stack:
        return np.full((count, rows, *shape), np.nan)

    return run_tables.Record(blank(n), blank(n), blank(n), blank(), blank(m), blank(m), blank(m))
