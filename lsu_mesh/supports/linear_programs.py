"""Linear programs over ``{ξ : A ξ = b, |ξ|∞ ≤ 1}`` with answers that are proved: see :mod:`lsu_mesh.kernels.dual`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.dual import absolute_row_sums, dual_bound

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Maxima(NamedTuple):
    """Upper bounds ``values`` (k,) of the k objectives; ``empty`` where the feasible set is proved to be empty."""

    values: Vector
    empty: bool


def safe_maxima(objectives: Matrix, A: Matrix, b: Vector) -> Maxima:
    """``max {d'ξ : A ξ = b, |ξ|∞ ≤ 1}`` for each row d of ``objectives`` (k, g), never below the exact value."""
    sums = absolute_row_sums(A)
    values = np.empty(objectives.shape[0])
    for i, d in enumerate(objectives):
        multipliers = _highs_multipliers(d, A, b)
        values[i] = dual_bound(d, A, b, sums, multipliers)
    return Maxima(values, is_proved_empty(A, b))


def is_proved_empty(A: Matrix, b: Vector) -> bool:
    """Whether ``{ξ : A ξ = b, |ξ|∞ ≤ 1}`` is empty, ``True`` only with a verified Farkas ray."""
    if A.shape[0] == 0:
        return False
    ray = _highs_farkas_ray(A, b)
    return dual_bound(np.zeros(A.shape[1]), A, b, absolute_row_sums(A), ray) < 0.0


def _highs_multipliers(d: Vector, A: Matrix, b: Vector) -> Vector:
    from scipy.optimize import linprog

    if A.shape[0] == 0 or A.shape[1] == 0:
        return np.zeros(A.shape[0])
    answer = linprog(-d, A_eq=A, b_eq=b, bounds=(-1, 1), method="highs")
    if answer.status != 0:
        return np.zeros(A.shape[0])
    return np.ascontiguousarray(-answer.eqlin.marginals)


def _highs_farkas_ray(A: Matrix, b: Vector) -> Vector:
    """Multipliers of ``min Σ|A ξ − b|``: where the minimum is positive their negative is a Farkas ray."""
    from scipy.optimize import linprog

    m, g = A.shape
    scale = np.abs(A).max(axis=1, initial=0.0)
    scale = np.where(scale > 0, scale, np.maximum(np.abs(b), 1e-300))
    rows = np.hstack([A / scale[:, None], np.eye(m), -np.eye(m)])
    cost = np.concatenate([np.zeros(g), np.ones(2 * m)])
    limits = [(-1.0, 1.0)] * g + [(0.0, None)] * (2 * m)
    answer = linprog(cost, A_eq=rows, b_eq=b / scale, bounds=limits, method="highs")
    if answer.status != 0:
        return np.zeros(m)
    return np.ascontiguousarray(-answer.eqlin.marginals / scale)


def maximisers(objectives: Matrix, A: Matrix, b: Vector) -> Matrix:
    """Feasible points ξ (k, g), to floating-point accuracy, at which the objectives (k, g) are largest."""
    from scipy.optimize import linprog

    points = np.empty_like(objectives)
    for i, d in enumerate(objectives):
        if A.shape[0] == 0:
            points[i] = np.where(d >= 0.0, 1.0, -1.0)
            continue
        answer = linprog(-d, A_eq=A, b_eq=b, bounds=(-1, 1), method="highs")
        points[i] = 0.0 if answer.x is None else answer.x
    return points
