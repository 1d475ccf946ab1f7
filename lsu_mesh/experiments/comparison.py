"""A paper's numbers beside ours: one row each, with a verdict that a rule gives, not a person.

A number is ``reproduced`` where ours differs from the paper's by no more than two standard deviations of a single run,
or by no more than a tenth. It is ``undecided`` up to three standard deviations, and beyond them a ``deviation``. A
statement in words is ``reproduced`` where it is true here, and ``same trend`` where only its direction is. It is
``undecided`` where the answer depends on what the paper leaves open, else ``not reproduced``. A deviation, and what is
not reproduced, ends with a reason that the experiment has computed, or with ``unexplained``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from lsu_mesh.experiments.outcome import NOTHING, ROUNDING, SPREAD, Cell, Column, Spread, Table

REPRODUCED = "reproduced"
SAME_TREND = "same trend"
UNDECIDED = "undecided"
DEVIATION = "deviation"
NOT_REPRODUCED = "not reproduced"
VERDICTS = (REPRODUCED, SAME_TREND, UNDECIDED, DEVIATION, NOT_REPRODUCED)
UNEXPLAINED = "unexplained"
NEAR, FAR = 2.0, 3.0
"""Standard deviations up to which a number is reproduced, and beyond which it deviates."""
SHARE = 0.1


class Row(NamedTuple):
    """One line of a comparison: ``labels`` (a cell per leading column), the paper's number, ours, z, the verdict."""

    labels: tuple[str, ...]
    paper: Cell
    here: Cell
    z: Cell
    verdict: str


def compared(labels: tuple[str, ...], paper: float, here: Spread | float, *, why: str = UNEXPLAINED) -> Row:
    """A number of the paper; ``why`` is printed where it deviates."""
    measured = here if isinstance(here, Spread) else Spread(here, math.nan)
    varies = measured.sd > ROUNDING * max(abs(paper), abs(measured.mean))
    z = (measured.mean - paper) / measured.sd if varies else math.nan
    return Row(labels, paper, here, z=z, verdict=_verdict(paper, measured, z, why))


def left_open(labels: tuple[str, ...], paper: float, here: Spread, *, why: str) -> Row:
    """A number of the paper that depends on what it does not give, as ``why`` says."""
    row = compared(labels, paper, here)
    return row if row.verdict == REPRODUCED else row._replace(verdict=_with(UNDECIDED, why))


def stated(labels: tuple[str, ...], paper: str, here: Cell, *, holds: bool | None, why: str = UNEXPLAINED) -> Row:
    """A statement of the paper in words; ``holds`` says whether it is true here, None that it is undecided."""
    verdict = REPRODUCED if holds else _with(UNDECIDED if holds is None else NOT_REPRODUCED, why)
    return Row(labels, paper, here, z=NOTHING, verdict=verdict)


def trend_stated(labels: tuple[str, ...], paper: str, here: Cell, *, holds: bool, why: str) -> Row:
    """A statement in words that holds here in direction, not in size (``why`` states the difference)."""
    return Row(labels, paper, here, z=NOTHING, verdict=_with(SAME_TREND if holds else NOT_REPRODUCED, why))


def ours(labels: tuple[str, ...], here: Cell) -> Row:
    """A number that the paper does not give."""
    return Row(labels, NOTHING, here, z=NOTHING, verdict=NOTHING)


def table(name: str, title: str, titles: Sequence[str], rows: Iterable[Row], form: str = ".3g") -> Table:
    """The comparison; ``titles`` are those of the leading columns."""
    columns = (
        *map(Column, titles),
        Column("paper", ".4g"),
        Column(f"here{SPREAD}", form),
        Column("z", ".2g"),
        Column("verdict"),
    )
    return Table(name, title, columns, [(*row.labels, row.paper, row.here, row.z, row.verdict) for row in rows])


def count(tables: Iterable[Table]) -> dict[str, int]:
    """How often each verdict is given in those tables that have one."""
    given = [
        str(row[-1]) for table in tables if table.columns and table.columns[-1].title == "verdict" for row in table.rows
    ]
    return {verdict: sum(text.startswith(verdict) for text in given) for verdict in VERDICTS}


def _verdict(paper: float, here: Spread, z: float, why: str) -> str:
    if abs(z) <= NEAR or abs(here.mean - paper) <= SHARE * abs(paper):
        return REPRODUCED
    ratio = here.mean / paper if paper else 0.0
    size = f"{ratio:.2g} × the paper's" if 1e-3 < ratio < 1e3 else f"{here.mean:.2g} instead of {paper:g}"
    return f"{UNDECIDED}: {size}" if abs(z) <= FAR else f"{DEVIATION}: {size}; {why}"


def _with(verdict: str, why: str) -> str:
    return f"{verdict}: {why}"
