"""LSU-CZ: the filter whose support is a constrained zonotope."""

from __future__ import annotations

import functools
from functools import partial
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, ModelError, UnboundedSupport
from lsu_mesh.filters.constrained_intersection import joined
from lsu_mesh.filters.density import Density, Drive, PointEstimate
from lsu_mesh.filters.filter import Filter, GainOf, Guarantee, OutputPrediction
from lsu_mesh.filters.inconsistency import strip_contradiction
from lsu_mesh.filters.plain_outputs import plain_strips, shifted
from lsu_mesh.filters.point_rule import PointOption, PointRule
from lsu_mesh.filters.transfer_gain import hull_gain, measured
from lsu_mesh.filters.validation import checked_prior, driven, kernel_model, same_states, step_arrays
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_strips
from lsu_mesh.kernels.zonotopes.time_update import image_of_box, predict_constrained
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.arrays import box_volume
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.nearest_point import nearest_point, nearest_to_center
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.reduction import Body, Limits, settle
from lsu_mesh.supports.support import Support

LITTLE_GAIN = 0.03
"""Nats below which a transferred set is weighed against what the reduction of the intersection costs."""


GENERATORS, GENERATORS_PER_STATE = 20, 3
"""Generators of a set at least, and for each state, where the user states no limit."""
MAX_EXACT_VOLUME = 3
"""Dimension up to which :meth:`LSUCZ.volume` enumerates vertices; ``support.volume()`` does so up to 6."""


class Held(NamedTuple):
    """What the filter knows: the state lies in the set with arrays ``body`` = (c, G, A, b) and in [lower, upper]."""

    body: Body
    lower: Vector
    upper: Vector
    is_hull: bool
    """Whether the box is the meet with the interval hull of the set already."""
    density: Density | None = None
    """Beside the set, for the point estimate; ``None`` in a set on the way: it then keeps the one in force."""


