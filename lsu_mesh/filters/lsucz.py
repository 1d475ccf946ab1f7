"""LSU-CZ: the filter whose support is a constrained zonotope."""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.filter import Filter, OutputPrediction
from lsu_mesh.filters.step_arguments import half_widths, input_box, output_data, prior_support, step_model
from lsu_mesh.kernels.reduction import reduce_complexity
from lsu_mesh.kernels.zonotope import absorb_box, zonotope_map
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.arrays import frozen
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Matrix, Support
from lsu_mesh.supports.zonotope import Zonotope

Vector = NDArray[np.float64]


class Held(NamedTuple):
    """What the filter knows: the state lies in ``support`` and in the box ``[lower, upper]``."""

    support: ConstrainedZonotope
    lower: Vector
    upper: Vector
    is_tight: bool
    """Whether the box is already met with the interval hull of the support."""


class LSUCZ(Filter):
    """``X_{k|k} = X_{k|k−1} ∩ {|y − C x| ≤ r}``,  ``X_{k+1|k} = A X_{k|k} ⊕ B u ⊕ N box(rho)`` (P2023 (15), (16)).

    Parameters
    ----------
    model, prior:
        LSU model with n states; a set, or a pair (lower, upper), that holds x_1.
    max_generators, max_constraints:
        Complexity of the support after each step; ``None`` is no limit. At least n generators.
    point:
        ``"hull"``: centre of the interval hull (Method 1); ``"nearest"``: the point of the support that is nearest to
        the centre of its generators' box (Method 2).

    Beside the constrained zonotope the filter holds a box: the interval hull *before* each reduction, carried on by interval
    arithmetic. :meth:`bounds` is the meet of that box and the hull of :attr:`support`, so that a reduction never widens
    what was known.
    """

    kind: ClassVar[str] = "LSUCZ"

    def __init__(
        self,
        model: LSUModel,
        prior: Support | tuple[ArrayLike, ArrayLike],
        max_generators: int | None = 20,
        max_constraints: int | None = 8,
        point: str = "hull",
    ) -> None:
        n = model.state_count
        if point not in ("hull", "nearest"):
            raise ModelError(f'point must be "hull" or "nearest", it is {point!r}')
        if max_generators is not None and max_generators < n:
            raise ModelError(f"max_generators must be at least {n}, the number of states, it is {max_generators}")
        if max_constraints is not None and max_constraints < 0:
            raise ModelError(f"max_constraints must not be negative, it is {max_constraints}")
        self._model = model
        self._limits = (
            -1 if max_generators is None else int(max_generators),
            -1 if max_constraints is None else int(max_constraints),
        )
        self._point_rule = point
        self.reset(prior_support(prior, n))

    @property
    def model(self) -> LSUModel:
        """The model in force when no step says otherwise."""
        return self._model

    @property
    def support(self) -> ConstrainedZonotope:
        """The constrained zonotope that holds the state."""
        return self._held.support

    @property
    def point(self) -> Vector:
        """Point estimate (n,) by the rule ``point``."""
        lower, upper = self.bounds()
        if self._point_rule == "hull":
            return 0.5 * lower + 0.5 * upper
        return np.clip(self.support.nearest_to_center(), lower, upper)

    def bounds(self) -> tuple[Vector, Vector]:
        """Interval hull of the support met with the box that is held beside it; (n,), (n,)."""
        if not self._held.is_tight:
            self._held = _tightened(self._held)
        return self._held.lower, self._held.upper

    def predict_output(self) -> OutputPrediction:
        """``C X ⊕ [−r, r]`` by safe linear programs, met with interval arithmetic over :meth:`bounds`."""
        low, high = self._noiseless_output()
        r = self._model.r
        lower = np.nextafter(low - r, -np.inf)
        upper = np.nextafter(high + r, np.inf)
        return OutputPrediction(lower, upper, self._model.C @ self.point)

    def update(self, y: ArrayLike, r: ArrayLike | None = None) -> ConstrainedZonotope:
        """Data update: one generator and one constraint per strip, then reduction (P2023 (15))."""
        values, radius = output_data(self._model, y, r)
        if np.isnan(values).all():
            return self.support
        met = Held(self.support.meet_strips(self._model.C, values, radius), self._held.lower, self._held.upper, False)
        try:
            self._held = self._reduced(_tightened(met))
        except InconsistentData as contradiction:
            raise self._explained(values, radius) from contradiction
        return self.support

    def predict(
        self,
        u: ArrayLike | Orthotope | None = None,
        rho: ArrayLike | None = None,
        model: LSUModel | None = None,
    ) -> ConstrainedZonotope:
        """Time update ``A X ⊕ B u ⊕ N box(rho)`` (P2023 (16)), met with ``model.domain`` where it exceeds it."""
        used = step_model(self._model, model)
        center, reach = input_box(used, u)
        noise = half_widths("rho", used.rho if rho is None else rho, used.rho.size)
        R = np.hstack([used.A, np.zeros((used.state_count, 0)) if used.B is None else used.B, _noise_map(used)])
        added = np.concatenate([center, np.zeros(noise.size)])
        widths = np.concatenate([reach, noise])
        lower, upper = self.bounds()
        box = _mapped_box(R, np.concatenate([0.5 * lower + 0.5 * upper, added]), _reach(lower, upper), widths)
        held = Held(_mapped(R, self.support, added, widths), *box.bounds(), is_tight=False)
        self._held = self._reduced(held if used.domain is None else _within(held, used.domain))
        return self.support

    def condition(self, support: Support) -> float:
        """Keep ``X ∩ support``; the gain is measured on interval hulls, in nats."""
        other = prior_support(support, self._model.state_count)
        lower, upper = self.bounds()
        other_lower, other_upper = other.bounds()
        met = Held(self._met(other), np.maximum(lower, other_lower), np.minimum(upper, other_upper), False)
        self._held = self._reduced(_tightened(met))
        return _log_ratio(upper - lower, self._held.upper - self._held.lower)

    def reset(self, support: Support) -> None:
        """Start again from a set that is known to hold the state now."""
        given = prior_support(support, self._model.state_count)
        lower, upper = given.bounds()
        self._held = self._reduced(Held(given.to_constrained_zonotope(), lower, upper, is_tight=True))

    def snapshot(self) -> Held:
        """Support and box; both immutable."""
        return self._held

    def restore(self, snapshot: object) -> None:
        """Return to a state taken by :meth:`snapshot`."""
        if not isinstance(snapshot, Held):
            raise ModelError("the snapshot is not one of LSUCZ")
        self._held = snapshot

    def _reduced(self, held: Held) -> Held:
        z = held.support
        arrays = reduce_complexity(z._center, z._generators, z._A, z._b, *self._limits)
        if arrays[1] is z._generators:
            return held
        return held._replace(support=ConstrainedZonotope._of(*arrays))

    def _met(self, other: Support) -> ConstrainedZonotope:
        """``X ∩ other``; a set too complex to be intersected within three times the limits enters as its box."""
        joined = other.to_constrained_zonotope()
        limit = self._limits[0]
        if limit >= 0 and joined.generator_count > 3 * max(limit, self._model.state_count):
            return self.support.intersect(other.interval_hull())
        return self.support.intersect(joined)

    def _noiseless_output(self) -> tuple[Vector, Vector]:
        C = np.array(self._model.C)
        lower, upper = self.bounds()
        none = np.zeros(0)
        box_lower, box_upper = _mapped_box(C, 0.5 * lower + 0.5 * upper, _reach(lower, upper), none).bounds()
        if not C.shape[0]:
            return box_lower, box_upper
        low, high = self.support.ranges(C)
        return np.maximum(low, box_lower), np.minimum(high, box_upper)

    def _explained(self, y: Vector, r: Vector) -> InconsistentData:
        """The contradiction with the rows whose strip alone misses the set, widest gap first."""
        low, high = self._noiseless_output()
        gaps = np.fmax(low - (y + r), (y - r) - high)
        rows = [int(i) for i in np.argsort(-gaps) if gaps[i] > 0]
        if not rows:
            return InconsistentData("the strips together are proved to miss the set; none alone does")
        names = ", ".join(self._model.outputs[i] for i in rows)
        return InconsistentData(
            f"{names}: the strip misses the predicted set by {gaps[rows[0]]:.6g}", rows, float(gaps[rows[0]])
        )


