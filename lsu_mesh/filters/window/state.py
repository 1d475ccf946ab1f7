"""What a window estimator knows between two steps."""

from __future__ import annotations

from typing import NamedTuple

from lsu_mesh.array_types import Counts, Matrix, Vector
from lsu_mesh.filters.window.program import WindowData, WindowSolution


class Window(NamedTuple):
    """What the filter knows; no array is ever written again.

    ``data``: states and outputs in the window, and the latest estimates; rho, r: estimated half-widths (q,), (m,);
    smallest, largest (N, n), counts (N,): range and number of each state's estimates; reach (n,): half-widths of the
    published interval.
    """

    data: WindowData
    rho: Vector
    r: Vector
    smallest: Matrix
    largest: Matrix
    counts: Counts
    reach: Vector
    solution: WindowSolution | None
