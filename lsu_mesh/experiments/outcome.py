"""What an experiment hands back: tables, checks against the numbers to reach, and figures."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NOTHING = "–"
"""A cell of a column of numbers that holds none."""
SPREAD = " (mean ± sd)"
"""End of the title of a column with spreads."""
ROUNDING = 1e-12
"""Share of the largest value below which a deviation is one of rounding."""


class Spread(NamedTuple):
    """A number measured in several runs: mean, and standard deviation over the runs (NaN where there is but one)."""

    mean: float
    sd: float

    @classmethod
    def of(cls, values: ArrayLike) -> Spread:
        """Mean and standard deviation (n − 1) of one number per run; a deviation that is mere rounding is 0."""
        runs = np.asarray(values, dtype=np.float64).ravel()
        sd = float(runs.std(ddof=1)) if runs.size > 1 else math.nan
        return cls(float(runs.mean()), 0.0 if sd <= ROUNDING * float(np.abs(runs).max()) else sd)

    def printed(self, form: str) -> str:
        """``mean ± sd``, the standard deviation with two digits; the number alone where there is one run."""
        mean = _text(self.mean, form)
        return mean if math.isnan(self.sd) else f"{mean} ± {_text(self.sd, '.2g')}"


Cell = str | int | float | Spread


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
        return all(not isinstance(row[column], str) or row[column] == NOTHING for row in self.rows)

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
        """The unrounded numbers, with a line of titles; mean and standard deviation have a column each."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self._split_titles())
        writer.writerows(map(self._split, self.rows))
        return text.getvalue()

    def records(self) -> list[dict[str, str | int | float | None]]:
        """One mapping per row, for JSON, with the columns of :meth:`csv`; numbers that are not finite become None."""
        titles = self._split_titles()
        return [dict(zip(titles, map(plain_number, self._split(row)), strict=True)) for row in self.rows]

    def _is_split(self, column: int) -> bool:
        return any(isinstance(row[column], Spread) for row in self.rows)

    def _split_titles(self) -> list[str]:
        titles = []
        for i, column in enumerate(self.columns):
            titles += [column.title.removesuffix(SPREAD), "sd"] if self._is_split(i) else [column.title]
        return titles

    def _split(self, row: tuple[Cell, ...]) -> list[str | int | float]:
        cells: list[str | int | float] = []
        for i, cell in enumerate(row):
            if isinstance(cell, Spread):
                cells += cell
            else:
                cells += [cell, ""] if self._is_split(i) else [cell]
        return cells


class Check(NamedTuple):
    """A number to reach: what is measured, the number, the limit, and whether it must not exceed or not undercut it."""

    what: str
    measured: float
    limit: float
    sense: str = "at most"

    @property
    def is_met(self) -> bool:
        """Whether the number is reached; never one of numpy's, which JSON does not know."""
        return bool(self.measured <= self.limit if self.sense == "at most" else self.measured >= self.limit)

    def record(self) -> dict[str, str | int | float | bool | None]:
        """A mapping for JSON: the fields, and ``met``; numbers that are not finite become None."""
        return {name: plain_number(value) for name, value in self._asdict().items()} | {"met": self.is_met}

    def __str__(self) -> str:
        verdict = "met" if self.is_met else "NOT MET"
        return f"{verdict}: {self.what} = {self.measured:.4g} ({self.sense} {self.limit:.4g})"


def between(what: str, measured: float, low: float, high: float) -> list[Check]:
    """Both checks of a number that should lie in [low, high]."""
    return [Check(what, measured, low, "at least"), Check(what, measured, high)]


class Outcome(NamedTuple):
    """Tables, checks, and figures by the stem of their file; a figure is drawn when its function is called.

    What holds measured times, and so differs from run to run, has ``times`` in its name. The rest is words for the page
    (Markdown): ``title`` of the section, ``notes`` above the tables, ``captions`` of figures by stem, ``errata`` of the
    paper.
    """

    tables: Sequence[Table]
    checks: Sequence[Check]
    figures: Mapping[str, Callable[[], Figure]]
    title: str = ""
    notes: str = ""
    captions: Mapping[str, str] = MappingProxyType({})
    errata: Sequence[str] = ()


def percent(share: float) -> float:
    """A share in per cent, two decimals, rounded down: 100 only where it is exactly that."""
    return math.floor(10000.0 * share) / 100.0


def _text(cell: Cell, form: str) -> str:
    if isinstance(cell, str):
        return cell
    if isinstance(cell, Spread):
        return cell.printed(form)
    if isinstance(cell, float) and not math.isfinite(cell):
        return NOTHING if math.isnan(cell) else "∞"
    return f"{cell:{form}}" if isinstance(cell, float) else str(cell)


def plain_number(cell: str | int | float) -> str | int | float | None:
    """A cell as JSON knows it: Python's own types, and None for a number that is not finite."""
    own = cell.item() if isinstance(cell, np.generic) else cell
    return None if isinstance(own, float) and not math.isfinite(own) else own
