"""What a run does with a row whose data contradict the set."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Vector
from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.run_record import FilterRun, Status, naming
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

OnInconsistency = Literal["raise", "hold", "reset", "widen"]
WIDEST = 1e9
"""Factor of r above which no factor is sought."""
PRECISION = 0.01
"""Share to which the smallest factor is sought."""


class RowRule:
    """The steps of a run, row after row; contradictions are treated by ``choice``, every other error names its row.

    ``"raise"``: they are raised. ``"hold"``: the row's data are left out. ``"reset"``: the set starts again from the
    model's domain, then takes the row's data. ``"widen"``: r of this row grows by the smallest factor, to 1 %, that
    explains the data. A prediction that misses the domain is replaced by the domain, but with ``"raise"``.
    """

    def __init__(self, filter: Filter, run: FilterRun, choice: OnInconsistency) -> None:
        if choice not in get_args(OnInconsistency):
            listed = ", ".join(f'"{one}"' for one in get_args(OnInconsistency))
            raise ModelError(f"on_inconsistency must be one of {listed}, it is {choice!r}")
        if choice == "reset" and filter.model.domain is None:
            raise ModelError(
                'on_inconsistency="reset" starts again from model.domain, a box that always holds the state, and the '
                'model has none: give it one, or choose "hold" or "widen"'
            )
        self._filter, self._run, self._choice = filter, run, choice
        self._is_new = False

    def update(
        self,
        row: int,
        y: Vector,
        *,
        r: ArrayLike | None = None,
        model: LSUModel | None = None,
        u: ArrayLike | Orthotope | None = None,
    ) -> None:
        """``filter.update``, and the status of the row."""
        with naming(row):
            status = self._update(y, r, model, u=u)
        started_again = self.has_started_again()
        self._run.status[row] = "reset" if started_again and status in ("ok", "missing") else status

    def has_started_again(self) -> bool:
        """Whether the last time update ended in the domain; asked once."""
        is_new, self._is_new = self._is_new, False
        return is_new

    def advance(self, row: int, step: Callable[[], object]) -> None:
        """The time update from this row to the next."""
        with naming(row):
            try:
                step()
            except InconsistentData:
                if self._choice == "raise" or self._filter.model.domain is None:
                    raise
                self._filter.reset(self._filter.model.domain)
                self._is_new = True

    def _update(
        self, y: Vector, r: ArrayLike | None, model: LSUModel | None, u: ArrayLike | Orthotope | None
    ) -> Status:
        filter, domain = self._filter, self._filter.model.domain
        before = filter.snapshot()
        try:
            self._call(y, r, model, u=u)
        except InconsistentData:
            if self._choice == "raise":
                raise
            filter.restore(before)
        else:
            return "missing" if np.isnan(y).all() else "ok"
        if self._choice == "widen" and self._widen(y, r, model, u=u):
            self._run.guarantee = "none"
            return "widened"
        if self._choice == "reset" and domain is not None:
            filter.reset(domain)
            self._explains(y, r, model, u=u)
            return "reset"
        return "held"

    def _widen(self, y: Vector, r: ArrayLike | None, model: LSUModel | None, u: ArrayLike | Orthotope | None) -> bool:
        """Update with r widened; ``False`` where no factor explains the data, as with r = 0."""
        used = (self._filter.model if model is None else model).r if r is None else np.asarray(r, dtype=np.float64)
        before, low, high = self._filter.snapshot(), 1.0, 2.0
        while not self._explains(y, high * used, model, u=u):
            low, high = high, 2.0 * high
            if high > WIDEST:
                return False
        while high - low > PRECISION * low:
            self._filter.restore(before)
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self._explains(y, middle * used, model, u=u) else (middle, high)
        self._filter.restore(before)
        return self._explains(y, high * used, model, u=u)

    def _explains(
        self, y: Vector, r: ArrayLike | None, model: LSUModel | None, u: ArrayLike | Orthotope | None
    ) -> bool:
        """Update, and whether that is not proved to be contradictory; else the filter stays as it is."""
        before = self._filter.snapshot()
        try:
            self._call(y, r, model, u=u)
        except InconsistentData:
            self._filter.restore(before)
            return False
        return True

    def _call(self, y: Vector, r: ArrayLike | None, model: LSUModel | None, u: ArrayLike | Orthotope | None) -> None:
        """``filter.update``; filters of other packages need not know what a plain step does not use."""
        if model is None and self._filter.model.has_plain_outputs:
            self._filter.update(y, r)
        else:
            self._filter.update(y, r, model=model, u=u)
