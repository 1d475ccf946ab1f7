"""Every set filter on a nonlinear model: each step is a linear one that encloses it."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.density import Density
from lsu_mesh.filters.filter import Filter, GainOf, Guarantee, OutputPrediction
from lsu_mesh.filters.point_rule import PointRule
from lsu_mesh.filters.validation import half_width_vector, input_interval, output_vector
from lsu_mesh.model import LSUModel
from lsu_mesh.nonlinear.model import NonlinearModel
from lsu_mesh.nonlinear.steps import data_step, time_step
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

MAX_PASSES = 4
MIN_GAIN = 0.02
"""A pass that narrows the hull by less than this share, summed over the states, is the last."""


class NonlinearFilter(Filter):
    """A filter of ``x⁺ = f(x, u, w)``, ``y = g(x, u) + v`` that holds the set of another class.

    Each time update takes ``x⁺ ∈ A x + a + N w`` that holds f over the hull of the set, each data update strips that
    hold g over it (:mod:`lsu_mesh.nonlinear.steps`). The data update is done again over the smaller hull, from the set
    before the data, at most ``MAX_PASSES`` times in all; the narrowest result stays. So the sets hold the state
    whenever the bounds hold, whatever the curvature; a wide hull makes them wide.

    Parameters
    ----------
    base:
        The class of the set: ``LSUPB``, ``LSUCZ``, any :class:`Filter` whose steps take a model.
    model:
        The system.
    prior:
        A set, or a pair (lower, upper), that holds x_1.
    options:
        What the class takes besides, such as ``complexity=(20, 8)``.

    A model all of whose rows are affine gives the bits of ``base(model.linear, prior)``. Source: Rego et al. 2020 for
    the mean value and Taylor extensions of sets; the choice row by row and the passes are this library's own.
    """

    kind: ClassVar[str] = "NonlinearFilter"
    guarantee: ClassVar[Guarantee] = "declared"

    def __init__(
        self, base: type[Filter], model: NonlinearModel, prior: Support | tuple[ArrayLike, ArrayLike], **options: Any
    ) -> None:
        if not isinstance(model, NonlinearModel):
            raise ModelError(f"NonlinearFilter takes a NonlinearModel, not {model!r}")
        if model.is_continuous:
            raise ModelError("NonlinearFilter takes a discrete model; this one says rates")
        if base.guarantee != "declared":
            raise ModelError(f"{base.kind} holds estimates, not guaranteed sets; take LSUPB or LSUCZ for example")
        self.system = model
        self.filter = base(model.nominal, prior, **options)  # type: ignore[call-arg]
        self.not_enclosed = 0
        """Rows of data so far that were left out, as the hull left the domain of a function."""

    # -- steps

    def predict_output(self, u: ArrayLike | Orthotope | None = None, model: LSUModel | None = None) -> OutputPrediction:
        self._refuse(model)
        if self.system.linear is not None:
            return self.filter.predict_output(u)
        step, holds = data_step(self.system, *self.bounds(), *self._seen(u), r=np.array(self.model.r))
        found = self.filter.predict_output(model=step)
        for i, is_enclosed in enumerate(holds):
            if not is_enclosed:
                found.lower[i], found.upper[i], found.point[i] = -np.inf, np.inf, np.nan
        return found

    def update(
        self,
        y: ArrayLike,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> Support:
        self._refuse(model)
        if self.system.linear is not None:
            return self.filter.update(y, r, u=u)
        values, widths = output_vector(y, self.system.output_count), half_width_vector("r", r, np.array(self.model.r))
        if np.isnan(values).all():
            return self.support
        before, u_box = self.filter.snapshot(), self._seen(u)
        lower, upper = self.bounds()
        best = before
        try:
            for number in range(MAX_PASSES):
                self.filter.restore(before)
                step, holds = data_step(self.system, lower, upper, *u_box, r=widths)
                if number == 0:
                    self.not_enclosed += sum(not one and not np.isnan(v) for one, v in zip(holds, values, strict=True))
                self.filter.update(np.where(holds, values, np.nan), np.array(step.r), model=step)
                now = self.filter.bounds()
                found = _relative_size(*now, lower, upper)
                if found < 1.0 or number == 0:
                    best = self.filter.snapshot()
                lower, upper = np.maximum(lower, now[0]), np.minimum(upper, now[1])
                if found > 1.0 - MIN_GAIN:
                    break
        except InconsistentData:
            self.filter.restore(before)
            raise
        self.filter.restore(best)
        return self.support

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> Support:
        self._refuse(model)
        if self.system.linear is not None:
            return self.filter.predict(u, rho)
        if rho is not None:
            raise ModelError("the noise bounds of one step of a nonlinear model cannot be given; make another model")
        return self.filter.predict(model=time_step(self.system, *self.bounds(), *self._input(u)))

    def _refuse(self, model: LSUModel | None) -> None:
        if model is not None:
            raise ModelError("a nonlinear filter takes no model of one step")

    def _seen(self, u: ArrayLike | Orthotope | None) -> tuple[Vector, Vector]:
        """The box of the input where an output has one; else it is not read."""
        return self._input(u if self.system.sees_inputs else np.zeros(self.system.input_count))

    def _input(self, u: ArrayLike | Orthotope | None) -> tuple[Vector, Vector]:
        if isinstance(u, Orthotope):
            input_interval(u, self.system.input_count)  # checks the size
            return np.array(u.lower), np.array(u.upper)
        middle, _ = input_interval(u, self.system.input_count)
        return middle, middle

    # -- what the set's class says

    @property
    def model(self) -> LSUModel:
        return self.filter.model

    @property
    def support(self) -> Support:
        return self.filter.support

    @property
    def point(self) -> Vector:
        return self.filter.point

    @property
    def point_rule(self) -> PointRule:
        return self.filter.point_rule

    @property
    def density(self) -> Density | None:
        return self.filter.density

    def bounds(self) -> tuple[Vector, Vector]:
        return self.filter.bounds()

    def volume(self) -> float:
        return self.filter.volume()

    def condition(self, support: Support, gain: GainOf | None = "support") -> float:
        return self.filter.condition(support, gain)

    @property
    def last_met(self) -> Support | None:
        return self.filter.last_met

    @last_met.setter
    def last_met(self, support: Support) -> None:
        self.filter.last_met = support

    def reset(self, support: Support) -> None:
        self.filter.reset(support)

    def resume(self, support: Support, lower: Vector, upper: Vector) -> None:
        self.filter.resume(support, lower, upper)

    def take_density(self, density: Density) -> None:
        self.filter.take_density(density)

    @property
    def is_resumable(self) -> bool:
        return self.filter.is_resumable

    def snapshot(self) -> object:
        return self.filter.snapshot()

    def restore(self, snapshot: object) -> None:
        self.filter.restore(snapshot)


def _relative_size(lower: Vector, upper: Vector, low: Vector, high: Vector) -> float:
    """The mean over the states of the width of one box ÷ that of another; 1 for a state without width."""
    widths, before = upper - lower, high - low
    return float(np.mean(np.divide(widths, before, out=np.ones_like(widths), where=before > 0.0)))
