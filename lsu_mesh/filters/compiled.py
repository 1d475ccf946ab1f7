"""What the filters with a compiled step have in common: checks, errors, and the order of the steps."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Literal, NamedTuple, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Array, Matrix, Stack, Vector
from lsu_mesh.errors import InconsistentData, ModelError, UnboundedSupport
from lsu_mesh.filters.compiled_loop import CompiledLoop, LoopData, LoopResult
from lsu_mesh.filters.density import Density, Drive, PointEstimate
from lsu_mesh.filters.filter import GainOf, OutputPrediction
from lsu_mesh.filters.inconsistency import known_to_last_bits, strip_contradiction
from lsu_mesh.filters.plain_outputs import plain_strips, shifted
from lsu_mesh.filters.point_rule import PointOption, PointRule
from lsu_mesh.filters.transfer_gain import MAX_SWEEPS, SETTLED, conditioned
from lsu_mesh.filters.validation import (
    KernelModel,
    checked_prior,
    driven,
    kernel_model,
    same_states,
    step_arrays,
)
from lsu_mesh.kernels import batch_run, filter_point, filter_step, run_tables
from lsu_mesh.kernels.points.room import room
from lsu_mesh.kernels.runtime.scratch import Scratch, scratch
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Ties = Literal["old", "new"]
"""Which of two strips of equal width stays in a strip update (Vicino & Zappa 1996)."""


def ties_option(ties: Ties) -> int:
    """The bit of a filter's option; ``ModelError`` for another word."""
    if ties not in get_args(Ties):
        raise ModelError(f'ties must be "old" or "new", not {ties!r}')
    return filter_step.TIES if ties == "new" else 0


class Snapshot(NamedTuple):
    """A state, the density beside it, and the set that was met last where the state is what came of it."""

    state: Matrix
    density: Density | None
    met: Support | None


