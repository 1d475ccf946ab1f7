"""Interval estimates from several point estimates of the same state.

``μ ± κ n/(n − 2) σ``, where μ is the centre and σ the half-width of the range of n + 1 estimates, n > 2: the
expectation of a uniform likelihood's centre and half-width. Source: Pavelková & Kárný 2014, eqs (28)–(31).
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Counts, Matrix


def interval_estimate(smallest: Matrix, largest: Matrix, counts: Counts, kappa: float) -> tuple[Matrix, Matrix]:
    """Bounds (N, n) from the range of each state's estimates; infinite where there are not more than three.

    smallest, largest (N, n); counts (N,): how many estimates (n + 1 in the paper).
    """
    n = counts.astype(np.float64)[:, None] - 1.0
    enough = n > 2.0
    factor = np.where(enough, n / np.where(enough, n - 2.0, 1.0), np.inf)
    middle, half = 0.5 * (smallest + largest), 0.5 * (largest - smallest)
    reach = np.where(enough, kappa * np.where(enough, factor, 0.0) * half, np.inf)
    return middle - reach, middle + reach
