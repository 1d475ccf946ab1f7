"""What the filters with a compiled step have in common: checks, errors, and the order of the steps."""

from __future__ import annotations

import math
from abc import abstractmethod
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.errors import InconsistentData, ModelError, UnboundedSupport
from lsu_mesh.filters.arguments import (
    KernelModel,
    checked_prior,
    half_width_vector,
    input_interval,
    kernel_model,
    output_vector,
    same_states,
)
from lsu_mesh.filters.filter import Filter, OutputPrediction
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
State = tuple[NDArray[np.float64], ...]


class CompiledFilter(Filter):
    """A filter whose state is a tuple of arrays and whose steps are kernels ``(state, …) → (new state, status)``.

    A status is 0, negative for overflow, or 1 + the index of the strip (or coordinate) that is proved to miss the set. Arrays of
    a state are never written again, so that a snapshot is the tuple itself.
    """

    def __init__(self, model: LSUModel, prior: Support) -> None:
        self._model = model
        self._arrays = kernel_model(model)
        self._work = self._scratch()
        self._state = self._enclose(checked_prior(model, prior))

    @abstractmethod
    def _scratch(self) -> Matrix:
        """Scratch memory of the kernels."""

    @abstractmethod
    def _enclose(self, support: Support) -> State:
        """The smallest state at hand that holds ``support``."""

    @abstractmethod
    def _make_support(self, state: State) -> Support:
        """The set that a state stands for."""

    @abstractmethod
    def _update(self, state: State, C: Matrix, y: Vector, r: Vector) -> tuple[State, int]:
        """Data update with the strips ``|y − C x| ≤ r``."""

    @abstractmethod
    def _predict(self, state: State, arrays: KernelModel, u: Vector, widths: Vector) -> tuple[State, int]:
        """Time update; ``widths`` belong to the columns of ``arrays.G``."""

    @abstractmethod
    def _meet_box(self, state: State, lower: Vector, upper: Vector) -> tuple[State, int]:
        """Keep the part of the set in a box."""

    @abstractmethod
    def _predict_output(self, state: State, r: Vector) -> OutputPrediction:
        """Interval of ``C x + v``."""

    @property
    def model(self) -> LSUModel:
        return self._model

    @property
    def support(self) -> Support:
        return self._make_support(self._state)

    def predict_output(self) -> OutputPrediction:
        return self._predict_output(self._state, self._arrays.r)

    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> Support:
        values = output_vector(y, self._model.output_count)
        widths = half_width_vector("r", r, self._arrays.r)
        state, status = self._update(self._state, self._arrays.C, values, widths)
        if status > 0:
            raise self._contradiction(values, widths, status)
        self._accept(state, status)
        return self.support

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> Support:
        step_model = same_states(self._model, model)
        arrays = self._arrays if model is None else kernel_model(step_model)
        center, half_widths = input_interval(u, step_model.input_count)
        widths = np.concatenate([half_width_vector("rho", rho, arrays.rho), half_widths])
        state, status = self._predict(self._state, arrays, center, widths)
        if status == 0 and step_model.domain is not None:
            state, status = self._meet_box(state, *_writable(step_model.domain.bounds()))
            if status > 0:
                raise InconsistentData(f"the prediction misses the domain in state {self._model.states[status - 1]}")
        self._accept(state, status)
        return self.support

    def condition(self, support: Support) -> float:
        if support.dim != self._model.state_count:
            raise ModelError(f"the set must have {self._model.state_count} coordinates, it has {support.dim}")
        before = self.support.log_volume()
        state = self._condition(self._state, support)
        after = self._make_support(state).log_volume()
        self._accept(state, 0)
        return max(0.0, before - after) if before > -math.inf else 0.0

    def _condition(self, state: State, support: Support) -> State:
        """The part of the set in ``support``: its interval hull first, then the faces of its parallelotopes."""
        state, status = self._meet_box(state, *_writable(support.bounds()))
        for P, y, r in faces(support):
            if status == 0:
                state, status = self._update(state, P, y, r)
        if status > 0:
            raise InconsistentData(f"the set of {self.kind} and the transferred set have no point in common")
        return state

    def reset(self, support: Support) -> None:
        self._state = self._enclose(checked_prior(self._model, support))

    def snapshot(self) -> object:
        return self._state

    def restore(self, snapshot: object) -> None:
        self._state = cast("State", snapshot)

    def _accept(self, state: State, status: int) -> None:
        if status < 0:
            raise UnboundedSupport(f"the set of {self.kind} has outgrown double precision; reset it from a known set")
        self._state = state

    def _contradiction(self, y: Vector, r: Vector, status: int) -> InconsistentData:
        """Name the strips that alone miss the set, else all strips up to the one that proved the contradiction."""
        interval = self._predict_output(self._state, r)
        gaps = np.maximum(interval.lower - y, y - interval.upper)
        alone = [int(k) for k in np.flatnonzero(gaps > 0)]
        names = self._model.outputs
        if alone:
            gap = float(gaps[alone[0]])
            listed = ", ".join(f"{names[k]} (by {gaps[k]:.3g})" for k in alone)
            return InconsistentData(f"outside its predicted interval: {listed}", alone, gap)
        rows = [k for k in range(status) if not math.isnan(y[k])]
        listed = ", ".join(names[k] for k in rows)
        return InconsistentData(f"the strips of {listed} and the prediction have no point in common", rows)


def faces(support: Support) -> list[tuple[Matrix, Vector, Vector]]:
    """Strips ``|y − P x| ≤ r`` that hold the set: the faces of the parallelotopes that it is made of (not of boxes)."""
    from lsu_mesh.supports.parallelotope import Parallelotope

    if isinstance(support, Parallelotope):
        strips = support.strips()
        return [] if strips is None else [strips]
    return [strips for part in getattr(support, "parts", ()) for strips in faces(part)]


def _writable(bounds: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
    return np.array(bounds[0]), np.array(bounds[1])
