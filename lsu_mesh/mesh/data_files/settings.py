"""Where recorded values lie, and how they are written down."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

MISSING_WORDS = ("", "nan", "na", "n/a", "null", "none", "-")
"""Cells that mean "missing", in any case of letters."""
MAX_BYTES = 512 * 2**20
"""Larger files are refused: the whole of a file is held in memory, several times."""
TIME_UNITS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""Nanoseconds of each unit that a time column may count in."""


@dataclass(frozen=True)
class DataFileSettings:
    """A file of recorded values: its value columns, and the column that orders the rows.

    Nothing of the file is read to make one.
    """

    path: Path
    columns: tuple[str, ...]
    """Value columns in the order of the outputs; empty: all but the index column."""
    index: str
    """The column that orders the rows."""
    indexed_by: str
    """``"time"`` (numbers or ISO 8601) or ``"step"``."""
    delimiter: str | None = None
    """One character; None: found."""
    decimal: str = "."
    """``"."`` or ``","``."""
    comment: str = "#"
    """Lines that begin so are no rows; empty: there are none."""
    missing: tuple[str, ...] = MISSING_WORDS
    """Words for a missing value, in any case of letters; an empty cell is always one."""
    time_unit: str | None = None
    """A key of :data:`TIME_UNITS`; None: found by the size of the numbers."""
    max_bytes: int = MAX_BYTES

    @property
    def wanted(self) -> tuple[str, ...]:
        """The columns that the header must hold."""
        return tuple(dict.fromkeys((self.index, *self.columns)))
