"""The Kalman filter, for comparison: Gaussian noise of the same variance as the uniform one."""

from __future__ import annotations

from typing import ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, ModelError, UnboundedSupport
from lsu_mesh.filters.filter import Filter, GainOf, Guarantee, OutputPrediction
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.plain_outputs import plain_strips, shifted
from lsu_mesh.filters.point_rule import PointOption, PointRule, point_rule
from lsu_mesh.filters.transfer_gain import conditioned, hull_gain
from lsu_mesh.filters.validation import checked_prior, driven, kernel_model, same_states, step_arrays
from lsu_mesh.kernels.zonotopes.time_update import image_of_box
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

Box = tuple[Vector, Vector]


class Gaussian(NamedTuple):
    """Mean (n,) and covariance (n, n); neither is ever written again."""

    mean: Vector
    covariance: Matrix


def uniform_variance(half_widths: ArrayLike) -> Vector:
    """Variance ``h²/3`` of a uniform distribution of half-width h."""
    return np.asarray(half_widths, dtype=np.float64) ** 2 / 3.0


class Kalman(Filter):
    """``x̂ ← x̂ + K (y − C x̂)``, ``P ← (I − K C) P (I − K C)' + K R K'``; then ``A x̂ + B u``, ``A P A' + N Q N'``.

    Parameters
    ----------
    model, prior:
        LSU model with n states, ``Q = diag(rho²/3)``, ``R = diag(r²/3)``; a set, or a pair (lower, upper), whose box
        gives mean and variance of x_1.
    sigmas:
        The published box is ``x̂ ± sigmas · √diag P``. It is *no* guaranteed bound.
    point:
        The rule of the point estimate, of any of which the mean is the point: it is the centre of the box.

    Raises
    ------
    ModelError
        Names the option or the prior that is wrong.

    Transferred sets are kept beside the density, as a box that interval arithmetic carries on; what is published is
    truncated at it. The density takes nothing from them: the same set twice is no second measurement.

    Source: Kalman 1960, in Joseph's form.
    """

    kind: ClassVar[str] = "Kalman"
    guarantee: ClassVar[Guarantee] = "none"
    conditioning: ClassVar[int] = 2
    _held: Gaussian
    _box: Box | None
    """What was transferred, carried on; ``None``: nothing was."""

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        sigmas: float = 3.0,
        point: PointOption = "mean",
    ) -> None:
        if not (np.isfinite(sigmas) and sigmas > 0):
            raise ModelError(f"sigmas must be a number > 0, it is {sigmas}")
        self._model = model
        self._arrays = kernel_model(model)
        self._sigmas = sigmas
        self._point_rule = point_rule(point)
        self.reset(checked_prior(model, prior))

    @property
    def model(self) -> LSUModel:
        """The model in force when no step says otherwise."""
        return self._model

    @property
    def support(self) -> Orthotope:
        """The box :meth:`bounds`."""
        return Orthotope(*self.bounds())

    @property
    def point(self) -> Vector:
        """Mean (n,), moved into what was transferred."""
        return _within(self._held.mean, self._box)

    @property
    def point_rule(self) -> PointRule:
        """The rule of :attr:`point`."""
        return self._point_rule

    @property
    def covariance(self) -> Matrix:
        """P (n, n)."""
        return np.array(self._held.covariance)

    def bounds(self) -> tuple[Vector, Vector]:
        """``x̂ ± sigmas · √diag P``, truncated at what was transferred, (n,), (n,); *not* guaranteed."""
        mean, covariance = self._held
        reach = self._sigmas * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return _within(mean - reach, self._box), _within(mean + reach, self._box)

    def predict_output(self, u: ArrayLike | Orthotope | None = None, model: LSUModel | None = None) -> OutputPrediction:
        """``C x̂ ± sigmas · √diag(C P C' + R)``, truncated at what was transferred; *not* guaranteed."""
        mean, covariance = self._held
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        C = arrays.C
        variance = np.einsum("ij,jk,ik->i", C, covariance, C) + uniform_variance(arrays.r)
        reach = self._sigmas * np.sqrt(np.maximum(variance, 0.0))
        band = [C @ mean - reach, C @ mean + reach, C @ mean]
        if self._box is not None:
            low, high = image_of_box(C, *self._box)
            band = [np.clip(side, low - arrays.r, high + arrays.r) for side in band]
        return shifted(OutputPrediction(*band), used, u)

    def update(
        self,
        y: ArrayLike,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> Orthotope:
        """Data update with y (m,), NaN where missing; it never contradicts, a period's nearest multiple is taken."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        values, widths = plain_strips(used, arrays, y, r=r, u=u, image=self._mean_output, is_strict=False)
        known = ~np.isnan(values)
        if known.any():
            self._held = corrected(self._held, arrays.C[known], values[known], uniform_variance(widths)[known])
        return self.support

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> Orthotope:
        """Time update; an interval of inputs counts as uniform noise."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        center, widths = driven(used, arrays, u, rho=rho, bounds=self.bounds)
        if self._box is not None:
            self._box = self._carried(self._box, u, rho, model)
        mean, P = self._held
        noise = (arrays.G * uniform_variance(widths)) @ arrays.G.T
        self._held = Gaussian(arrays.A @ mean + arrays.B @ center, arrays.A @ P @ arrays.A.T + noise)
        return self.support

    def _carried(
        self, box: Box, u: ArrayLike | Orthotope | None, rho: ArrayLike | None, model: LSUModel | None
    ) -> Box | None:
        """The box one step later; ``None`` where it leaves the domain or all numbers: it says nothing any more."""
        later = LSUO(self._model, Orthotope(*box))
        try:
            later.predict(u, rho, model)
        except (InconsistentData, UnboundedSupport):
            return None
        return later.bounds()

    def _mean_output(self, C: Matrix) -> tuple[Vector, Vector]:
        """``C x̂`` as an interval of no width: of a periodic output the multiple nearest to it is taken."""
        return C @ self._held.mean, C @ self._held.mean

    def condition(self, support: Support, gain: GainOf | None = "support") -> float:
        """Bayesian transfer: keep the box of ``support`` beside the density; see :class:`Filter`."""
        return conditioned(self, support, gain, self._condition)

    def _condition(self, support: Support) -> float:
        """Meet the box beside the density with that of ``support``; the gain is that of the published boxes.

        Raises ``InconsistentData`` where the published box and that of ``support`` have no point in common.
        """
        lower, upper = checked_prior(self._model, support).bounds()
        before = self.bounds()
        if (np.maximum(lower, before[0]) > np.minimum(upper, before[1])).any():
            raise InconsistentData(f"the box of {self.kind} and the transferred set have no point in common")
        own = self._box
        self._box = (lower, upper) if own is None else (np.maximum(own[0], lower), np.minimum(own[1], upper))
        return hull_gain(before, self.bounds())

    def reset(self, support: Support) -> None:
        """Start again with mean and variance of the uniform distribution on the box of ``support``."""
        lower, upper = checked_prior(self._model, support).bounds()
        self._held = Gaussian(0.5 * (lower + upper), np.diag(uniform_variance(0.5 * (upper - lower))))
        self._box = None

    def snapshot(self) -> object:
        """Mean, covariance and what was transferred."""
        return self._held, self._box

    def restore(self, snapshot: object) -> None:
        """Return to a state taken by :meth:`snapshot`, bit by bit."""
        self._held, self._box = cast("tuple[Gaussian, Box | None]", snapshot)


def corrected(held: Gaussian, C: Matrix, y: Vector, variances: Vector) -> Gaussian:
    """Data update by outputs y (m,) with independent noise; one at a time, so that no matrix is inverted."""
    mean, P = np.array(held.mean), np.array(held.covariance)
    for row, value, variance in zip(C, y, variances, strict=True):
        spread = P @ row
        total = row @ spread + variance
        if total <= 0.0:
            continue
        K = spread / total
        mean = mean + K * (value - row @ mean)
        left = np.eye(len(mean)) - np.outer(K, row)
        P = left @ P @ left.T + variance * np.outer(K, K)
    return Gaussian(mean, 0.5 * (P + P.T))


def _within(x: Vector, box: Box | None) -> Vector:
    """x (n,) moved into a box."""
    return np.array(x) if box is None else np.clip(x, *box)
