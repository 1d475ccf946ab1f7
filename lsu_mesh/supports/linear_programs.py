"""Linear programs over ``{ξ : A ξ = b, |ξ|∞ ≤ 1}`` with proved answers.

The compiled simplex solves them, HiGHS those where it is troubled. Neither is believed, see
:mod:`lsu_mesh.kernels.linear_programs.dual_bound`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.linear_programs.dual_bound import absolute_row_sums, dual_bound
from lsu_mesh.kernels.linear_programs.safe_maxima import EMPTY, LOOSE, Program, maxima, open_program
from lsu_mesh.supports.arrays import are_finite


class Maxima(NamedTuple):
    """Upper bounds ``values`` (k,), points (k, g) that attain them to rounding, and whether the set is proved empty."""

    values: Vector
    points: Matrix
    empty: bool


def safe_maxima(objectives: Matrix, A: Matrix, b: Vector) -> Maxima:
    """``max {d'ξ : A ξ = b, |ξ|∞ ≤ 1}`` for each row d of ``objectives`` (k, g), never below the exact value."""
    return program_maxima(*open_program(A, b), objectives, A, b)


def program_maxima(status: int, program: Program, objectives: Matrix, A: Matrix, b: Vector) -> Maxima:
    """:func:`safe_maxima` with the program of (A, b) opened already, with this status; leaves it at the last vertex."""
    if status == EMPTY:
        return Maxima(np.full(objectives.shape[0], -np.inf), np.zeros(objectives.shape), True)
    solved, values, points = maxima(program, objectives)
    if LOOSE in (status, solved):
        if _highs_proves_empty(A, b):
            return Maxima(values, points, True)
        sums = absolute_row_sums(A, np.ones(A.shape[1]))
        for i, d in enumerate(objectives):
            multipliers, point = _highs(d, A, b)
            bound = dual_bound(np.array(d), A, b, sums, multipliers)
            if bound < values[i]:
                values[i], points[i] = bound, point
    return Maxima(values, points, False)


def is_proved_empty(A: Matrix, b: Vector) -> bool:
    """Whether ``{ξ : A ξ = b, |ξ|∞ ≤ 1}`` is empty, ``True`` only with a verified Farkas ray."""
    if A.shape[0] == 0:
        return False
    status, _ = open_program(A, b)
    return bool(status == EMPTY) or (status == LOOSE and _highs_proves_empty(A, b))


def _highs(d: Vector, A: Matrix, b: Vector) -> tuple[Vector, Vector]:
    """Multipliers (m,) and a point (g,) by HiGHS; zeros where it fails, with which the bound is that of the box."""
    from scipy.optimize import linprog

    answer = linprog(-d, A_eq=A, b_eq=b, bounds=(-1, 1), method="highs") if are_finite(d, A, b) else None
    if answer is None or answer.status != 0:
        return np.zeros(A.shape[0]), np.zeros(A.shape[1])
    return np.array(-answer.eqlin.marginals), np.array(answer.x)


def _highs_proves_empty(A: Matrix, b: Vector) -> bool:
    """A Farkas ray from the multipliers of ``min Σ|A ξ − b|`` over scaled rows."""
    from scipy.optimize import linprog

    if not are_finite(A, b):
        return False  # numbers that have outgrown double precision prove nothing
    m, g = A.shape
    scale = np.abs(A).max(axis=1, initial=0.0)
    scale = np.where(scale > 0, scale, 1.0)
    rows = np.hstack([A / scale[:, None], np.eye(m), -np.eye(m)])
    cost = np.concatenate([np.zeros(g), np.ones(2 * m)])
    limits = [(-1.0, 1.0)] * g + [(0.0, None)] * (2 * m)
    answer = linprog(cost, A_eq=rows, b_eq=b / scale, bounds=limits, method="highs")
    if answer.status != 0:
        return False
    ray = np.array(-answer.eqlin.marginals / scale)
    return bool(dual_bound(np.zeros(g), A, b, absolute_row_sums(A, np.ones(A.shape[1])), ray) < 0.0)
