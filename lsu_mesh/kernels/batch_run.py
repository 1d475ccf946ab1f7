"""Whole runs of whole banks of independent filters, over the step of ``kernels/filter_step.py``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Stack
from lsu_mesh.kernels.filter_point import CENTRE, MEAN, locate, locate_output
from lsu_mesh.kernels.filter_step import MEET_BOX, PREDICT, UPDATE, advance, copy, describe, predict_output
from lsu_mesh.kernels.points import density
from lsu_mesh.kernels.points.room import LOWER, TARGET, Room, row_of
from lsu_mesh.kernels.run_tables import (
    DONE,
    IN_PREDICT,
    IN_UPDATE,
    Estimates,
    Models,
    Record,
    borrowed_models,
    borrowed_record,
    follow,
)
from lsu_mesh.kernels.runtime.compile import kernel
from lsu_mesh.kernels.runtime.scratch import Scratch, spare_state
from lsu_mesh.kernels.runtime.unowned_views import borrowed


@kernel
def sweep(
    family: int, option: int, updating: bool, last_prediction: bool, states: Stack, spare: Matrix, models: Models,
    Y: Stack, U: Stack, record: Record, outcome: NDArray[np.int64], first: int, last: int, work: Scratch,
    estimates: Estimates, points: bool, room: Room,
) -> None:  # fmt: skip
    """Rows 1 … T of the instances first … last − 1, whose states (N, rows, n) go from the prior to the last one.

    Each row: predict the output, update with ``Y[i, k]``, record (all three only where ``updating``); then, but after
    the last row only with ``last_prediction``, predict with ``U[i, k]``. ``outcome`` (N, 2): the rows that are done,
    and ``DONE`` or where it stopped: ``IN_UPDATE`` (the state is the prediction of that row) or ``IN_PREDICT`` (the
    state is the posterior of the row before). Y (N, T, m), U (N, T, p); spare (rows, n), work and room are scratch.
    The densities go along with the states; points are recorded only where ``points``.
    """
    rows = Y.shape[1]
    models, record, work = borrowed_models(models), borrowed_record(record), borrowed(work)
    states, spare, Y, U = borrowed(states), borrowed(spare), borrowed(Y), borrowed(U)
    means, covariances, room = borrowed(estimates.means), borrowed(estimates.covariances), borrowed(room)
    bounded, rule = models.domains.shape[1] > 0, estimates.rule
    last_action = MEET_BOX if bounded else PREDICT
    for i in range(first, last):
        j = i % models.A.shape[0]
        A, B, C, G = models.A[j], models.B[j], models.C[j], models.G[j]
        widths, r, S, mean, P = models.widths[j], models.r[j], states[i], means[i], covariances[i]
        met = spare_state(work, S.shape[1], S.shape[0])
        outcome[i, 0], outcome[i, 1] = rows, DONE
        # three actions a row through one call of advance: each further call would double the time of compiling
        for turn in range(3 * rows):
            k, action = turn // 3, turn % 3
            after_last = k + 1 == rows and not last_prediction
            if (action == UPDATE and not updating) or (action != UPDATE and after_last):
                continue
            source, target, low, high = S, spare, Y[i, k], r
            if action == UPDATE:
                predict_output(family, S, C, r, record.y_lower[i, k], record.y_upper[i, k], record.y_points[i, k], work)
                if points and rule != CENTRE:
                    locate_output(
                        family, rule, S, mean, P, C, record.points[i, k], record.y_points[i, k], work, room
                    )  # fmt: skip
            elif action == MEET_BOX:
                if not bounded:
                    continue
                source, target, low, high = spare, met, models.domains[j, 0], models.domains[j, 1]
            status = advance(action, family, option, source, C, low, high, A, B, U[i, k], G, widths, target, work)
            if status != 0:
                outcome[i, 0] = k if action == UPDATE else k + 1
                outcome[i, 1] = IN_UPDATE if action == UPDATE else IN_PREDICT
                break
            if action != PREDICT or not bounded:
                copy(target, S)
            if rule == MEAN and action in (UPDATE, last_action):
                follow(action == UPDATE, mean, P, A, B, C, Y[i, k], r, U[i, k], models.Q[j], G, widths, room)
                if not density.is_finite(mean, P):
                    hull = row_of(room, S.shape[1], LOWER), row_of(room, S.shape[1], LOWER + 1)
                    describe(family, S, row_of(room, S.shape[1], TARGET), hull[0], hull[1], work)
                    density.start(hull[0], hull[1], mean, P)
            if action == UPDATE:
                lower, upper, point = record.lower[i, k], record.upper[i, k], record.points[i, k]
                record.volumes[i, k] = describe(family, S, point, lower, upper, work)
                if points and rule != CENTRE:
                    locate(family, rule, S, mean, P, lower, upper, point, room)
