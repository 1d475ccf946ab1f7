"""A paper's numbers beside ours: one row each, with a verdict that a rule gives, not a person.

``reproduced``: ours differs from the paper's by no more than two standard deviations of a single run, or by no more
than a tenth. ``same trend``: it differs by more, but the statement that the paper draws from it holds here too. ``not
reproduced`` ends with the reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from lsu_mesh.experiments.outcome import NOTHING, SPREAD, Cell, Column, Spread, Table

REPRODUCED = "reproduced"
SAME_TREND = "same trend"
NOT_REPRODUCED = "not reproduced"
VERDICTS = (REPRODUCED, SAME_TREND, NOT_REPRODUCED)
DEVIATIONS = 2.0
SHARE = 0.1


class Row(NamedTuple):
    """One line of a comparison: ``labels`` (a cell per leading column), the paper's number, ours, and the verdict."""

    labels: tuple[str, ...]
    paper: Cell
    here: Cell
    verdict: str


def compared(
    labels: tuple[str, ...], paper: float, here: Spread | float, *, trend: bool | None = None, why: str = ""
) -> Row:
    """A number of the paper.

    ``trend``: whether the paper's statement holds here, or None where it states nothing about this number. ``why``
    explains a deviation; it is not printed where there is none.
    """
    measured = here if isinstance(here, Spread) else Spread(here, math.nan)
    return Row(labels, paper, here, _verdict(paper, measured, trend, why))


def stated(labels: tuple[str, ...], paper: str, here: Cell, *, holds: bool, why: str = "") -> Row:
    """A statement of the paper in words; ``holds`` says whether it is true here."""
    return Row(labels, paper, here, REPRODUCED if holds else _with(NOT_REPRODUCED, why or "it does not hold here"))


def trend_stated(labels: tuple[str, ...], paper: str, here: Cell, *, holds: bool, why: str) -> Row:
    """A statement in words that holds here in direction, not in size (``why`` states the difference)."""
    return Row(labels, paper, here, _with(SAME_TREND if holds else NOT_REPRODUCED, why))


def ours(labels: tuple[str, ...], here: Cell) -> Row:
    """A number that the paper does not give."""
    return Row(labels, NOTHING, here, NOTHING)


def table(name: str, title: str, titles: Sequence[str], rows: Iterable[Row], form: str = ".3g") -> Table:
    """The comparison; ``titles`` are those of the leading columns."""
    columns = (
        *map(Column, titles),
        Column("paper", ".4g"),
        Column(f"here{SPREAD}", form),
        Column("verdict"),
    )
    return Table(name, title, columns, [(*row.labels, row.paper, row.here, row.verdict) for row in rows])


def count(tables: Iterable[Table]) -> dict[str, int]:
    """How often each verdict is given in those tables that have one."""
    given = [
        str(row[-1]) for table in tables if table.columns and table.columns[-1].title == "verdict" for row in table.rows
    ]
    return {verdict: sum(text.startswith(verdict) for text in given) for verdict in VERDICTS}


def _verdict(paper: float, here: Spread, trend: bool | None, why: str) -> str:
    distance = abs(here.mean - paper)
    deviation = 0.0 if math.isnan(here.sd) else here.sd
    if distance <= max(DEVIATIONS * deviation, SHARE * abs(paper)):
        return REPRODUCED
    ratio = here.mean / paper if paper else 0.0
    size = f"{ratio:.2g} × the paper's" if 1e-3 < ratio < 1e3 else f"{here.mean:.2g} instead of {paper:g}"
    return _with(SAME_TREND if trend else NOT_REPRODUCED, f"{size}; {why}" if why else size)


def _with(verdict: str, why: str) -> str:
    return f"{verdict}: {why}" if why else verdict
