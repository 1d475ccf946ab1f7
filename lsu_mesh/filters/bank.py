"""Many independent filters of one kind, in step with each other."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.array_types import Flags, Matrix, Stack
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.compiled import CompiledFilter
from lsu_mesh.filters.density import Density, noise_covariance
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.filters.run_record import FilterRun
from lsu_mesh.filters.validation import checked_prior, kernel_model, numbers, with_offset
from lsu_mesh.kernels import batch_run
from lsu_mesh.kernels.points.room import room
from lsu_mesh.kernels.runtime.scratch import scratch
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.support import Support

MIN_SHARE = 64
"""Instances below which a thread of its own does not pay."""


class FilterBank:
    """The same filter over a leading axis of N independent instances (Monte Carlo runs, many targets).

    Parameters
    ----------
    kind:
        LSUO, LSUP or LSUPB, the class.
    models:
        One model for all instances, or N models of equal shape.
    priors:
        N priors, or one for all (then N is the number of models).
    threads:
        Cores to use; all by default.
    options:
        Options of the class, as ``time_update`` of LSUP.

    Every instance gives the same bits as a filter of its own. An instance whose data contradict its bounds (or whose
    set overflows) keeps the set that it had, and the others continue.
    """

    def __init__(
        self,
        kind: type[CompiledFilter],
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
        first: Any = kind(model_list[0], prior_list[0], **options)
        _check_parts(model_list)
        if not isinstance(first, CompiledFilter) or not first.has_compiled_loop:
            raise ModelError(f"{kind.__name__} with these options has no compiled bank; make a list of filters")
        self.kind = kind
        self._filter = first
        self._model = model_list[0]
        self._models = _stack(model_list)
        self._states, self._estimates = _started(first, [checked_prior(model_list[0], prior) for prior in prior_list])
        if len(self._states) != count:
            self._states, means, covariances = (
                np.repeat(stack, count, axis=0)
                for stack in (self._states, self._estimates.means, self._estimates.covariances)
            )
            self._estimates = self._estimates._replace(means=means, covariances=covariances)
        self._threads = max(1, min(threads or os.cpu_count() or 1, count // MIN_SHARE))

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
        densities = map(Density, self._estimates.means, self._estimates.covariances)
        return np.array([self._filter._located(*one) for one in zip(self._states, densities, strict=True)])

    def bounds(self) -> tuple[Matrix, Matrix]:
        """Interval hulls ``(lower, upper)``, each (N, n)."""
        described = [self._filter._describe(state) for state in self._states]
        return np.array([row[1] for row in described]), np.array([row[2] for row in described])

    def support(self, i: int) -> Support:
        """The set of instance i."""
        return self.kind._make_support(self._states[i].copy())

    def estimates(self, rows: Sequence[int]) -> tuple[Matrix, Matrix, Matrix]:
        """Points and interval hulls ``(points, lower, upper)`` of these instances, each (len(rows), n)."""
        means, covariances = self._estimates.means, self._estimates.covariances
        described = [self._filter._describe(self._states[i]) for i in rows]
        located = [self._filter._located(self._states[i], Density(means[i], covariances[i])) for i in rows]
        shape = (len(rows), self._model.state_count)
        lower, upper = (np.array([one[k] for one in described]).reshape(shape) for k in (1, 2))
        return np.array(located).reshape(shape), lower, upper

    def reset(self, rows: Sequence[int], support: Support) -> None:
        """Start these instances again from ``support``, as the ``reset`` of a filter does."""
        states, densities = _started(self._filter, [checked_prior(self._model, support)])
        indices = list(rows)
        self._states[indices] = states[0]
        self._estimates.means[indices] = densities.means[0]
        self._estimates.covariances[indices] = densities.covariances[0]

    def update(self, Y: ArrayLike) -> Flags:
        """Data update with Y (N, m), NaN or masked: missing; ``False``: the data contradict that instance's set."""
        outputs = self._table("Y", Y, self._models.C.shape[1])[:, np.newaxis]
        _check_outputs(outputs)
        outcome = self._sweep(outputs, self._no_inputs(1), True, False)[1]
        return np.equal(outcome[:, 1], batch_run.DONE)

    def predict(self, U: ArrayLike | None = None) -> Flags:
        """Time update with U (N, p); ``False`` marks an instance whose prediction misses its domain."""
        p = self._model.input_count
        if U is None and p:
            raise ModelError(f"the models have {p} input(s): give U of shape ({len(self)}, {p})")
        inputs = self._no_inputs(1) if U is None else self._table("U", U, p)[:, np.newaxis]
        _check_finite(inputs)
        outputs = np.zeros((len(self), 1, self._models.C.shape[1]))
        outcome = self._sweep(outputs, inputs, False, True)[1]
        return np.equal(outcome[:, 1], batch_run.DONE)

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
        record, outcome = self._sweep(outputs, inputs, updating=True, last_prediction=False, points=points)
        if not points:
            record.points[:], record.y_points[:] = np.nan, np.nan
        return FilterRun(*record), outcome[:, 0]

    def _table(self, name: str, value: ArrayLike, columns: int) -> Matrix:
        table = numbers(name, value)
        if table.shape != (len(self), columns):
            raise ModelError(f"{name} must have shape ({len(self)}, {columns}), it has shape {table.shape}")
        return table

    def _no_inputs(self, rows: int) -> Stack:
        return np.zeros((len(self), rows, self._model.input_count))

    def _sweep(
        self, Y: Stack, U: Stack, updating: bool, last_prediction: bool, points: bool = False
    ) -> tuple[batch_run.Record, NDArray[np.int64]]:
        record = _record(len(self), Y.shape[1] if updating else 0, self._states.shape[2], Y.shape[2])
        outcome = np.zeros((len(self), 2), dtype=np.int64)
        inputs = with_offset(self._model, U)

        def share(first: int, last: int) -> None:
            batch_run.sweep(
                self._filter.family, self._filter.option, updating, last_prediction, self._states,
                np.empty_like(self._states[0]), self._models, Y, inputs, record, outcome, first, last,
                scratch(self._states.shape[2], self._models.G.shape[2]), self._estimates, points,
                room(self._states.shape[2]),
            )  # fmt: skip

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