def _tightened(held: Held) -> Held:
    """Meet the box with the hull of the support; raises ``InconsistentData`` where nothing is left."""
    lower, upper = held.support.bounds()
    lower, upper = np.maximum(lower, held.lower), np.minimum(upper, held.upper)
    if (lower > upper).any():
        raise InconsistentData("the sets are proved to have no common point")
    return Held(held.support, frozen(lower), frozen(upper), is_tight=True)


def _within(held: Held, domain: Orthotope) -> Held:
    """Meet with the domain; only the coordinates that exceed it cost a generator and a constraint."""
    lower, upper = held.support.bounds()
    exceeded = (lower < domain.lower) | (upper > domain.upper)
    met = held.support
    if exceeded.any():
        middle = np.where(exceeded, domain.center, np.nan)
        met = met.meet_strips(np.eye(domain.dim), middle, domain.half_widths)
    box = np.maximum(held.lower, domain.lower), np.minimum(held.upper, domain.upper)
    return _tightened(Held(met, *box, is_tight=False))


def _noise_map(model: LSUModel) -> Matrix:
    return np.eye(model.state_count) if model.noise_map is None else model.noise_map


def _mapped(R: Matrix, support: ConstrainedZonotope, added: Vector, widths: Vector) -> ConstrainedZonotope:
    """``R [X; added ± widths]`` with the box of its rounding absorbed."""
    n, g = support.dim, support.generator_count
    used = np.flatnonzero(widths)
    stacked = np.zeros((n + added.size, g + used.size))
    stacked[:n, :g] = support._generators
    stacked[n + used, g + np.arange(used.size)] = widths[used]
    center, generators, slack = zonotope_map(
        np.ascontiguousarray(R), np.concatenate([support._center, added]), stacked, np.zeros(n)
    )
    A = np.zeros((support.constraint_count, g + used.size))
    A[:, :g] = support._A
    generators, A = absorb_box(generators, A, slack)
    return ConstrainedZonotope._of(center, generators, A, support._b)


def _mapped_box(R: Matrix, center: Vector, reach: Vector, widths: Vector) -> Zonotope:
    """``R`` times the box with this centre and half-widths ``[reach; widths]``, as a zonotope."""
    box = Zonotope(center, np.diag(np.concatenate([reach, widths])))
    return box.linear_map(R)


def _reach(lower: Vector, upper: Vector) -> Vector:
    """Half-widths about the rounded centre, rounded up."""
    return Orthotope(lower, upper).half_widths


def _log_ratio(before: Vector, after: Vector) -> float:
    """``ln Π before − ln Π after`` over the coordinates that still have a width, never negative."""
    wide = (before > 0) & (after > 0)
    if ((before > 0) & (after <= 0)).any():
        return math.inf
    return max(0.0, float(np.sum(np.log(before[wide]) - np.log(after[wide]))))
