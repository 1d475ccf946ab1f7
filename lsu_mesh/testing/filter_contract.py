"""What every filter promises, checked against a truth in exact rationals."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.filter import Filter
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support
from lsu_mesh.testing.estimate_contract import check_estimates
from lsu_mesh.testing.exact_plant import Exact, exact_product, inside_box
from lsu_mesh.testing.filter_cases import SHAPES, Moment, Problem, around, common_points, draw_problem
from lsu_mesh.testing.filter_limits import check_limits
from lsu_mesh.testing.filter_state import ROUNDING, Witness
from lsu_mesh.testing.membership import exceeds, is_outside

Make = Callable[[LSUModel, Orthotope], Filter]

SEEDS = 57
"""Problems by default: three of each kind."""
COPIES = 5
"""How often the same set is transferred again: a copy says nothing new, so no bit may change by it."""
MAX_ENUMERATED = 3
"""States up to which common points beside the true state are looked for: vertices in more dimensions take long."""
DIRECTIONS = 3
"""Random directions in which the support function is compared with the truth."""


def check_filter(make: Make, seeds: int | Iterable[int] = SEEDS, steps: int = 5, points: bool = True) -> None:
    """Check every promise of the contract :class:`~lsu_mesh.filters.filter.Filter` on a filter of your own.

    Parameters
    ----------
    make:
        ``(model, prior) → filter``, for any model with 1–6 states and any box as prior, as the class itself.
    seeds:
        Seeds of the problems, or how many: models with singular A, r = 0, rho = 0, flat and huge priors, missing rows,
        input boxes, domains, numbers of 1e±150; noise at its bounds, so that a set that is a little too small loses
        the truth.
    steps:
        Data updates per problem.
    points:
        Whether the published point has to lie in the bounds and in the support, too, but for ``point_rule = "centre"``:
        it must not be proved to lie outside, by exact arithmetic of boxes and parallelotopes, else by the set's own
        ``contains``. A set that is thinner than the rounding of its numbers may hold no double: there the point may lie
        beside the support by a share of 1e-12.

    Raises
    ------
    AssertionError
        Names the case, its seed and step, what was found and what was expected.

    A filter with ``guarantee = "none"`` is checked for what it promises only: shapes, finite numbers, snapshots, and
    the state kept after an error.
    """
    probe = make(
        LSUModel(A=[[1.0]], B=None, C=[[1.0]], rho=0.1, r=0.1, domain=([-9.0], [9.0])), Orthotope([-1.0], [1.0])
    )
    if not isinstance(probe, Filter):
        raise AssertionError(f"make(model, prior) gives {probe!r}; expected a Filter")
    chosen = range(seeds) if isinstance(seeds, int) else seeds
    if probe.guarantee == "none":
        check_estimates(make, chosen, steps)
        return
    for seed in chosen:
        _Run(make, draw_problem(seed, steps), points).follow()
    check_limits(make)


class _Run:
    """One filter on one problem."""

    def __init__(self, make: Make, problem: Problem, points: bool) -> None:
        self._make, self._problem, self._points = make, problem, points
        self._rng = np.random.default_rng([problem.seed, 1])
        self._filter = make(problem.model, problem.prior)
        where = f"{type(self._filter).__name__}, case {problem.kind!r}, seed {problem.seed}"
        self._witness = Witness(self._filter, where)

    def follow(self) -> None:
        """All steps of the path; numbers of 1e150 may end in ``UnboundedSupport``."""
        chosen = int(self._rng.integers(len(self._problem.path)))
        try:
            for i, moment in enumerate(self._problem.path):
                self._witness.step = i + 1
                self._check_step(moment, with_errors=i == chosen, with_transfer=self._rng.random() < 0.5)
                if i + 1 < len(self._problem.path):
                    self._predict(moment, self._problem.path[i + 1].x)
        except UnboundedSupport as error:
            if self._problem.kind != "large numbers":
                raise self._witness.failure(f"UnboundedSupport: {error}", "a bounded set, there is one") from error
        except InconsistentData as error:
            raise self._witness.failure(f"InconsistentData: {error}", "a set, all data are true") from error

    def _check_step(self, moment: Moment, with_errors: bool, with_transfer: bool) -> None:
        witness, filter = self._witness, self._filter
        witness.action = "before update"
        self._holds(moment.x)
        self._check_output(moment)
        if with_errors:
            witness.check_volume()
            witness.check_no_data_changes_nothing()
            witness.check_errors_keep_the_state(self._far_output())
            witness.check_snapshot(lambda: filter.update(moment.y, moment.r))
        witness.action = "update"
        filter.update(moment.y, moment.r)
        self._holds(moment.x, decided=with_errors)
        if with_errors:
            witness.check_snapshot(lambda: filter.predict(moment.u, moment.rho, moment.model))
            witness.check_resumption(
                self._make(self._problem.model, self._problem.prior),
                lambda one: one.predict(moment.u, moment.rho, moment.model),
            )
        if with_transfer:
            self._condition(moment)

    def _predict(self, moment: Moment, x: Exact) -> None:
        self._witness.action = "predict"
        self._filter.predict(moment.u, moment.rho, moment.model)
        self._holds(x)

    def _condition(self, moment: Moment) -> None:
        """A transfer of a set that holds the truth: no common point is lost, nothing widens, copies change nothing."""
        x, before = moment.x, self._filter.bounds()
        shape = str(self._rng.choice(SHAPES))
        own = self._filter.support
        other = around(x, shape, before[1] - before[0], own=own, rng=self._rng)
        if other is None:
            return
        points = common_points(x, own, before, other=other, rng=self._rng) if len(x) <= MAX_ENUMERATED else []
        self._witness.action = f"condition on a {shape}"
        self._transfer(other, x)
        lower, upper = self._filter.bounds()
        for point in points:
            if not inside_box(lower, upper, point) or is_outside(self._filter.support, point):
                raise self._witness.failure(
                    f"a set without {_shown(point)}, which lies in the set before and in the transferred one",
                    "a set that holds all of both",
                )
        self._witness.check_copies(
            lambda: self._filter.condition(other),
            COPIES,
            lambda: self._filter.predict(moment.u, moment.rho, moment.model),
        )

    def _transfer(self, other: Support, x: Exact) -> None:
        lower, upper = (side.copy() for side in self._filter.bounds())
        gain = self._filter.condition(other)
        self._witness.expect(gain >= 0.0, f"the gain {gain}", "a number of nats, not negative")
        self._holds(x)
        new_lower, new_upper = self._filter.bounds()
        slack = ROUNDING * np.maximum(np.abs(lower), np.abs(upper))
        if (new_lower < lower - slack).any() or (new_upper > upper + slack).any():
            raise self._witness.failure(
                f"bounds [{new_lower}, {new_upper}]", f"none outside of those before, [{lower}, {upper}]"
            )

    def _holds(self, x: Exact, *, decided: bool = False) -> None:
        """The exact state lies in the bounds and in the support, and these fit together."""
        lower, upper = self._filter.bounds()
        support, witness = self._filter.support, self._witness
        witness.check_shapes(support)
        for i, value in enumerate(x):
            if not inside_box(lower[[i]], upper[[i]], [value]):
                name = self._problem.model.states[i]
                raise witness.failure(
                    f"bounds [{lower[i]!r}, {upper[i]!r}] of {name} without the true state {float(value)!r}",
                    "bounds that hold it",
                )
        if is_outside(support, x, decided=decided):
            raise witness.failure(f"a support without the true state {_shown(x)}", "a support that holds it")
        for d in self._rng.normal(size=(DIRECTIONS, len(x))).tolist():
            if exceeds(support, d, x):
                raise witness.failure(f"support({d}) = {support.support(d)!r}", "at least d'x of the true state")
        witness.check_bounds_within(support)
        if self._points and self._filter.point_rule != "centre":
            self._point_is_inside(support, lower, upper)

    def _point_is_inside(self, support: Support, lower: Vector, upper: Vector) -> None:
        """The published point lies in the bounds, and is not proved to lie outside of the support."""
        point = [Fraction(v) for v in self._filter.point.tolist()]
        where = "" if inside_box(lower, upper, point) else f"the bounds [{lower}, {upper}]"
        if not where and is_outside(support, point, decided=False):
            slack = np.full(lower.size, ROUNDING * max(np.abs(lower).max(), np.abs(upper).max()))
            wider = support.minkowski_sum(Orthotope(-slack, slack))
            where = "the support" if is_outside(wider, point, decided=False) else ""
        self._witness.expect(
            not where,
            f"the point {_shown(point)}, by the rule {self._filter.point_rule!r}, outside of {where}",
            'a point of the set, or point_rule = "centre"',
        )

    def _check_output(self, moment: Moment) -> None:
        """The band before the data holds ``C x``, and y unless the step has bounds of its own."""
        band, names = self._filter.predict_output(), self._problem.model.outputs
        values = exact_product(self._problem.model.C, moment.x)
        told = [Fraction(v) for v in moment.y.tolist() if v == v] if moment.r is None else []
        known = np.flatnonzero(~np.isnan(moment.y)).tolist() if moment.r is None else []
        for i, value in [*enumerate(values), *zip(known, told, strict=True)]:
            if not inside_box(band.lower[[i]], band.upper[[i]], [value]):
                raise self._witness.failure(
                    f"predict_output of {names[i]} in [{band.lower[i]!r}, {band.upper[i]!r}] without {float(value)!r}",
                    "an interval that holds the output",
                )

    def _far_output(self) -> Vector | None:
        """Outputs of which one is far outside of what the set allows; ``None`` without outputs."""
        model = self._problem.model
        if model.output_count == 0:
            return None
        i = int(self._rng.integers(model.output_count))
        band, row = self._filter.predict_output(), model.C[i]
        high = max(float(band.upper[i]), self._filter.support.support(row) + float(model.r[i]))
        low = min(float(band.lower[i]), -self._filter.support.support(-row) - float(model.r[i]))
        y = np.full(model.output_count, np.nan)
        y[i] = high + 3.0 * (high - low) + 0.5 * max(abs(high), abs(low)) + 1.0
        return y


def _shown(x: Exact) -> str:
    return str([float(v) for v in x])
