"""The state of a filter as its numbers, bit by bit, and what has to leave it as it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.filter import Filter
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support
from lsu_mesh.testing.membership import hull_of_parts, numbers_of

State = tuple[object, ...]
ROUNDING = 1e-12
"""Share of a bound's size by which a transfer may move it outward: wider, never narrower. The new edges of a
parallelotope have to leave room for their rounding."""
SAFE_BOUND = 1e-9
"""Share of a bound's size by which it may exceed that of the support: wider, never narrower. Both may be safe bounds of
different linear programs, with room for their rounding."""


def state_of(filter: Filter) -> State:
    """All that a filter publishes, bit by bit."""
    arrays = (*filter.bounds(), filter.point, *filter.predict_output())
    return numbers_of(filter.support), *((array.shape, array.tobytes()) for array in arrays)


class Witness:
    """Watches a filter; every failure says where it was."""

    def __init__(self, filter: Filter, where: str) -> None:
        self._filter, self._where = filter, where
        self.step = 0
        self.action = "start"

    def failure(self, found: str, expected: str) -> AssertionError:
        """The error to raise."""
        return AssertionError(f"{self._where}, step {self.step}, {self.action}: found {found}; expected {expected}")

    def expect(self, holds: bool, found: str, expected: str) -> None:
        """Raises :meth:`failure` unless the statement holds."""
        if not holds:
            raise self.failure(found, expected)

    def check_shapes(self, support: Support) -> None:
        """Everything published has the model's lengths and is finite, its bounds do not cross."""
        filter, model = self._filter, self._filter.model
        n, m, q = model.state_count, model.output_count, model.rho.size
        band, (lower, upper), (rho, r) = filter.predict_output(), filter.bounds(), filter.half_widths
        named = {
            "point": (filter.point, n), "lower bounds": (lower, n), "upper bounds": (upper, n),
            "predict_output().lower": (band.lower, m), "predict_output().upper": (band.upper, m),
            "predict_output().point": (band.point, m), "half_widths[0]": (rho, q), "half_widths[1]": (r, m),
        }  # fmt: skip
        for name, (array, size) in named.items():
            if array.shape != (size,) or not np.isfinite(array).all():
                raise self.failure(f"{name} {array} of shape {array.shape}", f"{size} finite numbers")
        if support.dim != n:
            raise self.failure(f"a support of dimension {support.dim}", f"dimension {n}")
        for name, low, high in (("bounds", lower, upper), ("predict_output", band.lower, band.upper)):
            if not (low <= high).all():
                raise self.failure(f"{name} that cross, [{low}, {high}]", "lower <= upper")

    def check_volume(self) -> None:
        """The volume is a number."""
        volume = self._filter.volume()
        self.expect(volume >= 0.0, f"the volume {volume}", "a number, not negative")

    def check_bounds_within(self, support: Support) -> None:
        """The bounds are not wider than the interval hull of the support, but for rounding."""
        (lower, upper), (low, high) = self._filter.bounds(), hull_of_parts(support)
        slack = SAFE_BOUND * np.maximum(np.abs(low), np.abs(high))
        if (lower < low - slack).any() or (upper > high + slack).any():
            raise self.failure(
                f"bounds wider than those of the support, by {np.maximum(low - lower, upper - high)}",
                f"bounds within [{low}, {high}]",
            )

    def check_same(self, before: State, what: str) -> None:
        """The filter publishes what it did before."""
        self.expect(state_of(self._filter) == before, f"another state after {what}", "the state kept, bit by bit")

    def check_no_data_changes_nothing(self) -> None:
        """An update of which all outputs are missing."""
        before = state_of(self._filter)
        self._filter.update(np.full(self._filter.model.output_count, np.nan))
        self.check_same(before, "an update with all outputs missing")

    def check_errors_keep_the_state(self, far: Vector | None, must_contradict: bool = True) -> None:
        """Data, sets and arguments that cannot be: an error of the right class, and the state is kept."""
        filter, model = self._filter, self._filter.model
        n, m, p = model.state_count, model.output_count, model.input_count
        if far is not None:
            self._refused("an update that contradicts the set", lambda: filter.update(far), must_contradict)
        lower, upper = filter.bounds()
        reach = upper - lower + np.maximum(np.abs(lower), np.abs(upper)) + 1.0
        away = Orthotope(upper + reach, upper + 2.0 * reach)
        self._refused("a transfer of a set far away", lambda: filter.condition(away), must_contradict)
        self._malformed("update with one output too many", lambda: filter.update(np.zeros(m + 1)))
        self._malformed("update with an infinite output", lambda: filter.update(np.full(m, np.inf)), m > 0)
        self._malformed("predict without the input", filter.predict, p > 0)
        self._malformed("predict with one input too many", lambda: filter.predict(np.zeros(p + 1)))
        wide = Orthotope(np.zeros(n + 1), np.ones(n + 1))
        self._malformed("condition on a set of another dimension", lambda: filter.condition(wide))
        self._malformed("reset to a set of another dimension", lambda: filter.reset(wide))

    def _refused(self, what: str, act: Callable[[], object], must_contradict: bool) -> None:
        before, held = state_of(self._filter), self._filter.snapshot()
        try:
            act()
        except InconsistentData:
            self.check_same(before, what)
        else:
            self.expect(not must_contradict, f"no error at {what}", "InconsistentData")
            self._filter.restore(held)

    def _malformed(self, what: str, act: Callable[[], object], applies: bool = True) -> None:
        if not applies:
            return
        before = state_of(self._filter)
        try:
            act()
        except ModelError:
            self.check_same(before, what)
        else:
            raise self.failure(f"no error at {what}", "ModelError")

    def check_snapshot(self, act: Callable[[], object]) -> None:
        """What comes after a snapshot does not touch it, and comes again bit by bit after it is restored; twice."""
        held, before = self._filter.snapshot(), state_of(self._filter)
        act()
        after = state_of(self._filter)
        for _ in range(2):
            self._filter.restore(held)
            self.check_same(before, "restore(snapshot())")
            act()
            self.check_same(after, "restore(snapshot()) and the same step again")
        self._filter.restore(held)

    def check_copies(self, transfer: Callable[[], object], count: int, predict: Callable[[], object]) -> None:
        """The set that was just transferred changes nothing when it comes again, also after a snapshot is restored."""
        before, held = state_of(self._filter), self._filter.snapshot()
        for number in range(count):
            transfer()
            self.check_same(before, f"the same set transferred {number + 2} times in a row")
        predict()
        self._filter.restore(held)
        transfer()
        self.check_same(before, "restore(snapshot()) and the same set transferred once more")

    def check_resumption(self, other: Filter, act: Callable[[Filter], object]) -> None:
        """A filter that says so goes on from the published set as this one does, bit by bit."""
        if not self._filter.is_resumable:
            return
        other.resume(self._filter.support, *(side.copy() for side in self._filter.bounds()))
        if self._filter.density is not None:
            other.take_density(self._filter.density)
        held = self._filter.snapshot()
        act(self._filter)
        expected = state_of(self._filter)
        self._filter.restore(held)
        act(other)
        self.expect(state_of(other) == expected, "other sets after resume", "those of this filter, bit by bit")