class LSUCZ(Filter):
    """``X_{k|k} = X_{k|k−1} ∩ {|y − C x| ≤ r}``,  ``X_{k+1|k} = A X_{k|k} ⊕ B u ⊕ N box(rho)`` (P2023 (15), (16)).

    Parameters
    ----------
    model, prior:
        LSU model with n states; a set, or a pair (lower, upper), that holds x_1.
    max_generators, max_constraints:
        Complexity of the posterior support (P2023, Algorithm 1): at least n generators, ``None`` stands for
        ``max(20, 3 n)``; as many constraints, ``None`` is no limit. A prediction has up to one generator per noise and
        state more, until the next data update.
    point:
        The point estimate: ``"mean"``: of the truncated density beside the set, moved into it; ``"nearest"``: the point
        of the support that is nearest to the centre of its generators' box (Method 2); ``"centre"``: that of the
        interval hull (Method 1), which may lie outside.
    reduce:
        ``False``: no limit of either kind, the set grows with every step.

    Raises
    ------
    ModelError
        Names the option or the prior that is wrong.

    Beside the constrained zonotope the filter holds a box: the interval hull *before* each reduction, carried on by
    interval arithmetic. :meth:`bounds` is the meet of that box and the hull of :attr:`support`, so that a reduction
    never widens what was known. What is asked of the filter between two steps does not change its later results.
    """

    kind: ClassVar[str] = "LSUCZ"
    guarantee: ClassVar[Guarantee] = "declared"
    _held: Held
    _support: ConstrainedZonotope | None
    _bounds: tuple[Vector, Vector] | None

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        max_generators: int | None = None,
        max_constraints: int | None = 8,
        point: PointOption = "mean",
        reduce: bool = True,
    ) -> None:
        n = model.state_count
        if max_generators is not None and max_generators < n:
            raise ModelError(f"max_generators must be at least {n}, the number of states, it is {max_generators}")
        if max_constraints is not None and max_constraints < 0:
            raise ModelError(f"max_constraints must not be negative, it is {max_constraints}")
        self._model = model
        self._arrays = kernel_model(model)
        if max_generators is None:
            max_generators = max(GENERATORS, GENERATORS_PER_STATE * n)
            if reduce and max_generators > GENERATORS:  # it was GENERATORS for models of all sizes once
                vars(self)["algorithm"] = max(2, type(self).algorithm)
        self._limits = Limits(max_generators, max_constraints) if reduce else Limits(None, None)
        self._estimate = PointEstimate(model, point)
        self.reset(prior if isinstance(prior, Support) else Orthotope(*prior))

    @property
    def model(self) -> LSUModel:
        """The model in force when no step says otherwise."""
        return self._model

    @property
    def support(self) -> ConstrainedZonotope:
        """The constrained zonotope that holds the state."""
        if self._support is None:
            self._support = ConstrainedZonotope.of_arrays(*self._held.body)
        return self._support

    @property
    def point(self) -> Vector:
        """Point estimate (n,) by the rule ``point``."""
        lower, upper = self.bounds()
        if self._estimate.rule == "centre":
            return 0.5 * lower + 0.5 * upper
        if self._estimate.rule == "nearest":
            return nearest_to_center(self.support, lower, upper)
        target = self._estimate.target(self._held.density, lower, upper, lambda: 0.5 * lower + 0.5 * upper)
        return nearest_point(self.support, target, lower, upper)

    @property
    def point_rule(self) -> PointRule:
        """The rule of :attr:`point`."""
        return self._estimate.rule

    @property
    def density(self) -> Density | None:
        """Mean and covariance beside the set, of the rule ``"mean"``."""
        return self._held.density

    def bounds(self) -> tuple[Vector, Vector]:
        """Interval hull of the support met with the box that is held beside it; (n,), (n,)."""
        if self._held.is_hull:
            return self._held.lower, self._held.upper
        if self._bounds is None:
            lower, upper = self.support.bounds()
            self._bounds = np.maximum(lower, self._held.lower), np.minimum(upper, self._held.upper)
        return self._bounds

    def volume(self) -> float:
        """Volume of :attr:`support` up to dimension 3, above it of :meth:`bounds`: cheap enough for each step."""
        if self._model.state_count <= MAX_EXACT_VOLUME:
            return self.support.volume()
        return box_volume(*self.bounds())

    def predict_output(self, u: ArrayLike | Orthotope | None = None, model: LSUModel | None = None) -> OutputPrediction:
        """``C X ⊕ [−r, r]`` by safe linear programs, met with interval arithmetic over :meth:`bounds`."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        low, high = self._image(arrays.C)
        r = arrays.r
        lower = np.where(r > 0, np.nextafter(low - r, -np.inf), low)
        upper = np.where(r > 0, np.nextafter(high + r, np.inf), high)
        return shifted(OutputPrediction(lower, upper, used.C @ self.point), used, u)

    def update(
        self,
        y: ArrayLike,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> ConstrainedZonotope:
        """Data update: one generator and one constraint per strip, then reduction (P2023 (15))."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        C, (values, widths) = arrays.C, plain_strips(used, arrays, y, r=r, u=u, image=self._image)
        if not np.isnan(values).all():
            c, G, A, b = self._held.body
            cut = (c, *meet_strips(c, G, A, b, C, values, widths))
            try:
                held = self._settled(cut, self._held.lower, self._held.upper)
            except InconsistentData as contradiction:
                raise strip_contradiction(used.outputs, *self._image(C), values, widths) from contradiction
            density = self._held.density
            self._hold(held)
            self._hold_density(
                self._estimate.updated(density, arrays, values, widths=widths, bounds=self.bounds)
            )  # fmt: skip
        return self.support

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> ConstrainedZonotope:
        """Time update ``A X ⊕ B u ⊕ N box(rho)`` (P2023 (16)), met with ``model.domain`` where it exceeds it."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        center, widths = driven(used, arrays, u, rho=rho, bounds=self.bounds)
        body, (lower, upper) = self._held.body, self.bounds()
        if not self._limits.allow(body):
            body, lower, upper = self._settled(body, lower, upper)[:3]
        box = np.array([lower, upper])  # one compiled kernel serves, whether or not the bounds may be written
        finite, body, lower, upper = predict_constrained(
            body, box[0], box[1], arrays.A, arrays.B, center, arrays.G, widths
        )
        if not finite:
            raise UnboundedSupport(f"the set of {self.kind} has outgrown double precision; reset it from a known set")
        density, held = self._held.density, Held(body, lower, upper, is_hull=False)
        self._hold(held if used.domain is None else _within(held, used.domain))
        if density is not None:
            drive = Drive(center, widths, has_rho=rho is not None)
            self._hold_density(self._estimate.predicted(density, used, arrays, drive, bounds=self.bounds))
        return self.support

    def condition(self, support: Support, gain: GainOf | None = None) -> float:
        """Bayesian transfer: keep ``self ∩ support``, or a set of this class that holds it; see :class:`Filter`."""
        return measured(self, gain, partial(self._condition, support))

    def _condition(self, support: Support) -> float:
        """Keep ``X ∩ support``; the gain, in nats, is that of the interval hulls.

        A set that brings next to nothing, so that reducing the intersection to the limits costs more, changes only the
        box that is held: a wide source does no harm.
        """
        other = checked_prior(self._model, support)
        own, before = self._held, self.bounds()
        try:
            lower, upper = other.bounds()
            box = np.maximum(before[0], lower), np.minimum(before[1], upper)
            met = joined(own.body, before, other, self._most_transferred)
            if met is own.body:  # it lies in the other set
                return 0.0
            self._hold(self._settled(met, *box))
        except InconsistentData as contradiction:
            raise InconsistentData(
                f"the set of {self.kind} and the transferred set have no point in common"
            ) from contradiction
        gain, is_reduced = hull_gain(before, self.bounds()), not self._limits.allow(met)
        if is_reduced and gain < LITTLE_GAIN and self._size(own.body) <= self._size(self._held.body):
            self._hold(self._held._replace(body=own.body))
        return gain

    def reset(self, support: Support) -> None:
        """Start again from a set that is known to hold the state now."""
        given = checked_prior(self._model, support)
        body = given.to_constrained_zonotope().arrays
        lower, upper = given.bounds()
        held = Held(body, lower, upper, True) if self._limits.allow(body) else self._settled(body, lower, upper)
        self._hold(held._replace(density=self._estimate.started(lower, upper)))

    def resume(self, support: Support, lower: Vector, upper: Vector) -> None:
        """Go on from the set and the box as they are, bit by bit."""
        body = checked_prior(self._model, support).to_constrained_zonotope().arrays
        density = self._estimate.started(lower, upper)
        self._hold(Held(body, lower, upper, is_hull=True, density=density))

    def take_density(self, density: Density) -> None:
        """Go on from this density, with the rule ``"mean"``."""
        self._hold_density(self._estimate.resumed(density))

    @property
    def is_resumable(self) -> bool:
        """The set and the box are all that is held."""
        return True

    def snapshot(self) -> Held:
        """The set and the box; neither is ever written again."""
        return self._held

    def restore(self, snapshot: object) -> None:
        """Return to a state taken by :meth:`snapshot`, bit by bit."""
        if not isinstance(snapshot, Held):
            raise ModelError(f"the snapshot must be one of LSUCZ, it is {type(snapshot).__name__}")
        self._hold(snapshot)

    def _hold(self, held: Held) -> None:
        """Hold a set, beside which the density in force stays where it brings none."""
        own = getattr(self, "_held", held).density
        self._held = held if held.density is not None or own is None else held._replace(density=own)
        self._support = None
        self._bounds = None

    def _hold_density(self, density: Density | None) -> None:
        """Another density beside the same set."""
        if density is not None:
            self._held = self._held._replace(density=density)

    def _settled(self, body: Body, lower: Vector, upper: Vector) -> Held:
        """Hull, then reduction; raises ``InconsistentData`` where the set is proved empty."""
        settled = settle(body, lower, upper, self._limits)
        if settled.empty:
            raise InconsistentData("the sets are proved to have no point in common")
        return Held(settled.body, settled.lower, settled.upper, is_hull=True)

    def _size(self, body: Body) -> float:
        """Σ log of a set's widths along the axes and their diagonals, axes in units of the box that is held."""
        widths = self._held.upper - self._held.lower
        scaled = np.diag(1.0 / np.where(widths > 0, widths, 1.0))
        first, second = _pairs(widths.size)
        directions = np.vstack([scaled, scaled[first] + scaled[second], scaled[first] - scaled[second]])
        low, high = ConstrainedZonotope.of_arrays(*body).ranges(directions)
        return float(np.log(np.maximum(high - low, np.finfo(np.float64).tiny)).sum())

    @property
    def _most_transferred(self) -> int | None:
        """A set far more complex than this filter's own is taken by its box."""
        limit = self._limits.generators
        return None if limit is None else 3 * max(limit, self._model.state_count)

    def _image(self, C: Matrix) -> tuple[Vector, Vector]:
        """Bounds of ``C x``."""
        low, high = self.support.ranges(C)
        box_low, box_high = image_of_box(C, *self.bounds())
        return np.maximum(low, box_low), np.minimum(high, box_high)


@functools.cache
def _pairs(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.triu_indices(n, 1)


def _within(held: Held, domain: Orthotope) -> Held:
    """Meet with the domain; only coordinates in which the set exceeds it cost a generator and a constraint."""
    c, G, A, b = held.body
    lower, upper = np.maximum(held.lower, domain.lower), np.minimum(held.upper, domain.upper)
    exceeded = (held.lower < domain.lower) | (held.upper > domain.upper)
    body = held.body
    if exceeded.any():
        low, high = ConstrainedZonotope.of_arrays(*held.body).bounds()
        exceeded &= (low < domain.lower) | (high > domain.upper)
        middle = np.where(exceeded, domain.center, np.nan)
        body = (c, *meet_strips(c, G, A, b, np.eye(domain.dim), middle, np.array(domain.half_widths)))
    if (lower > upper).any() or ConstrainedZonotope.of_arrays(*body).is_empty():
        raise InconsistentData("the prediction is proved to miss the domain")
    return Held(body, lower, upper, is_hull=False)
