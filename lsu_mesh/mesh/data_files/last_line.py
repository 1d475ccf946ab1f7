"""A last line that has every cell, and yet looks cut off within its last number."""

from __future__ import annotations

import re

import numpy as np

from lsu_mesh.array_types import CellTexts
from lsu_mesh.mesh.data_files.cells import Cells
from lsu_mesh.mesh.data_files.layout import Layout
from lsu_mesh.mesh.data_files.problems import FileProblems, cell_place, shown

LIKE_BEFORE = 8
"""So many rows must agree in their decimals before one with fewer is odd."""
_UNFINISHED = re.compile(rb"[+-]|[+-]?\d+\.|[+-]?(\d+\.?\d*|\.\d+)[eE][+-]?")


def check_last_line(cells: Cells, layout: Layout, decimal: str, problems: FileProblems) -> None:
    """Without a line end, the last number may lack digits. It is refused where it ends in the middle, or is empty or
    shorter in decimals than every row before."""
    column = cells.columns.get(layout.names[-1])
    if not cells.ends_open or column is None or not len(column) or not layout.names[-1]:
        return
    last = bytes(column[-1]).replace(decimal.encode(), b".")
    others = column[:-1]
    if _UNFINISHED.fullmatch(last):
        reason = "ends in the middle of a number"
    elif len(others) >= LIKE_BEFORE and _has_fewer_decimals(last, others, decimal.encode()):
        reason = "is shorter than those of all rows before"
    else:
        return
    text = (
        f"the last line has no line end, and its last cell {shown(column[-1])} {reason}, so it may be cut off; "
        "copy the file again, or end the line if it is whole"
    )
    problems.add("cut", cell_place(int(cells.lines[-1]), layout.names[-1]), text)


def _has_fewer_decimals(last: bytes, others: CellTexts, decimal: bytes) -> bool:
    """Whether all other cells have one number of decimals, and the last fewer (an empty cell has none)."""
    lengths = np.strings.str_len(others)
    decimals = lengths - 1 - np.strings.find(others, decimal)
    decimals = np.where(np.strings.find(others, decimal) < 0, 0, decimals)
    if lengths.min() == 0 or decimals.min() != decimals.max() or decimals[0] == 0:
        return bool(not last and lengths.min() > 0)
    return (len(last) - 1 - last.find(b".") if b"." in last else 0) < int(decimals[0])
