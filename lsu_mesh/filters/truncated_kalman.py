"""The Kalman filter whose density is truncated at the physical limits of the states."""

from __future__ import annotations

import math
from typing import ClassVar, cast

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.filters.kalman import Box, Gaussian, Kalman
from lsu_mesh.filters.point_rule import PointOption
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support

NARROW = 1e-4
"""An interval narrower than this is one of a uniform density: the formula would lose all digits."""
ROOT_2 = math.sqrt(2.0)


class TruncatedKalman(Kalman):
    """:class:`~lsu_mesh.filters.kalman.Kalman`, truncated at ``model.domain`` after each data update.

    Parameters
    ----------
    model, prior, sigmas:
        As for the Kalman filter; the model needs a domain.
    feedback:
        Whether the truncated density is what the next step starts from; else it is an output only.
    point:
        The rule of the point estimate: the mean, met with the domain; but for ``"centre"`` met with the box, too.

    Raises
    ------
    ModelError
        The model has no domain, or an option is wrong.

    Source: Simon & Simon 2010. In one dimension, with the density N(0, 1) truncated at [c, d], the mean is
    ``μ = (φ(c) − φ(d)) / (Φ(d) − Φ(c))`` and the variance ``1 + (c φ(c) − d φ(d)) / (Φ(d) − Φ(c)) − μ²``.
    """

    kind: ClassVar[str] = "TruncatedKalman"
    _full: Gaussian

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        sigmas: float = 3.0,
        feedback: bool = True,
        point: PointOption = "mean",
    ) -> None:
        if model.domain is None:
            raise ModelError("TruncatedKalman truncates at the model's domain; give the model one")
        self._lower, self._upper = model.domain.bounds()
        self._feedback = feedback
        super().__init__(model, prior, sigmas, point)

    @property
    def point(self) -> Vector:
        """Mean (n,) of the truncated density; a later coordinate's truncation may move an earlier one, so it is met
        with the domain once more, and with what was transferred."""
        lower, upper = self._lower, self._upper
        if self._point_rule != "centre":
            low, high = self.bounds()
            low, high = np.maximum(low, lower), np.minimum(high, upper)
            meets = low <= high  # before the truncation the box may miss the domain
            lower, upper = np.where(meets, low, lower), np.where(meets, high, upper)
        inside = np.clip(self._held.mean, lower, upper)
        return inside if self._box is None else np.clip(inside, *self._box)

    @property
    def untruncated(self) -> Gaussian:
        """The density before the truncation of the last data update."""
        return self._full

    def update(
        self,
        y: ArrayLike,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> Orthotope:
        """Data update with y (m,), NaN where missing, then the truncation."""
        if not self._feedback:
            self._held = self._full
        super().update(y, r, model, u)
        self._full = self._held
        self._held = truncated(self._held, self._lower, self._upper)
        return self.support

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> Orthotope:
        """Time update of the truncated density, or of the full one without feedback."""
        if not self._feedback:
            self._held = self._full
        super().predict(u, rho, model)
        self._full = self._held
        return self.support

    def reset(self, support: Support) -> None:
        super().reset(support)
        self._full = self._held

    def snapshot(self) -> object:
        return self._held, self._full, self._box

    def restore(self, snapshot: object) -> None:
        self._held, self._full, self._box = cast("tuple[Gaussian, Gaussian, Box | None]", snapshot)


def truncated(held: Gaussian, lower: Vector, upper: Vector) -> Gaussian:
    """Mean and covariance after the truncation at ``lower <= x <= upper`` (n,), coordinate after coordinate.

    With s² = P_ii, p = P e_i / s and the mean μ and variance v of the truncated standard normal:
    ``x̂ ← x̂ + μ p``, ``P ← P − (1 − v) p p'``. That is the rotation to the limit and back of Simon & Simon 2010,
    written out.
    """
    mean, P = np.array(held.mean), np.array(held.covariance)
    for i in range(mean.size):
        s = np.sqrt(max(P[i, i], 0.0))
        if not s > 0.0:
            mean[i] = min(max(mean[i], lower[i]), upper[i])
            continue
        mu, variance = truncated_normal((lower[i] - mean[i]) / s, (upper[i] - mean[i]) / s)
        p = P[:, i] / s
        mean = mean + mu * p
        P = P - (1.0 - variance) * np.outer(p, p)
    return Gaussian(mean, 0.5 * (P + P.T))


def truncated_normal(c: float, d: float) -> tuple[float, float]:
    """Mean and variance of N(0, 1) truncated at [c, d], also far out in a tail."""
    if c + d < 0.0:
        mean, variance = truncated_normal(-d, -c)
        return -mean, variance
    if d - c < NARROW / max(1.0, abs(c)):
        return 0.5 * (c + d), (d - c) ** 2 / 12.0
    if c <= 0.0:
        mass = 0.5 * (math.erf(d / ROOT_2) - math.erf(c / ROOT_2))
        low, high = _density(c) / mass, _density(d) / mass
    else:  # in units of the density at c, which may be too small for a number
        decay = math.exp(0.5 * (c - d) * (c + d)) if math.isfinite(d) else 0.0
        mass = math.sqrt(0.5 * math.pi) * (_scaled_tail(c) - (decay * _scaled_tail(d) if decay > 0.0 else 0.0))
        low, high = 1.0 / mass, decay / mass
    mean = min(max(low - high, c), d)
    variance = 1.0 + (c * low if low > 0.0 else 0.0) - (d * high if high > 0.0 else 0.0) - mean * mean
    return mean, min(max(variance, 0.0), 1.0)


def _density(x: float) -> float:
    return math.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)


def _scaled_tail(x: float) -> float:
    """``exp(x²/2) erfc(x/√2)``"""
    from scipy.special import erfcx

    return float(erfcx(x / ROOT_2))