class CompiledFilter(CompiledLoop):
    """A filter whose steps are those of ``kernels/filter_step.py`` for its ``family`` and ``option``.

    The state is a matrix with rows of length n. It is never written again once it is in force, so that a snapshot holds
    the matrix itself.
    """

    family: ClassVar[int]
    conditioning: ClassVar[int] = 2
    option: int
    _met: tuple[Matrix, Support] | None = None
    """The set that was met last, with the state that came of it."""
    _density: Density | None
    _state: Matrix

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        option: int,
        point: PointOption = "mean",
    ) -> None:
        self.option = option
        self._model = model
        self._arrays = kernel_model(model)
        self._estimate = PointEstimate(model, point)
        self._work = self._scratch(self._arrays.G.shape[1])
        self.reset(checked_prior(model, prior))

    @staticmethod
    @abstractmethod
    def _enclose(support: Support) -> Matrix:
        """The state that holds ``support``."""

    @staticmethod
    @abstractmethod
    def _make_support(state: Matrix) -> Support:
        """The set that a state stands for."""

    def _start(self, support: Support) -> Matrix:
        """The state that holds ``support``, by this filter's options."""
        return self._enclose(support)

    @property
    def model(self) -> LSUModel:
        return self._model

    @property
    def support(self) -> Support:
        return self._make_support(self._state)

    @property
    def point(self) -> Vector:
        return self._located(self._state, self._density)

    @property
    def point_rule(self) -> PointRule:
        return self._estimate.rule

    @property
    def density(self) -> Density | None:
        return self._density

    def bounds(self) -> tuple[Vector, Vector]:
        _, lower, upper, _ = self._describe(self._state)
        return lower, upper

    def volume(self) -> float:
        return self._describe(self._state)[3]

    def predict_output(self, u: ArrayLike | Orthotope | None = None, model: LSUModel | None = None) -> OutputPrediction:
        used, arrays = (self._model, self._arrays) if model is None else self._of_step(model)
        interval = self._predict_output(arrays.C, arrays.r)
        if self._estimate.rule != "centre":
            interval = interval._replace(point=self._output_point(arrays.C))
        return shifted(interval, used, u)

    def update(
        self,
        y: ArrayLike,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> Support:
        used, arrays = (self._model, self._arrays) if model is None else self._of_step(model)
        strips = plain_strips(used, arrays, y, r=r, u=u, image=self._image)
        if np.isnan(strips[0]).all():
            return self.support
        state, status = self._cut(self._state, arrays.C, *strips)
        if status > 0:
            rounded = known_to_last_bits(arrays.C, *strips, self.bounds())
            state, wider_status = self._cut(self._state, arrays.C, strips[0], rounded)
            status = wider_status if wider_status <= 0 else status
        if status > 0:
            raise self._contradiction(used, arrays.C, *strips, status)
        self._accept(state, status)
        self._density = self._estimate.updated(self._density, arrays, strips[0], widths=strips[1], bounds=self.bounds)
        return self.support

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> Support:
        step_model, arrays = (self._model, self._arrays) if model is None else self._of_step(model)
        center, widths = driven(step_model, arrays, u, rho=rho, bounds=self.bounds)
        work = self._work if widths.size == self._arrays.G.shape[1] else self._scratch(widths.size)
        state = np.empty_like(self._state)
        status = filter_step.advance(
            filter_step.PREDICT, self.family, self.option, self._state, self._arrays.C, center, center,
            arrays.A, arrays.B, center, arrays.G, widths, state, work,
        )  # fmt: skip
        if status > 0:
            raise InconsistentData(f"the sets of {self.kind} are proved to have no point in common")
        if status == 0 and step_model.domain is not None:
            state, status = self._meet_box(state, step_model.domain)
            if status > 0:
                name = self._model.states[status - 1]
                raise InconsistentData(f"the prediction misses the domain in state {name}")
        self._accept(state, status)
        drive = Drive(center, widths, has_rho=rho is not None)
        self._density = self._estimate.predicted(self._density, step_model, arrays, drive, bounds=self.bounds)
        return self.support

    def condition(self, support: Support, gain: GainOf | None = "support") -> float:
        """Bayesian transfer: keep ``self ∩ support``, or a set of this class that holds it; see :class:`Filter`."""
        return conditioned(self, support, gain, self._condition)

    def _condition(self, support: Support) -> float:
        """Meet the box of ``support`` and its faces, again until that gains no more."""
        if support.dim != self._model.state_count:
            raise ModelError(f"the set must have {self._model.state_count} coordinates, it has {support.dim}")
        hull, strips = support.interval_hull(), faces(support)
        before = size = self._log_volume(self._state)
        state = self._state
        for sweep in range(MAX_SWEEPS):
            swept = self._swept(state, hull, strips)
            left = self._log_volume(swept)
            does_gain = size - left >= SETTLED  # of flat sets it is not known
            if does_gain or sweep == 0:
                state, size = swept, left
            if not does_gain:
                break
        self._state = state
        return max(0.0, before - size) if before > -math.inf else 0.0

    def _swept(self, state: Matrix, hull: Orthotope, strips: list[tuple[Matrix, Vector, Vector]]) -> Matrix:
        """The part of a state in a box and in strips, one after the other."""
        state, status = self._meet_box(state, hull)
        for P, y, r in strips:
            if status == 0:
                state, status = self._cut(state, P, y, r)
        if status > 0:
            raise InconsistentData(f"the set of {self.kind} and the transferred set have no point in common")
        self._check_size(status)
        return state

    @property
    def last_met(self) -> Support | None:
        """The set that was met last, where the state in force is the one that came of it.

        An equal state that came of something else, as of a time update of a state at rest, does not count: replay would
        have to know of it.
        """
        return self._met[1] if self._met is not None and self._met[0] is self._state else None

    @last_met.setter
    def last_met(self, support: Support) -> None:
        self._met = (self._state, support)

    def reset(self, support: Support) -> None:
        self._state = self._start(checked_prior(self._model, support))
        self._density = self._estimate.started(*self.bounds())

    def resume(self, support: Support, lower: Vector, upper: Vector) -> None:
        self._state = self._continued(checked_prior(self._model, support), lower, upper)
        self._density = self._estimate.started(lower, upper)

    def take_density(self, density: Density) -> None:
        self._density = self._estimate.resumed(density)

    def _continued(self, support: Support, lower: Vector, upper: Vector) -> Matrix:
        """The state that published this support and these bounds."""
        return self._start(support)

    @property
    def is_resumable(self) -> bool:
        """Support and bounds tell the whole state."""
        return True

    def snapshot(self) -> Snapshot:
        return Snapshot(self._state, self._density, self.last_met)

    def restore(self, snapshot: object) -> None:
        self._state, self._density, met = cast("Snapshot", snapshot)
        self._met = None if met is None else (self._state, met)

    @property
    def loop_state(self) -> Array:
        return self._state.copy()

    def hold_loop_state(self, state: Array, density: Density | None) -> None:
        self._state, self._density = state, density

    def run_states(
        self, states: Array, models: run_tables.Models, estimates: run_tables.Estimates, data: LoopData,
        result: LoopResult, first: int, last: int, kept: Stack,
    ) -> None:  # fmt: skip
        n = self._model.state_count
        batch_run.sweep(
            self.family, self.option, data.updates, data.last_prediction, states, np.empty_like(self._state), models,
            data.Y, data.U, result.record, result.outcome, first, last, self._scratch(models.G.shape[2]), estimates,
            data.points, room(n),
        )  # fmt: skip

    def estimates(self, densities: Sequence[Density | None]) -> run_tables.Estimates:
        return self._estimate.tables(densities)

    def _of_step(self, model: LSUModel) -> tuple[LSUModel, KernelModel]:
        return same_states(self._model, model), step_arrays(model)

    def _scratch(self, noise_columns: int) -> Scratch:
        return scratch(self._model.state_count, noise_columns)

    def _cut(self, state: Matrix, P: Matrix, y: Vector, r: Vector) -> tuple[Matrix, int]:
        """The part of ``state`` in the strips ``|y − P x| ≤ r``, and the status of the kernel."""
        return self._restrict(filter_step.UPDATE, state, P, first=y, second=r)

    def _meet_box(self, state: Matrix, box: Orthotope) -> tuple[Matrix, int]:
        """The part of ``state`` in a box, and the status of the kernel."""
        return self._restrict(
            filter_step.MEET_BOX, state, self._arrays.C, first=np.array(box.lower), second=np.array(box.upper)
        )

    def _restrict(self, action: int, state: Matrix, P: Matrix, first: Vector, second: Vector) -> tuple[Matrix, int]:
        new = np.empty_like(state)
        a = self._arrays
        status = filter_step.advance(
            action, self.family, self.option, state, P, first, second,
            a.A, a.B, a.rho, a.G, a.rho, new, self._work,
        )  # fmt: skip
        return new, status

    def _describe(self, state: Matrix) -> tuple[Vector, Vector, Vector, float]:
        n = self._model.state_count
        point, lower, upper = np.empty(n), np.empty(n), np.empty(n)
        return point, lower, upper, filter_step.describe(self.family, state, point, lower, upper, self._work)

    def _located(self, state: Matrix, density: Density | None) -> Vector:
        """The point of a state by the rule."""
        point, lower, upper, _ = self._describe(state)
        rule, (mean, P) = self._estimate.code, self.estimates([density])[1:]
        filter_point.locate(self.family, rule, state, mean[0], P[0], lower, upper, point, self._estimate.room)
        return point

    def _output_point(self, C: Matrix) -> Vector:
        """``C x`` of the point x, as the compiled loop computes it."""
        point, y = np.empty(self._model.state_count), np.empty(len(C))
        rule, (mean, P) = self._estimate.code, self.estimates([self._density])[1:]
        filter_point.locate_output(
            self.family, rule, self._state, mean[0], P[0], C, point, y, self._work, self._estimate.room
        )
        return y

    def _log_volume(self, state: Matrix) -> float:
        return filter_step.log_volume(self.family, state, self._work)

    def _predict_output(self, C: Matrix, r: Vector) -> OutputPrediction:
        lower, upper, point = np.empty(r.size), np.empty(r.size), np.empty(r.size)
        filter_step.predict_output(self.family, self._state, C, r, lower, upper, point, self._work)
        return OutputPrediction(lower, upper, point)

    def _image(self, C: Matrix) -> tuple[Vector, Vector]:
        """Bounds of ``C x``."""
        interval = self._predict_output(C, np.zeros(len(C)))
        return interval.lower, interval.upper

    def _accept(self, state: Matrix, status: int) -> None:
        self._check_size(status)
        self._state = state

    def _check_size(self, status: int) -> None:
        if status < 0:
            raise UnboundedSupport(f"the set of {self.kind} has outgrown double precision; reset it from a known set")

    def _contradiction(self, model: LSUModel, C: Matrix, y: Vector, r: Vector, status: int) -> InconsistentData:
        """Names the strips up to the one that proved the contradiction."""
        interval = self._predict_output(C, r)
        return strip_contradiction(
            model.outputs[:status],
            interval.lower[:status],
            interval.upper[:status],
            y=y[:status],
            r=np.zeros(status),
        )


def faces(support: Support) -> list[tuple[Matrix, Vector, Vector]]:
    """Strips ``|y − P x| ≤ r`` that hold the set: the faces of the parallelotopes that it is made of (not of boxes)."""
    from lsu_mesh.supports.parallelotope import Parallelotope

    if isinstance(support, Parallelotope):
        strips = support.strips()
        return [] if strips is None else [strips]
    return [strips for part in getattr(support, "parts", ()) for strips in faces(part)]
