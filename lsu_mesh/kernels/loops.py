"""Whole runs, and banks of independent filters, over the steps of ``kernels/step.py``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.compile import kernel
from lsu_mesh.kernels.scratch import Scratch
from lsu_mesh.kernels.step import describe, meet_box, predict, predict_output, update

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]
Stack = NDArray[np.float64]

DONE = 0
IN_UPDATE = 1
IN_PREDICT = 2


class Record(NamedTuple):
    """What a run stores of each step: points, lower, upper (T, n), volumes (T,), y_lower, y_upper, y_points (T, m)."""

    points: Matrix
    lower: Matrix
    upper: Matrix
    volumes: Vector
    y_lower: Matrix
    y_upper: Matrix
    y_points: Matrix


@kernel
def run(
    family: int, option: int, S: Matrix, spare: Matrix,
    A: Matrix, B: Matrix, C: Matrix, G: Matrix, widths: Vector, r: Vector,
    domain: Matrix, Y: Matrix, U: Matrix, record: Record, work: Scratch,
) -> tuple[int, int]:  # fmt: skip
    """Steps 1 … T: predict the output, update with ``Y[k]``, record, predict with ``U[k]`` (not after the last row).

    S holds the prior at first and at last the state of the step at which the run ended. ``domain`` is (2, n), or (0, n) for
    none. Returns the rows that are done and ``DONE``, or where it stopped: ``IN_UPDATE`` (S is the prediction of that row) or
    ``IN_PREDICT`` (S is its posterior).
    """
    for k in range(Y.shape[0]):
        predict_output(family, S, C, r, record.y_lower[k], record.y_upper[k], record.y_points[k], work)
        if update(family, option, S, C, Y[k], r, spare, work) != 0:
            return k, IN_UPDATE
        _copy(spare, S)
        record.volumes[k] = describe(family, S, record.points[k], record.lower[k], record.upper[k], work)
        if k + 1 < Y.shape[0] and not _advance(family, option, S, spare, A, B, G, widths, domain, U[k], work):
            return k + 1, IN_PREDICT
    return Y.shape[0], DONE


@kernel
def _advance(
    family: int, option: int, S: Matrix, spare: Matrix,
    A: Matrix, B: Matrix, G: Matrix, widths: Vector, domain: Matrix, u: Vector, work: Scratch,
) -> bool:  # fmt: skip
    """Time update and meet with the domain; S is kept where it fails."""
    if predict(family, option, S, A, B, u, G, widths, spare, work) != 0:
        return False
    if domain.shape[0] == 0:
        _copy(spare, S)
        return True
    met = work.state[0 : S.shape[0]]
    if meet_box(family, spare, domain[0], domain[1], met, work) != 0:
        return False
    _copy(met, S)
    return True


@kernel
def _copy(source: Matrix, target: Matrix) -> None:
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@kernel
def bank_update(
    family: int, option: int, stack: Stack, C: Stack, Y: Matrix, R: Matrix, status: NDArray[np.int64],
    first: int, last: int, spare: Matrix, work: Scratch,
) -> None:  # fmt: skip
    """Data update of the instances first … last − 1 in place; an instance whose status is not 0 keeps its state.

    stack (N, rows, n), Y (N, m); C (M, m, n) and R (M, m) with M = N, or M = 1 for all alike.
    """
    for i in range(first, last):
        status[i] = update(family, option, stack[i], C[i % C.shape[0]], Y[i], R[i % R.shape[0]], spare, work)
        if status[i] == 0:
            _copy(spare, stack[i])


@kernel
def bank_predict(
    family: int, option: int, stack: Stack, A: Stack, B: Stack, G: Stack, widths: Matrix, domains: Stack, U: Matrix,
    status: NDArray[np.int64], first: int, last: int, spare: Matrix, work: Scratch,
) -> None:  # fmt: skip
    """Time update of the instances first … last − 1 in place, met with their domains; as :func:`bank_update`.

    A (M, n, n), B (M, n, p), G (M, n, q), widths (M, q), domains (M, 2 or 0, n), U (N, p).
    """
    for i in range(first, last):
        j = i % A.shape[0]
        done = _advance(
            family, option, stack[i], spare, A[j], B[j], G[j], widths[i % widths.shape[0]], domains[j], U[i], work
        )
        status[i] = 0 if done else 1


@kernel
def bank_run(
    family: int, option: int, stack: Stack, A: Stack, B: Stack, C: Stack, G: Stack, widths: Matrix, R: Matrix,
    domains: Stack, Y: Stack, U: Stack, points: Stack, lower: Stack, upper: Stack, volumes: Matrix,
    y_lower: Stack, y_upper: Stack, y_points: Stack, done: NDArray[np.int64], first: int, last: int,
    spare: Matrix, work: Scratch,
) -> None:  # fmt: skip
    """:func:`run` of the instances first … last − 1; Y (N, T, m), U (N, T, p), the records likewise; ``done`` counts rows."""
    for i in range(first, last):
        j = i % A.shape[0]
        record = Record(points[i], lower[i], upper[i], volumes[i], y_lower[i], y_upper[i], y_points[i])
        done[i], _ = run(
            family, option, stack[i], spare, A[j], B[j], C[j], G[j], widths[j], R[j], domains[j],
            Y[i], U[i], record, work,
        )  # fmt: skip
