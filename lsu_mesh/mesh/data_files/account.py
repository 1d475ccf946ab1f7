"""What becomes of every row of a file: played, or left out for a reason that is counted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lsu_mesh.array_types import Flags, Integers
from lsu_mesh.mesh.data_files.data_file import DataFile
from lsu_mesh.mesh.data_files.spans import duration_text, moment_text
from lsu_mesh.mesh.data_files.unplayable import (
    has_other_epoch,
    late_doubt,
    off_grid_doubt,
    period_doubt,
    why_unplayable,
)
from lsu_mesh.mesh.grid import Grid


@dataclass(frozen=True)
class Placement:
    """The step of each row (T,), whether it lies on the grid, and whether it is delivered.

    The rows that are not delivered: of a step before 1, of one after the last, or ``sharing`` a step with an earlier
    row where a step takes one row only.
    """

    steps: Integers
    distance_ns: Integers
    """From the nearest t_k; 0 for files by step."""
    is_before: Flags
    is_after: Flags
    is_sharing: Flags
    is_delivered: Flags


def place(
    data: DataFile,
    grid: Grid,
    last_step: int | None = None,
    *,
    nearest: bool = True,
    shares: bool | None = None,
    tolerance_ns: int = 0,
) -> Placement:
    """Put every row on a step.

    ``nearest``: the step whose t_k is nearest. Else the step with ``t_{k−1} < t ≤ t_k``; a row within
    ``tolerance_ns``, or half the spacing of its time, of a t_k is of step k. ``shares``: any number of rows on a
    step, else the first one only; by default only without ``nearest``.
    """
    steps, distance = _steps(data, grid, nearest=nearest, tolerance_ns=tolerance_ns)
    before = steps < 1
    after = steps > last_step if last_step is not None else np.zeros(len(steps), dtype=bool)
    inside = ~before & ~after
    sharing = np.zeros(len(steps), dtype=bool)
    order = np.argsort(steps, kind="stable")
    sharing[order[1:]] = steps[order[1:]] == steps[order[:-1]]
    sharing &= inside
    return Placement(
        steps=steps,
        distance_ns=distance,
        is_before=before,
        is_after=after,
        is_sharing=sharing,
        is_delivered=inside if _shares(nearest, shares) else inside & ~sharing,
    )


def _shares(nearest: bool, shares: bool | None) -> bool:
    return not nearest if shares is None else shares


def _steps(data: DataFile, grid: Grid, *, nearest: bool, tolerance_ns: int) -> tuple[Integers, Integers]:
    if data.time_ns is None:
        assert data.steps is not None
        return data.steps, np.zeros(data.row_count, dtype=np.int64)
    closest = grid.nearest_steps(data.time_ns)
    distance = np.abs(data.time_ns - grid.times_of(closest))
    if nearest:
        return closest, distance
    on_grid = distance <= np.maximum(data.time_half_ns, tolerance_ns)
    return np.where(on_grid, closest, grid.steps_of(data.time_ns)), distance


@dataclass(frozen=True)
class Account:
    """The rows of a file in numbers; ``rows = delivered + before + after + shared (if left out) + blank``."""

    path: str
    rows: int
    blank: int
    delivered: int
    before: int
    after: int
    sharing: int
    """Rows that share a step with an earlier row, inside the run."""
    leaves_sharing_out: bool
    first_step: int
    last_step: int
    steps_used: int
    steps_without: int
    """Steps between the first and the last that have no row."""
    missing_values: int
    empty_rows: int
    """Rows that are delivered, and hold no value at all."""
    duplicates: int
    """Rows of the very moment, or step, of the row before."""
    out_of_order: int
    span: str
    period: str
    largest_distance_ns: int
    off_grid: int
    """Rows that are not within the tolerance of a t_k."""
    by_tolerance: int
    """Rows that are within the tolerance of a t_k, and not at it."""
    by_time: bool
    notes: tuple[str, ...]
    error: str | None
    """Why nothing can be played, or should not be, and the remedy."""
    doubts: tuple[str, ...]

    @property
    def left_out(self) -> int:
        """Rows that nobody gets."""
        return self.rows - self.delivered

    def lines(self) -> list[str]:
        """For people: what the file holds, and where its rows go."""
        found = [f"{self.path}: {_count(self.rows, 'row')}, {self.span}; {self.period}"]
        used = f"{_count(self.delivered, 'row')} on {_count(self.steps_used, 'step')}"
        if self.steps_used:
            used += f", {self.first_step} to {self.last_step}, {self.steps_without} of them without a row"
        found.append(f"  played: {used}; {_count(self.missing_values, 'value')} missing")
        if self.by_time:
            far = duration_text(self.largest_distance_ns)
            found.append(f"  farthest from the grid: {far}; {_count(self.off_grid, 'row')} off the grid")
            if self.by_tolerance:
                found.append(f"  on the grid within the tolerance, and not exactly: {_count(self.by_tolerance, 'row')}")
        found.append(f"  left out: {self._reasons() or 'nothing'}")
        if self.out_of_order or self.duplicates:
            found.append(
                f"  order: {_count(self.out_of_order, 'row')} after a later one (sorted), "
                f"{self.duplicates} at the same moment as another"
            )
        return found + [f"  note: {note}" for note in self.notes]

    def warnings(self) -> list[str]:
        """One line where rows are left out, and one per doubt; nothing if all is played."""
        found = []
        if self.left_out and self.error is None:
            found.append(f"{self.path}: {self.left_out} of {self.rows} rows are left out: {self._reasons()}")
        return found + [f"{self.path}: {doubt}" for doubt in self.doubts]

    def _reasons(self) -> str:
        counts = (
            (self.before, "before start_time" if self.by_time else "before step 1"),
            (self.after, "after the last step of the run"),
            (
                self.sharing if self.leaves_sharing_out else 0,
                "share a step with an earlier row (a smaller dt keeps them)",
            ),
            (self.blank, "blank"),
        )
        return ", ".join(f"{count} {words}" for count, words in counts if count)


def account(
    data: DataFile,
    grid: Grid,
    last_step: int | None = None,
    *,
    nearest: bool = True,
    shares: bool | None = None,
    tolerance_ns: int | None = None,
) -> Account:
    """Count what becomes of every row, as :func:`place` puts it.

    ``tolerance_ns`` defaults to half a unit of the last digit of the file's times, at least 1 ns.
    """
    tolerance = max(1, data.digit_ns // 2) if tolerance_ns is None else tolerance_ns
    shares = _shares(nearest, shares)
    placed = place(data, grid, last_step, nearest=nearest, shares=shares, tolerance_ns=tolerance)
    values, delivered = data.values, placed.is_delivered
    used = placed.steps[delivered & ~placed.is_sharing]  # each step once
    first, last = (int(used.min()), int(used.max())) if len(used) else (0, 0)
    index = data.time_ns if data.time_ns is not None else data.steps
    assert index is not None
    gaps = np.diff(index)
    off_grid = placed.distance_ns > np.maximum(data.time_half_ns, tolerance)
    is_missing = np.isnan(values if delivered.all() else values[delivered])
    return Account(
        path=str(data.path), rows=data.row_count + data.blank, blank=data.blank, delivered=int(delivered.sum()),
        before=int(placed.is_before.sum()), after=int(placed.is_after.sum()), sharing=int(placed.is_sharing.sum()),
        leaves_sharing_out=not shares, first_step=first, last_step=last,
        steps_used=len(used), steps_without=last - first + 1 - len(used) if len(used) else 0,
        missing_values=int(is_missing.sum()), empty_rows=int(is_missing.all(axis=1).sum()),
        duplicates=int((gaps == 0).sum()), out_of_order=data.out_of_order, span=_span(data), period=_period(data, gaps),
        largest_distance_ns=int(placed.distance_ns[delivered].max(initial=0)),
        off_grid=int((off_grid & delivered).sum()),
        by_tolerance=int((~off_grid & delivered & (placed.distance_ns > data.time_half_ns)).sum()),
        by_time=data.time_ns is not None, notes=data.notes,
        error=why_unplayable(data, grid, last_step) if not delivered.any() or has_other_epoch(data, grid) else None,
        doubts=(
            *off_grid_doubt(placed.distance_ns[off_grid & delivered], nearest and not shares),
            *period_doubt(data, grid, gaps),
            *late_doubt(data, grid, first),
        ),
    )  # fmt: skip


def _span(data: DataFile) -> str:
    if data.time_ns is not None:
        first, last = int(data.time_ns[0]), int(data.time_ns[-1])
        return f"{moment_text(first)} to {moment_text(last)} ({duration_text(last - first)})"
    assert data.steps is not None
    return f"steps {data.steps[0]} to {data.steps[-1]}"


def _period(data: DataFile, gaps: Integers) -> str:
    between = gaps[gaps > 0]
    if not len(between):
        return "no period: all rows are of one moment"
    median, low, high = int(np.median(between)), int(between.min()), int(between.max())
    if data.time_ns is None:
        return f"every {median} step{'s' if median > 1 else ''} (from {low} to {high})"
    return f"period {duration_text(median)} (from {duration_text(low)} to {duration_text(high)})"


def _count(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"
