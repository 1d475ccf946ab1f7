"""LSU-CZ: the filter whose support is a constrained zonotope."""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, ModelError, UnboundedSupport
from lsu_mesh.filters.compiled_sets import CompiledSets, PackedSet, unpacked
from lsu_mesh.filters.constrained_intersection import joined
from lsu_mesh.filters.constrained_state import Held, advanced, checked_limits, log_size, within
from lsu_mesh.filters.density import Density, Drive, PointEstimate
from lsu_mesh.filters.filter import GainOf, Guarantee, OutputPrediction
from lsu_mesh.filters.inconsistency import strip_contradiction
from lsu_mesh.filters.lagged_states import body_of, rows_of, stacked_step, with_newest
from lsu_mesh.filters.plain_outputs import plain_strips, shifted, widened
from lsu_mesh.filters.point_rule import PointOption, PointRule
from lsu_mesh.filters.transfer_gain import conditioned, hull_gain
from lsu_mesh.filters.validation import KernelModel, checked_prior, driven, kernel_model, same_states, step_arrays
from lsu_mesh.kernels.set_run import CONSTRAINED, PREDICT, UPDATE, Kind
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_strips
from lsu_mesh.kernels.zonotopes.time_update import image_of_box
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.arrays import box_volume
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.nearest_point import nearest_point, nearest_to_center
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.reduction import Body, settle
from lsu_mesh.supports.support import Support

LITTLE_GAIN = 0.03
"""Nats below which a transferred set is weighed against what the reduction of the intersection costs."""
MAX_EXACT_VOLUME = 3
"""Dimension up to which :meth:`LSUCZ.volume` enumerates vertices; ``support.volume()`` does so up to 6."""


