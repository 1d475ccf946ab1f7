"""The zonotopic Kalman filter: the gain of the Kalman filter, on sets."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import InconsistentData, ModelError, UnboundedSupport
from lsu_mesh.filters.compiled_sets import CompiledSets, PackedSet, unpacked
from lsu_mesh.filters.density import Density, Drive, PointEstimate
from lsu_mesh.filters.filter import GainOf, Guarantee, OutputPrediction
from lsu_mesh.filters.inconsistency import strip_contradiction
from lsu_mesh.filters.plain_outputs import plain_strips, shifted, widened
from lsu_mesh.filters.point_rule import PointOption, PointRule
from lsu_mesh.filters.transfer_gain import MAX_SWEEPS, SETTLED, conditioned, hull_gain
from lsu_mesh.filters.validation import KernelModel, checked_prior, driven, kernel_model, same_states, step_arrays
from lsu_mesh.filters.zonotopic_state import (
    Held,
    Strips,
    bounds_of,
    corrected_by,
    everything,
    held_of,
    is_contradictory,
    no_strips,
    size_of,
    stacked,
    zonotope_hull,
)
from lsu_mesh.kernels.parallelotopes.box import keep_constants
from lsu_mesh.kernels.parallelotopes.bundle import tighten_all
from lsu_mesh.kernels.set_run import PREDICT, UPDATE, ZONOTOPE, Kind
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_strips
from lsu_mesh.kernels.zonotopes.time_update import image_of_box, predict_constrained
from lsu_mesh.kernels.zonotopes.zonotopic_kalman import box_shortest
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.linear_programs import is_proved_empty
from lsu_mesh.supports.nearest_point import nearest_point
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope

COLUMNS, COLUMNS_PER_STATE = 15, 3
"""Columns of a zonotope at least, and for each state, where the user states no order."""


class ZonotopicKalman(CompiledSets):
    """``c ← c + K (y − C c)``, ``H ← [(I − K C) H, K diag(r)]``; then ``A c + B u``, ``[A H, N diag(rho)]``.

    Parameters
    ----------
    model, prior:
        LSU model with n states; a set, or a pair (lower, upper), that holds x_1.
    order:
        Columns of H that are kept in all at each time update, at least n: the longest, and a box of the others.
        ``None`` stands for ``max(15, 3 n)``.
    form:
        ``"filter"``: the support after :meth:`update` has used y_k. ``"predictor"``: it is that of the one-step
        prediction from y_{k−1}; y_k is used by the next :meth:`predict` (Combastel's original form, and what P2018
        compares).
    box:
        Whether a box is carried beside the zonotope, by interval arithmetic over the data and the time updates, and
        :meth:`bounds` are met with it: they never forget what was once known of a constant. The zonotope takes nothing
        from it, but a proof that the data contradict the bounds.
    scaled:
        Whether columns are compared in units of the set's half-widths, which no unit of a state can change; ``False``:
        in the states' own units, as in the papers.
    reduce:
        ``False``: all columns are kept, the set grows with every step.
    point:
        The point estimate: ``"mean"``: of the truncated density beside the set, moved into it; ``"nearest"``: the point
        of the set in the bounds that is nearest to the zonotope's centre; ``"centre"``: that centre, moved into the
        bounds, which may then lie outside of the zonotope.

    Raises
    ------
    ModelError
        Names the option or the prior that is wrong.

    ``K = P C'(C P C' + R)⁻¹``, ``P = H H'``, ``R = diag(r²)``, minimises the sum of squares of the generators
    (Combastel 2015); rows are taken one after the other, and one that tells nothing new is left out. The set is
    guaranteed for any K.
    """

    kind: ClassVar[str] = "ZonotopicKalman"
    guarantee: ClassVar[Guarantee] = "declared"
    algorithm: ClassVar[int] = 2
    conditioning: ClassVar[int] = 2
    _held: Held

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        order: int | None = None,
        form: Literal["filter", "predictor"] = "filter",
        box: bool = True,
        scaled: bool = True,
        reduce: bool = True,
        point: PointOption = "mean",
    ) -> None:
        if form not in ("filter", "predictor"):
            raise ModelError(f'form must be "filter" or "predictor", it is {form!r}')
        if order is not None and order < model.state_count:
            raise ModelError(f"order must be at least {model.state_count}, the number of states, it is {order}")
        self._model = model
        self._arrays = kernel_model(model)
        chosen = max(COLUMNS, COLUMNS_PER_STATE * model.state_count) if order is None else order
        self._order = chosen if reduce else None
        self._form = form
        self._has_box = bool(box)
        self._scaled = bool(scaled)
        self._estimate = PointEstimate(model, point)
        most = -1 if self._order is None else self._order
        self._kind = Kind(ZONOTOPE, most, 0, scaled=self._scaled, has_box=self._has_box)
        self._started_tables(model.state_count, model.output_count)
        self.reset(prior if isinstance(prior, Support) else Orthotope(*prior))

    @property
    def model(self) -> LSUModel:
        """The model in force when no step says otherwise."""
        return self._model

    @property
    def support(self) -> Zonotope:
        """The zonotope that holds the state."""
        return Zonotope.of_arrays(self._held.c, self._held.H)

    @property
    def point(self) -> Vector:
        """Point estimate (n,) by the rule ``point``."""
        lower, upper = self.bounds()
        target = self._estimate.target(self._held.density, lower, upper, lambda: np.clip(self._held.c, lower, upper))
        return target if self._estimate.rule == "centre" else nearest_point(self.support, target, lower, upper)

    @property
    def point_rule(self) -> PointRule:
        """The rule of :attr:`point`."""
        return self._estimate.rule

    @property
    def density(self) -> Density | None:
        """Mean and covariance beside the set, of the rule ``"mean"``."""
        return self._held.density

    def bounds(self) -> tuple[Vector, Vector]:
        """Interval hull of the zonotope, met with the box beside it; (n,), (n,)."""
        held = self._held
        lower, upper = self.support.bounds()
        return np.maximum(lower, held.lower), np.minimum(upper, held.upper)

    def predict_output(self, u: ArrayLike | Orthotope | None = None, model: LSUModel | None = None) -> OutputPrediction:
        """``C c ± (Σ_j |C H_j| + r)``, met with the image of :meth:`bounds`."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        found = self._output(arrays)
        lower, upper = widened(*self._image(arrays.C), arrays.r) if found is None else found[:2]
        return shifted(OutputPrediction(lower, upper, self._output_point(used.C)), used, u)

    def update(
        self,
        y: ArrayLike,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> Zonotope:
        """Data update with the optimal gain; in the predictor form the data wait for :meth:`predict`."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        C, (values, widths) = arrays.C, plain_strips(used, arrays, y, r=r, u=u, image=self._image)
        if not np.isnan(values).all():
            try:
                self._held = self._cut(arrays, values, widths)
            except InconsistentData as contradiction:
                raise strip_contradiction(used.outputs, *self._image(C), values, widths) from contradiction
            density = self._estimate.updated(
                self._held.density, arrays, values, widths=widths, bounds=self.bounds
            )  # fmt: skip
            self._held = self._held._replace(density=density)
        return self.support

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> Zonotope:
        """Time update ``A X ⊕ B u ⊕ N box(rho)``, reduced; :meth:`bounds` are met with ``model.domain``."""
        used = same_states(self._model, model)
        arrays = self._arrays if model is None else step_arrays(used)
        center, widths = driven(used, arrays, u, rho=rho, bounds=self.bounds)
        held = self._moved(used, arrays, center, widths)
        drive, density = Drive(center, widths, has_rho=rho is not None), self._held.density
        self._held = held
        density = self._estimate.predicted(density, used, arrays, drive, bounds=self.bounds)
        self._held = held._replace(density=density)
        return self.support

    def condition(self, support: Support, gain: GainOf | None = "support") -> float:
        """Bayesian transfer: keep ``self ∩ support``, or a set of this class that holds it; see :class:`Filter`."""
        return conditioned(self, support, gain, self._condition)

    @property
    def last_met(self) -> Support | None:
        """The set that was met last, where nothing has been brought to the zonotope since."""
        return self._held.met

    @last_met.setter
    def last_met(self, support: Support) -> None:
        self._held = self._held._replace(met=support)

    def _condition(self, support: Support) -> float:
        """Keep a zonotope that holds ``X ∩ support``, and the box of ``support``; the gain is that of the hulls.

        The faces of the box are offered as strips to the gain, again until that gains no more; the result is kept where
        it shrinks the hull, else the set stays as it is. :meth:`bounds` never widen: they stay met with what they were,
        and with the box.
        """
        other = checked_prior(self._model, support)
        before = self.bounds()
        lower, upper = other.bounds()
        box = Orthotope(lower, upper)
        strips = Strips(np.eye(box.dim), np.array(box.center), np.array(box.half_widths))
        if self._excludes(strips) or self.support.intersect(other).is_empty():
            raise InconsistentData(f"the set of {self.kind} and the transferred set have no point in common")
        met = self._held._replace(lower=np.maximum(before[0], lower), upper=np.minimum(before[1], upper))
        if is_contradictory(met):
            raise InconsistentData(f"the set of {self.kind} and the transferred set have no point in common")
        self._held = self._shrunk(met, strips)
        return hull_gain(before, self.bounds())

    def reset(self, support: Support) -> None:
        """Start again from a set that is known to hold the state now: from its zonotope, else from its box."""
        given = checked_prior(self._model, support)
        body = given.to_constrained_zonotope()
        if body.constraint_count:
            body = given.interval_hull().to_constrained_zonotope()
        c, H, _, _ = body.arrays
        H = H if self._order is None else box_shortest(H, self._order, self._scaled)
        self._held = Held(c, H, *given.bounds(), no_strips(c.size), self._estimate.started(*given.bounds()))

    def resume(self, support: Support, lower: Vector, upper: Vector) -> None:
        """Go on from a zonotope and a box; in the predictor form data that wait have to be given again."""
        if not isinstance(support, Zonotope):
            raise ModelError(f"{self.kind} continues from a zonotope, not from {support!r}")
        self._held = Held(
            c=support.center.copy(),
            H=support.generators.copy(),
            lower=lower,
            upper=upper,
            pending=no_strips(lower.size),
            density=self._estimate.started(lower, upper),
        )

    def take_density(self, density: Density) -> None:
        """Go on from this density, with the rule ``"mean"``."""
        self._held = self._held._replace(density=self._estimate.resumed(density))

    @property
    def is_resumable(self) -> bool:
        """In the predictor form the step's data wait, beside the set, for the time update."""
        return self._form == "filter"

    def snapshot(self) -> Held:
        """Zonotope, box and waiting data; none is ever written again."""
        return self._held

    def restore(self, snapshot: object) -> None:
        """Return to a state taken by :meth:`snapshot`, bit by bit."""
        if not isinstance(snapshot, Held):
            raise ModelError(f"the snapshot must be one of ZonotopicKalman, it is {type(snapshot).__name__}")
        self._held = snapshot

    def _cut(self, arrays: KernelModel, values: Vector, widths: Vector) -> Held:
        """The data update with the strips ``|values − C x| ≤ widths``, NaN for none."""
        if self._form == "filter":
            cut = self._stepped(
                UPDATE, arrays, P=arrays.C, y=values, r=widths, u=np.zeros(arrays.B.shape[1]), widths=arrays.widths
            )  # fmt: skip
            if cut is not None:
                return held_of(cut, self._held.density)
        known = ~np.isnan(values)
        strips, waiting = Strips(np.array(arrays.C[known]), values[known], widths[known]), self._held.pending
        if self._excludes(strips):
            raise InconsistentData("the strips are proved to miss the zonotope")
        if self._form == "filter":
            return self._with_data(self._held, strips)
        return self._held._replace(pending=Strips(*map(stacked, waiting, strips)))

    def _moved(self, model: LSUModel, arrays: KernelModel, u: Vector, widths: Vector) -> Held:
        """The time update ``A X ⊕ B u ⊕ G box(widths)``, reduced."""
        if self._form == "filter":
            y = np.full(arrays.r.size, np.nan)
            found = self._stepped(
                PREDICT, arrays, P=arrays.C, y=y, r=arrays.r, u=u, widths=widths, domain=model.domain
            )  # fmt: skip
            if found is not None:
                return held_of(found, None)
        held = self._with_data(self._held, self._held.pending)
        body = (held.c, held.H, np.zeros((0, held.H.shape[1])), np.zeros(0))
        finite, moved, lower, upper = predict_constrained(
            body, *bounds_of(held), arrays.A, arrays.B, u, arrays.G, widths
        )
        if not finite:
            raise UnboundedSupport(f"the set of {self.kind} has outgrown double precision; reset it from a known set")
        c, H = moved[0], moved[1] if self._order is None else box_shortest(moved[1], self._order, self._scaled)
        least, most = map(np.array, bounds_of(held))
        keep_constants(least, most, arrays.A, arrays.B, u, arrays.G, widths, lower, upper)
        if model.domain is not None:
            lower, upper = np.maximum(lower, model.domain.lower), np.minimum(upper, model.domain.upper)
        elif not self._has_box:
            lower, upper = everything(c.size)
        held = Held(c=c, H=H, lower=lower, upper=upper, pending=no_strips(c.size))
        if is_contradictory(held):
            raise InconsistentData("the prediction is proved to miss the domain")
        return held

    @property
    def _packed(self) -> PackedSet:
        c, H, lower, upper = self._held[:4]
        return PackedSet((c, H, np.empty((0, H.shape[1])), np.empty(0)), lower, upper, is_hull=False)

    def _hold_packed(self, held: PackedSet, density: Density | None) -> None:
        self._held = held_of(held, density)

    def snapshot_of(self, state: Vector) -> Held:
        """The set of a row of a run."""
        return held_of(unpacked(state, self._model.state_count), None)

    @property
    def has_compiled_loop(self) -> bool:
        """In the form ``"filter"``, and with a limit of columns."""
        return super().has_compiled_loop and self._form == "filter" and self._order is not None

    def _with_data(self, held: Held, strips: Strips) -> Held:
        """The data update of the zonotope, and of the box; no data wait any more."""
        if strips.y.size == 0:
            return held
        if self._has_box:
            lower, upper = map(np.array, bounds_of(held))
            if tighten_all(lower, upper, strips.C, strips.y, strips.r):
                raise InconsistentData("the strips are proved to miss the box beside the zonotope")
            held = held._replace(lower=lower, upper=upper)
        new = corrected_by(held, strips)
        if is_contradictory(new):
            raise InconsistentData("the data are proved to contradict the set")
        return new

    def _shrunk(self, held: Held, strips: Strips) -> Held:
        """The zonotope corrected by strips for as long as its hull shrinks; data that wait go on waiting."""
        for sweep in range(MAX_SWEEPS):
            shrunk = corrected_by(held._replace(pending=no_strips(held.c.size)), strips)._replace(pending=held.pending)
            if self._order is not None:
                shrunk = shrunk._replace(H=box_shortest(shrunk.H, self._order, self._scaled))
            if not size_of(shrunk) < size_of(held):
                break
            does_gain = hull_gain(zonotope_hull(held), zonotope_hull(shrunk)) >= SETTLED
            if does_gain or sweep == 0:
                held = shrunk
            if not does_gain:
                break
        return held

    def _image(self, C: Matrix) -> tuple[Vector, Vector]:
        """Bounds of ``C x``."""
        box_low, box_high = image_of_box(C, *self.bounds())
        high = np.array([self.support.support(row) for row in C])
        low = np.array([-self.support.support(-row) for row in C])
        return np.maximum(low, box_low), np.minimum(high, box_high)

    def _excludes(self, strips: Strips) -> bool:
        """Whether the strips are proved to miss the zonotope."""
        held = self._held
        none = np.zeros((0, held.H.shape[1]))
        _, A, b = meet_strips(held.c, held.H, none, np.zeros(0), *strips)
        return is_proved_empty(A, b)
