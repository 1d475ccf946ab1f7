"""A file of data as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lsu_mesh.array_types import Integers, Vector


@dataclass(frozen=True)
class DataFile:
    """The rows of a file in the order of their times or steps; rows of one moment in the order of the file.

    Exactly one of ``time_ns`` and ``steps`` is given.
    """

    path: Path
    columns: Mapping[str, Vector]
    """(T,) each; NaN = missing."""
    lines: Integers
    """(T,): the line of the text, or the row of an array from 1, that a row comes from."""
    time_ns: Integers | None
    """(T,): the time as it is written, rounded to nanoseconds."""
    time_half_ns: Integers
    """(T,): half the spacing of floating-point times; 0 for decimal text, whole numbers and step columns."""
    digit_ns: int
    """A unit of the last digit of the times, at least 1; the most digits of the file count."""
    steps: Integers | None
    """(T,)."""
    out_of_order: int
    """Rows that came after a row of a later time or step."""
    blank: int
    """Rows of nothing but delimiters, which are left out."""
    notes: tuple[str, ...]
    """What was found rather than said: delimiter, unit of time, lines skipped."""

    @property
    def row_count(self) -> int:
        """T, blank rows left out."""
        return len(self.lines)

    @property
    def values(self) -> Vector:
        """(T, m), the columns side by side."""
        return np.column_stack(list(self.columns.values())) if self.columns else np.empty((self.row_count, 0))
