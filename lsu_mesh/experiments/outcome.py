"""What an experiment hands back: tables, checks against the numbers to reach, and figures."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Cell = str | int | float


class Column(NamedTuple):
    """A column's title and how its numbers are printed (a format specification)."""

    title: str
    form: str = ".3g"


class Table(NamedTuple):
    """Rows of cells under titled columns; ``name`` is the stem of its files, ``title`` a sentence for people."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: Sequence[tuple[Cell, ...]]
    is_for_files: bool = False
    """Whether it is too long to be read: it is only written as CSV."""

    def printed(self) -> list[list[str]]:
        """All cells as text."""
        return [[_text(cell, column.form) for cell, column in zip(row, self.columns, strict=True)] for row in self.rows]

    def is_numeric(self, column: int) -> bool:
        """Whether a column holds numbers, which are aligned to the right."""
        return all(not isinstance(row[column], str) for row in self.rows)

    def markdown(self) -> str:
        """The table for a document, with its title above."""
        titles = [column.title for column in self.columns]
        rules = ["--:" if self.is_numeric(i) else ":--" for i in range(len(titles))]
        lines = [titles, rules, *self.printed()]
        return f"{self.title}\n\n" + "".join(f"| {' | '.join(cells)} |\n" for cells in lines)

    def plain(self) -> str:
        """The table for a terminal without colours."""
        rows = [[column.title for column in self.columns], *self.printed()]
        widths = [max(len(row[i]) for row in rows) for i in range(len(self.columns))]
        right = [self.is_numeric(i) for i in range(len(self.columns))]
        lines = [
            "  ".join(cell.rjust(w) if r else cell.ljust(w) for cell, w, r in zip(row, widths, right, strict=True))
            for row in rows
        ]
        return "\n".join([self.title, *(line.rstrip() for line in lines)])

    def csv(self) -> str:
        """The unrounded numbers, with a line of titles."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([column.title for column in self.columns])
        writer.writerows(self.rows)
        return text.getvalue()

    def records(self) -> list[dict[str, Cell | None]]:
        """One mapping per row, for JSON: numbers that are not finite become None."""
        titles = [column.title for column in self.columns]
        return [dict(zip(titles, map(_finite, row), strict=True)) for row in self.rows]


class Check(NamedTuple):
    """A number to reach: what is measured, the number, the limit, and whether it must not exceed or not undercut it."""

    what: str
    measured: float
    limit: float
    sense: str = "at most"

    @property
    def is_met(self) -> bool:
        """Whether the number is reached."""
        return self.measured <= self.limit if self.sense == "at most" else self.measured >= self.limit

    def __str__(self) -> str:
        verdict = "met" if self.is_met else "NOT MET"
        return f"{verdict}: {self.what} = {self.measured:.4g} ({self.sense} {self.limit:.4g})"


class Outcome(NamedTuple):
    """Tables, checks, and figures by the stem of their file; a figure is drawn when its function is called."""

    tables: Sequence[Table]
    checks: Sequence[Check]
    figures: Mapping[str, Callable[[], Figure]]


def percent(share: float) -> float:
    """A share in per cent, two decimals, rounded down: 100 only where it is exactly that."""
    return math.floor(10000.0 * share) / 100.0


def _text(cell: Cell, form: str) -> str:
    if isinstance(cell, str):
        return cell
    if isinstance(cell, float) and not math.isfinite(cell):
        return "–" if math.isnan(cell) else "∞"
    return f"{cell:{form}}" if isinstance(cell, float) else str(cell)


def _finite(cell: Cell) -> Cell | None:
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell
