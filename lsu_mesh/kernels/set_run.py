"""Single steps, runs and banks of the filters whose sets grow and shrink: LSU-CZ and the zonotopic Kalman filter.

All of them are one compiled function: each further one would compile and load everything below it once more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Array, Matrix, Stack
from lsu_mesh.kernels.filter_point import MEAN
from lsu_mesh.kernels.points import density
from lsu_mesh.kernels.points.room import Room
from lsu_mesh.kernels.run_tables import (
    DONE,
    IN_OUTPUT,
    IN_PREDICT,
    IN_UPDATE,
    Estimates,
    Models,
    Record,
    follow,
)
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.splicing import entry, spliced
from lsu_mesh.kernels.zonotopes.constrained_step import DONE as STEP_DONE
from lsu_mesh.kernels.zonotopes.constrained_step import TROUBLED, change, image, meet_hull
from lsu_mesh.kernels.zonotopes.kalman_step import correct, move, zonotope_bounds, zonotope_image
from lsu_mesh.kernels.zonotopes.packed_set import pack, unpack
from lsu_mesh.kernels.zonotopes.time_update import Body, image_of_box

CONSTRAINED = 0
ZONOTOPE = 1

OUTPUT = 1
UPDATE = 2
PREDICT = 4
RECORD = 8
LAST_PREDICTION = 16
"""Bits of ``actions``: what is done at each row, and whether the last row is followed by a time update too."""


class Kind(NamedTuple):
    """The filter: ``CONSTRAINED`` with limits of generators and constraints, or ``ZONOTOPE`` with an order; −1: none.

    ``scaled`` and ``has_box`` are of the zonotopic Kalman filter.
    """

    family: int
    max_generators: int
    max_constraints: int
    scaled: bool
    has_box: bool


@entry
def sweep(
    actions: int, kind: Kind, states: Matrix, models: Models, Y: Stack, U: Stack, record: Record, kept: Stack,
    outcome: NDArray[np.int64], first: int, last: int, estimates: Estimates, room: Room,
) -> None:  # fmt: skip
    """Rows of the instances first … last − 1, whose states (N, line) go from the prior to the last one.

    Each row: predict the output, update with ``Y[i, k]``, record, and predict with ``U[i, k]``, each where ``actions``
    says so. ``outcome`` (N, 2) as in ``kernels/batch_run.py``, with ``IN_OUTPUT`` where the interval of the outputs
    cannot be told here. The states of the posteriors are written to ``kept`` (N, T, line), as far as it has rows. The
    densities go along; the points are the centres of the hulls. domains (M, 4, n): lower, upper, centre, half-widths.
    """
    rows = Y.shape[1]
    for i in range(first, last):
        j = i % models.A.shape[0]
        A, B, C, G = models.A[j], models.B[j], models.C[j], models.G[j]
        widths, r, domain = models.widths[j], models.r[j], models.domains[j]
        mean, P = estimates.means[i], estimates.covariances[i]
        body, lower, upper, is_hull = unpack(states[i], C.shape[1])
        outcome[i, 0], outcome[i, 1] = rows, DONE
        for turn in range(3 * rows):
            k, action = turn // 3, 1 << (turn % 3)
            if actions & action == 0 or (action == PREDICT and k + 1 == rows and actions & LAST_PREDICTION == 0):
                continue
            status, new_body, new_lower, new_upper, new_is_hull = STEP_DONE, body, lower, upper, is_hull
            if action != OUTPUT:
                status, new_body, new_lower, new_upper, new_is_hull = _step(
                    kind, action == PREDICT, body, lower, upper, is_hull, C, Y[i, k], r,
                    A, B, U[i, k], G, widths, domain,
                )  # fmt: skip
            asks = action == OUTPUT or (action == UPDATE and actions & RECORD != 0)
            low, high = new_lower.copy(), new_upper.copy()
            if asks and status == STEP_DONE:
                status = _bounds(kind, new_body, new_is_hull, low, high)
            if action == OUTPUT and status == STEP_DONE:
                status = _store_output(kind, body, low, high, C, r, record, i, k)
            if action != OUTPUT and status == STEP_DONE and estimates.rule == MEAN:
                kept_mean, kept_P = mean.copy(), P.copy()
                follow(action == UPDATE, mean, P, A, B, C, Y[i, k], r, U[i, k], models.Q[j], G, widths, room)
                if not density.is_finite(mean, P):
                    status = TROUBLED
                    mean[:], P[:] = kept_mean, kept_P
            if status != STEP_DONE:
                outcome[i, 0] = k + 1 if action == PREDICT else k
                outcome[i, 1] = IN_PREDICT if action == PREDICT else IN_UPDATE if action == UPDATE else IN_OUTPUT
                break
            body, lower, upper, is_hull = new_body, new_lower, new_upper, new_is_hull
            if asks:
                for s in range(low.size):
                    record.lower[i, k, s], record.upper[i, k, s] = low[s], high[s]
            if action == UPDATE and asks:
                _centre(kind, body, low, high, record.points[i, k])
                if k < kept.shape[1]:
                    pack(body, lower, upper, is_hull, kept[i, k])
        if not pack(body, lower, upper, is_hull, states[i]):
            outcome[i, 0], outcome[i, 1] = -1, IN_UPDATE


@spliced
def _step(
    kind: Kind, predicts: bool, body: Body, lower: Array, upper: Array, is_hull: bool, P: Array, y: Array, r: Array,
    A: Array, B: Array, u: Array, N: Array, widths: Array, domain: Array,
) -> tuple[int, Body, Array, Array, bool]:  # fmt: skip
    """Data update or time update of either family."""
    if kind.family == CONSTRAINED:
        return change(
            predicts, body, lower, upper, is_hull, P, y, r, A, B, u, N, widths, domain,
            kind.max_generators, kind.max_constraints,
        )  # fmt: skip
    known = predicts
    for i in range(y.size):
        known = known or not np.isnan(y[i])
    if not known:
        return STEP_DONE, body, lower, upper, is_hull
    c, H, _, _ = body
    if predicts:
        status, c, H, lower, upper = move(
            c, H, lower, upper, A, B, u, N, widths, domain, kind.max_generators, kind.scaled, kind.has_box
        )
    else:
        status, c, H, lower, upper = correct(c, H, lower, upper, P, y, r, kind.has_box)
    return status, (c, H, np.zeros((0, H.shape[1])), np.zeros(0)), lower, upper, False


@spliced
def _bounds(kind: Kind, body: Body, is_hull: bool, lower: Array, upper: Array) -> int:
    """Meet the box, in place, with the hull of the set."""
    if kind.family == CONSTRAINED:
        return STEP_DONE if is_hull else meet_hull(body, lower, upper)
    least, most = zonotope_bounds(body[0], body[1], lower, upper)
    lower[:], upper[:] = least, most
    return STEP_DONE


@spliced
def _store_output(
    kind: Kind, body: Body, lower: Array, upper: Array, C: Array, r: Array, record: Record, i: int, k: int
) -> int:  # fmt: skip
    """The interval of ``C x + v``, and ``C x`` of the centre x."""
    m = C.shape[0]
    low, high = record.y_lower[i, k], record.y_upper[i, k]
    if kind.family == CONSTRAINED:
        status = image(body, C, low, high)
        if status != STEP_DONE:
            return status
    else:
        zonotope_image(body[0], body[1], C, low, high)
    box_low, box_high = image_of_box(C, lower, upper)
    point = np.empty(lower.size)
    _centre(kind, body, lower, upper, point)
    for t in range(m):
        low[t], high[t] = max(low[t], box_low[t]), min(high[t], box_high[t])
        if r[t] > 0.0:
            low[t], high[t] = np.nextafter(low[t] - r[t], -np.inf), np.nextafter(high[t] + r[t], np.inf)
        total = 0.0
        for s in range(point.size):
            total += C[t, s] * point[s]
        record.y_points[i, k, t] = total
    return STEP_DONE


@inner
def _centre(kind: Kind, body: Body, lower: Array, upper: Array, point: Array) -> None:
    """The point of the rule ``CENTRE``."""
    for s in range(point.size):
        if kind.family == CONSTRAINED:
            point[s] = 0.5 * lower[s] + 0.5 * upper[s]
        else:
            point[s] = min(max(body[0][s], lower[s]), upper[s])