class LSUCZ(CompiledSets):
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
    lag:
        L: the sets of x_{k−1}, …, x_{k−L} given all data up to step k are held too, :meth:`smoothed`. Each step more
        needs n generators more: ``max_generators`` is at least ``n (L + 1)``; ``None``: ``max(20, 3 n) + n L``.

    Raises
    ------
    ModelError
        Names the option or the prior that is wrong.

    Beside the constrained zonotope the filter holds a box: the interval hull *before* each reduction, carried on by
    interval arithmetic. :meth:`bounds` is the meet of that box and the hull of :attr:`support`, so that a reduction
    never widens what was known. What is asked of the filter between two steps does not change its later results.

    Fixed-lag smoothing holds the set of the stacked state: ``{c_l + G_l ξ : |ξ|∞ ≤ 1, A ξ = b}`` for x_{k−l}, one ξ for
    all l. A time update appends columns, a strip appends a row, and a reduction encloses all rows together. Without
    reduction these are the sets of x_{k−l} given all data, exact but for rounding.
    """

    kind: ClassVar[str] = "LSUCZ"
    algorithm: ClassVar[int] = 3
    guarantee: ClassVar[Guarantee] = "declared"
    smooths: ClassVar[bool] = True
    conditioning: ClassVar[int] = 2
    _held: Held
    _support: ConstrainedZonotope | None
    _bounds: tuple[Vector, Vector] | None

    def __init__(
        self, model: LSUModel, prior: Support | tuple[ArrayLike, ArrayLike], max_generators: int | None = None,
        max_constraints: int | None = 8, point: PointOption = "mean", reduce: bool = True, lag: int = 0,
    ) -> None:  # fmt: skip
        n = model.state_count
        self._limits = checked_limits(n, lag, max_generators, max_constraints, reduces=reduce)
        self._model = model
        self._arrays = kernel_model(model)
        self._estimate = PointEstimate(model, point)
        self._lag = lag
        most, rows = (-1 if limit is None else limit for limit in self._limits)
        self._kind = Kind(CONSTRAINED, most, rows, scaled=False, has_box=True)
        self._started_tables(n, model.output_count)
        self.reset(prior if isinstance(prior, Support) else Orthotope(*prior))

    @property
    def model(self) -> LSUModel:
        """The model in force when no step says otherwise."""
        return self._model

    @property
    def lag(self) -> int:
        """L: so many steps back :meth:`smoothed` goes."""
        return self._lag

    @property
    def held_steps(self) -> int:
        """So many steps back states are held now, at most :attr:`lag`; fewer after a start."""
        return self._depth - 1

    @property
    def support(self) -> ConstrainedZonotope:
        """The constrained zonotope that holds the state."""
        if self._support is None:
            self._support = self.smoothed(0)
        return self._support

    def smoothed(self, steps: int) -> ConstrainedZonotope:
        """The set of x_{k−steps} given all data so far, ``0 ≤ steps ≤ lag``.

        Raises ``ModelError`` where no state of so many steps back is held: beyond the lag, or before the start.
        """
        self._check_held(steps)
        return ConstrainedZonotope.of_arrays(*body_of(self._held.body, steps, self._model.state_count))

    def smoothed_bounds(self, steps: int) -> tuple[Vector, Vector]:
        """Bounds (n,), (n,) of x_{k−steps} given all data so far: of :meth:`smoothed`, met with the box beside it."""
        self._check_held(steps)
        n, (lower, upper) = self._model.state_count, self._stack_bounds()
        return lower[steps * n : (steps + 1) * n], upper[steps * n : (steps + 1) * n]

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
        lower, upper = self._stack_bounds()
        n = self._model.state_count
        return lower[:n], upper[:n]

    def volume(self) -> float:
        """Volume of :attr:`support` up to dimension 3, above it of :meth:`bounds`: cheap enough for each step."""
        if self._model.state_count <= MAX_EXACT_VOLUME:
            return self.support.volume()
        return box_volume(*self.bounds())

    def predict_output(self, u: ArrayLike | Orthotope | None = None, model: LSUModel | None = None) -> OutputPrediction:
        """``C X ⊕ [−r, r]`` by safe linear programs, met with interval arithmetic over :meth:`bounds`."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        found = None if self._lag else self._output(arrays)
        if found is None:
            low, high = self._image(arrays.C)
            lower, upper = widened(low, high, arrays.r)
        else:
            lower, upper, self._bounds = found
        return shifted(OutputPrediction(lower, upper, self._output_point(used.C)), used, u)

    def update(
        self, y: ArrayLike, r: ArrayLike | None = None, model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> ConstrainedZonotope:  # fmt: skip
        """Data update: one generator and one constraint per strip, then reduction (P2023 (15))."""
        density = self._held.density
        cut = self._take(y, 0, r, model=model, u=u)
        if cut is not None:
            arrays, values, widths = cut
            self._hold_density(self._estimate.updated(density, arrays, values, widths=widths, bounds=self.bounds))
        return self.support

    def update_late(
        self, y: ArrayLike, steps: int, r: ArrayLike | None = None, model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> ConstrainedZonotope:  # fmt: skip
        """Data update with y (m,) of ``steps`` steps ago, within the lag; r, model and u are those of that step.

        Without reduction the sets are those that the data give in order. The density beside the set, from which the
        point comes, takes nothing from late data. Raises as :meth:`update` and :meth:`smoothed`.
        """
        self._check_held(steps)
        self._take(y, steps, r, model=model, u=u)
        return self.support

    def predict(
        self, u: ArrayLike | Orthotope | None = None, rho: ArrayLike | None = None, model: LSUModel | None = None
    ) -> ConstrainedZonotope:
        """Time update ``A X ⊕ B u ⊕ N box(rho)`` (P2023 (16)), met with ``model.domain`` where it exceeds it."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        center, widths = driven(used, arrays, u, rho=rho, bounds=self.bounds)
        density = self._held.density
        self._hold(self._moved(used, arrays, center, widths))
        if density is not None:
            drive = Drive(center, widths, has_rho=rho is not None)
            self._hold_density(self._estimate.predicted(density, used, arrays, drive, bounds=self.bounds))
        return self.support

    def condition(self, support: Support, gain: GainOf | None = "support") -> float:
        """Bayesian transfer: keep ``self ∩ support``, or a set of this class that holds it; see :class:`Filter`."""
        return conditioned(self, support, gain, self._condition)

    @property
    def last_met(self) -> Support | None:
        """The set that was met last, where nothing has come since."""
        return self._held.met

    @last_met.setter
    def last_met(self, support: Support) -> None:
        self._held = self._held._replace(met=support)

    def _condition(self, support: Support) -> float:
        """Keep ``X ∩ support``; the gain, in nats, is that of the interval hulls.

        A set that brings next to nothing, so that reducing the intersection to the limits costs more, changes only the
        box that is held: a wide source does no harm.
        """
        other = checked_prior(self._model, support)
        own, before = self._held, self.bounds()
        try:
            lower, upper = other.bounds()
            newest = np.maximum(before[0], lower), np.minimum(before[1], upper)
            box = [with_newest(side, cut) for side, cut in zip(self._stack_bounds(), newest, strict=True)]
            met = joined(own.body, before, other, self._most_transferred)
            if met is own.body:  # it lies in the other set
                return 0.0
            self._hold(self._settled(met, box[0], box[1]))
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
        self._hold(Held(body, lower, upper, is_hull=True, density=self._estimate.started(lower, upper)))

    def take_density(self, density: Density) -> None:
        """Go on from this density, with the rule ``"mean"``."""
        self._hold_density(self._estimate.resumed(density))

    @property
    def is_resumable(self) -> bool:
        """Without a lag the set and the box are all that is held."""
        return not self._lag

    def snapshot(self) -> Held:
        """The set and the box; neither is ever written again."""
        return self._held

    def restore(self, snapshot: object) -> None:
        """Return to a state taken by :meth:`snapshot`, bit by bit."""
        if not isinstance(snapshot, Held):
            raise ModelError(f"the snapshot must be one of LSUCZ, it is {type(snapshot).__name__}")
        self._hold(snapshot)

    @property
    def _depth(self) -> int:
        """So many states are held, the newest first."""
        return self._held.lower.size // self._model.state_count

    def _stack_bounds(self) -> tuple[Vector, Vector]:
        if self._held.is_hull:
            return self._held.lower, self._held.upper
        if self._bounds is None:  # the box of the earlier states is the hull that they had before the time update
            n, (lower, upper) = self._model.state_count, self.support.bounds()
            self._bounds = (
                with_newest(self._held.lower, np.maximum(lower, self._held.lower[:n])),
                with_newest(self._held.upper, np.minimum(upper, self._held.upper[:n])),
            )
        return self._bounds

    def _take(
        self, y: ArrayLike, place: int, r: ArrayLike | None, *, model: LSUModel | None, u: ArrayLike | Orthotope | None
    ) -> tuple[KernelModel, Vector, Vector] | None:
        """Hold the part that data of ``place`` steps ago leave; the model and the strips, ``None`` without data."""
        used = same_states(self._model, model)
        arrays, image = self._arrays if model is None else step_arrays(used), partial(self._image, place=place)
        values, widths = plain_strips(used, arrays, y, r=r, u=u, image=image)
        if np.isnan(values).all():
            return None
        try:
            self._hold(self._cut(rows_of(arrays.C, place, self._depth), values, widths))
        except InconsistentData as contradiction:
            raise strip_contradiction(used.outputs, *image(arrays.C), values, widths) from contradiction
        return arrays, values, widths

    def _cut(self, P: Matrix, values: Vector, widths: Vector) -> Held:
        """The part in the strips ``|values − P x| ≤ widths``, P (m, n depth), NaN for no strip."""
        if not self._lag:
            a = self._arrays
            cut = self._stepped(UPDATE, a, P=P, y=values, r=widths, u=np.zeros(a.B.shape[1]), widths=a.widths)
            if cut is not None:
                return Held(*cut)
        c, G, A, b = self._held.body
        met = (c, *meet_strips(c, G, A, b, P, values, widths))
        return self._settled(met, self._held.lower, self._held.upper)

    def _moved(self, model: LSUModel, arrays: KernelModel, u: Vector, widths: Vector) -> Held:
        """The time update ``A X ⊕ B u ⊕ G box(widths)``, met with the domain."""
        if not self._lag:
            y = np.full(arrays.r.size, np.nan)
            moved = self._stepped(
                PREDICT, arrays, P=arrays.C, y=y, r=arrays.r, u=u, widths=widths, domain=model.domain
            )  # fmt: skip
            if moved is not None:
                return Held(*moved)
        body, (lower, upper) = self._held.body, self._stack_bounds()
        if not self._limits.allow(body):
            body, lower, upper = self._settled(body, lower, upper)[:3]
        held = advanced(
            body, lower, upper, arrays, step=stacked_step(arrays, self._depth, self._lag), u=u, widths=widths
        )
        if held is None:
            raise UnboundedSupport(f"the set of {self.kind} has outgrown double precision; reset it from a known set")
        return held if model.domain is None else within(held, model.domain)

    @property
    def _packed(self) -> PackedSet:
        return PackedSet(*self._held[:4])

    def _hold_packed(self, held: PackedSet, density: Density | None) -> None:
        self._hold(Held(*held, density=density))

    def snapshot_of(self, state: Vector) -> Held:
        """The set of a row of a run."""
        return Held(*unpacked(state, self._model.state_count))

    @property
    def has_compiled_loop(self) -> bool:
        """Without a lag, and with a limit of generators."""
        return super().has_compiled_loop and not self._lag and self._limits.generators is not None

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
        n = self._model.state_count
        return log_size(body_of(body, 0, n), (self._held.upper - self._held.lower)[:n])

    @property
    def _most_transferred(self) -> int | None:
        """A set far more complex than this filter's own is taken by its box."""
        limit = self._limits.generators
        return None if limit is None else 3 * max(limit, self._model.state_count)

    def _image(self, C: Matrix, place: int = 0) -> tuple[Vector, Vector]:
        """Bounds of ``C x``, x of ``place`` steps ago."""
        low, high = (self.support if place == 0 else self.smoothed(place)).ranges(C)
        box_low, box_high = image_of_box(C, *self.smoothed_bounds(place))
        return np.maximum(low, box_low), np.minimum(high, box_high)
