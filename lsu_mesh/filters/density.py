"""The Kalman recursion (m, P) beside a filter's set, from which its point estimate is taken.

It is for output only: no set, bound or decision depends on it. Boxes and sets of others never enter it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.filters.point_rule import point_rule
from lsu_mesh.filters.validation import KernelModel, kernel_model
from lsu_mesh.kernels.filter_point import CENTRE, MEAN, NEAREST
from lsu_mesh.kernels.points import density as kernels
from lsu_mesh.kernels.points.room import Room, room
from lsu_mesh.kernels.points.stretch_noise import stretch_covariance
from lsu_mesh.kernels.run_tables import Estimates
from lsu_mesh.model import LSUModel

RULES = {"mean": MEAN, "nearest": NEAREST, "centre": CENTRE}
Bounds = Callable[[], tuple[Vector, Vector]]


class Density(NamedTuple):
    """Mean m (n,) and covariance P (n, n) of the state; neither is ever written again."""

    mean: Vector
    covariance: Matrix


class Drive(NamedTuple):
    """What drives a step: u (p,), a last 1 for an offset, the widths (q + p,), and whether rho is of this step only."""

    center: Vector
    widths: Vector
    has_rho: bool


class PointEstimate:
    """How the points of a filter come about: its rule, and the recursion of the density of the rule ``"mean"``.

    The density is a Kalman recursion: outputs with variance ``(r² + widening²)/3``, noise with ``N diag(rho²/3) N'``
    per step, or of a continuous model ``dt ∫₀ʰ e^{As} N diag(rho²/3) N' e^{A's} ds`` over a stretch h, dt being the
    length of the step of the filter's own model. It starts from the uniform distribution on a hull. Its target is the
    mean of N(m, P) truncated at the hull, which is not fed back. With another rule there is no density, ``None``.
    """

    def __init__(self, model: LSUModel, rule: str) -> None:
        self.rule = point_rule(rule)
        self.room: Room = room(model.state_count)
        self._state_count = model.state_count
        self._dt_ns = model.length_ns

    @property
    def code(self) -> int:
        """The rule as kernels take it."""
        return RULES[self.rule]

    def tables(self, densities: Sequence[Density | None]) -> Estimates:
        """The rule and copies of the densities (N of them), as compiled loops write them."""
        n = self._state_count
        blank = Density(np.zeros(n), np.zeros((n, n)))
        held = [blank if density is None else density for density in densities]
        return Estimates(
            rule=self.code,
            means=np.array([density.mean for density in held]),
            covariances=np.array([density.covariance for density in held]),
        )

    def started(self, lower: Vector, upper: Vector) -> Density | None:
        """The uniform distribution on the box [lower, upper] (n,)."""
        if self.rule != "mean":
            return None
        n = lower.size
        mean, P = np.empty(n), np.empty((n, n))
        kernels.start(np.array(lower), np.array(upper), mean, P)
        return Density(mean, P)

    def resumed(self, density: Density) -> Density | None:
        """A density that was published, where the rule goes by one."""
        if self.rule != "mean":
            return None
        return Density(np.array(density.mean), np.array(density.covariance))

    def updated(
        self, density: Density | None, arrays: KernelModel, y: Vector, *, widths: Vector, bounds: Bounds
    ) -> Density | None:
        """Data update with the strips ``|y − C x| ≤ widths`` (m,) that were used, NaN for none."""
        if density is None:
            return None
        mean, P = density.mean.copy(), density.covariance.copy()
        kernels.update(mean, P, arrays.C, np.array(y), np.array(widths), arrays.r, self.room)
        return self._checked(mean, P, bounds)

    def predicted(
        self, density: Density | None, model: LSUModel, arrays: KernelModel, drive: Drive, *, bounds: Bounds
    ) -> Density | None:
        """Time update by the model and input of this step."""
        if density is None:
            return None
        mean, P = density.mean.copy(), density.covariance.copy()
        columns, widths = arrays.rho.size, np.array(drive.widths)
        if drive.has_rho:
            Q = np.zeros_like(P)
            kernels.noise_covariance(arrays.G, widths[:columns].copy(), Q)
        else:
            Q = noise_covariance(model, self._dt_ns)
        kernels.predict(
            mean, P, arrays.A, arrays.B, np.array(drive.center), Q, arrays.G, widths, columns, self.room
        )  # fmt: skip
        return self._checked(mean, P, bounds)

    def target(self, density: Density | None, lower: Vector, upper: Vector, centre: Callable[[], Vector]) -> Vector:
        """What the point should be near to: the mean truncated at the box, or the ``centre`` of the set."""
        if density is None:
            return centre()
        point: NDArray[np.float64] = np.empty(lower.size)
        kernels.truncated_mean(*density, np.array(lower), np.array(upper), point, self.room)
        return point

    def _checked(self, mean: Vector, P: Matrix, bounds: Bounds) -> Density | None:
        """A density that has outgrown double precision starts again from the hull."""
        return Density(mean, P) if kernels.is_finite(mean, P) else self.started(*bounds())


@functools.lru_cache(maxsize=64)
def noise_covariance(model: LSUModel, dt_ns: int | None) -> Matrix:
    """Covariance (n, n) of the noise of a step of this model; of a stretch of a continuous one by steps of ``dt_ns``.

    Without ``dt_ns`` the stretch itself counts as one step.
    """
    n = model.state_count
    Q = np.zeros((n, n))
    if model.flow is None or model.length_ns is None:
        arrays = kernel_model(model)
        kernels.noise_covariance(arrays.G, arrays.rho, Q)
        return Q
    A, _, N, rho = model.flow.arrays
    dt = 1e-9 * (model.length_ns if dt_ns is None else dt_ns)
    stretch_covariance(A, N, rho, 1e-9 * model.length_ns, Q)
    return np.asarray(dt * Q)
