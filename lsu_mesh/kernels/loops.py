"""Whole runs of whole banks of independent filters, over the step of ``kernels/step.py``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.compile import inner, kernel
from lsu_mesh.kernels.scratch import Scratch
from lsu_mesh.kernels.step import MEET_BOX, PREDICT, UPDATE, advance, copy, describe, predict_output

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]
Stack = NDArray[np.float64]

DONE = 0
IN_UPDATE = 1
IN_PREDICT = 2


class Models(NamedTuple):
    """Models of a bank: A (M, n, n), B (M, n, p), C (M, m, n), G (M, n, q), widths (M, q), r (M, m), domains (M, 2, n).

    M = N, or M = 1 for all instances alike; domains (M, 0, n) where there is none.
    """

    A: Stack
    B: Stack
    C: Stack
    G: Stack
    widths: Matrix
    r: Matrix
    domains: Stack


class Record(NamedTuple):
    """What a run stores: points, lower, upper (N, T, n), volumes (N, T), y_lower, y_upper, y_points (N, T, m)."""

    points: Stack
    lower: Stack
    upper: Stack
    volumes: Matrix
    y_lower: Stack
    y_upper: Stack
    y_points: Stack


@kernel
def sweep(
    family: int, option: int, updating: bool, last_prediction: bool, states: Stack, spare: Matrix, models: Models,
    Y: Stack, U: Stack, record: Record, outcome: NDArray[np.int64], first: int, last: int, work: Scratch,
) -> None:  # fmt: skip
    """Rows 1 … T of the instances first … last − 1, whose states (N, rows, n) go from the prior to the last one.

    Each row: predict the output, update with ``Y[i, k]``, record (all three only where ``updating``); then, but after the
    last row only with ``last_prediction``, predict with ``U[i, k]``. ``outcome`` (N, 2): the rows that are done, and
    ``DONE`` or where it stopped: ``IN_UPDATE`` (the state is the prediction of that row) or ``IN_PREDICT`` (the state is the
    posterior of the row before). Y (N, T, m), U (N, T, p); spare (rows, n) and work are scratch.
    """
    rows = Y.shape[1]
    for i in range(first, last):
        j = i % models.A.shape[0]
        C, r, S = models.C[j], models.r[j], states[i]
        outcome[i, 0], outcome[i, 1] = rows, DONE
        for k in range(rows):
            if updating:
                predict_output(family, S, C, r, record.y_lower[i, k], record.y_upper[i, k], record.y_points[i, k], work)
                if not _step(UPDATE, family, option, S, spare, models, j, Y[i, k], U[i, k], work):
                    outcome[i, 0], outcome[i, 1] = k, IN_UPDATE
                    break
                record.volumes[i, k] = describe(
                    family, S, record.points[i, k], record.lower[i, k], record.upper[i, k], work
                )
            if (k + 1 < rows or last_prediction) and not _step(
                PREDICT, family, option, S, spare, models, j, Y[i, k], U[i, k], work
            ):
                outcome[i, 0], outcome[i, 1] = k + 1, IN_PREDICT
                break


@inner
def _step(
    action: int, family: int, option: int, S: Matrix, spare: Matrix, models: Models, j: int,
    y: Vector, u: Vector, work: Scratch,
) -> bool:  # fmt: skip
    """One action in place; a prediction is met with the domain. ``False``, S kept, where the status is not 0."""
    A, B, C, G, widths, r = models.A[j], models.B[j], models.C[j], models.G[j], models.widths[j], models.r[j]
    if advance(action, family, option, S, C, y, r, A, B, u, G, widths, spare, work) != 0:
        return False
    if action != PREDICT or models.domains.shape[1] == 0:
        copy(spare, S)
        return True
    met = work.state[0 : S.shape[0]]
    lower, upper = models.domains[j, 0], models.domains[j, 1]
    if advance(MEET_BOX, family, option, spare, C, lower, upper, A, B, u, G, widths, met, work) != 0:
        return False
    copy(met, S)
    return True