def _stack(models: Sequence[LSUModel]) -> batch_run.Models:
    """Arrays of the models with a leading axis; ``ModelError`` where their shapes or their having a domain differ."""
    arrays = [kernel_model(model) for model in models]
    n = models[0].state_count
    shapes = {tuple(array.shape for array in one) for one in arrays}
    with_domain = [model.domain for model in models if model.domain is not None]
    if len(shapes) > 1 or len(with_domain) not in (0, len(models)):
        raise ModelError("the models of a bank must have equal shapes, and all of them a domain or none")
    domains = np.array([box.bounds() for box in with_domain]) if with_domain else np.zeros((len(models), 0, n))
    return batch_run.Models(
        A=np.array([one.A for one in arrays]),
        B=np.array([one.B for one in arrays]),
        C=np.array([one.C for one in arrays]),
        G=np.array([one.G for one in arrays]),
        widths=np.array([one.widths for one in arrays]),
        r=np.array([one.r for one in arrays]),
        domains=domains,
        Q=np.array([noise_covariance(model, None) for model in models]),
    )


def _started(first: CompiledFilter, priors: Sequence[Support]) -> tuple[Stack, batch_run.Estimates]:
    """States and densities of filters that start from these priors, each like the first one."""
    states, densities = [], []
    for prior in priors:
        first.reset(prior)
        states.append(first.snapshot().state)
        densities.append(first.density)
    return np.array(states), first._estimates(densities)


def _record(count: int, rows: int, n: int, m: int) -> batch_run.Record:
    def blank(*shape: int) -> Stack:
        return np.full((count, rows, *shape), np.nan)

    return batch_run.Record(blank(n), blank(n), blank(n), blank(), blank(m), blank(m), blank(m))
