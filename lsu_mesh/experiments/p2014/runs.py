"""The system of Pavelková & Kárný 2014, the estimators on it, and what its tables say of each run (eqs (32)–(36))."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Array, Flags
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.kalman import Kalman
from lsu_mesh.filters.truncated_kalman import TruncatedKalman
from lsu_mesh.filters.window.program import Selected
from lsu_mesh.filters.window.window_map import WindowMAP
from lsu_mesh.model import LSUModel

Shares = Array | Flags
A = ((1.0, -0.5, 0.2), (0.5, 0.1, 0.0), (0.3, 0.0, -0.1))
B = ((0.1,), (0.6,), (0.3,))
C = ((1.0, 0.0, 0.5), (0.0, 1.0, 0.5))
E = ((1.0, 0.5, 0.25), (0.0, 1.0, 0.3), (0.0, 0.0, 1.0))
F = ((1.0, 0.4), (0.0, 1.0))
RHO, R = 0.1, 0.3
LOWER, UPPER = (-0.8, -0.61, -0.4), (0.76, 0.66, 0.44)
UNKNOWN = tuple((matrix, i, j, -1.0, 1.0) for matrix, i, j in (("E", 1, 2), ("E", 1, 3), ("E", 2, 3), ("F", 1, 2)))
KAPPAS = (1.0, 1.5, 2.0)
KALMAN_SKIPS = 25
"""Steps of the Kalman filters that do not count, as those of the longer window of Tables II and III."""

SETTLED = 100
"""Steps after which the covariance of a Kalman filter without truncation no longer changes."""


class Case(NamedTuple):
    """Whether the noise is correlated (by E and F) in the simulation, and whether the estimator has to find E and F."""

    correlated: bool
    estimated: bool


CORRELATED = Case(correlated=True, estimated=True)
"""Table I."""
UNCORRELATED = Case(correlated=False, estimated=True)
"""Tables II and III: E = F = I in the simulation, which the window estimator does not know."""
KNOWN = Case(correlated=False, estimated=False)


class Job(NamedTuple):
    """One estimator on one record: a window Δ, or 0 for a truncated Kalman filter, its variances × factor."""

    name: str
    case: Case
    window: int
    point: Selected
    factor: float
    seed: int
    steps: int


class Result(NamedTuple):
    """What the tables say of one run.

    ``states`` (3,), ``fits`` (2,), ``predictions`` (2,): mean absolute errors of states, of outputs that the estimate
    has seen, and of outputs before it has. ``volume``: V, or V_KF. ``outside`` (3,): N, or N_KF with κ³ as printed, in
    %, for κ = 1, 1.5, 2. ``other`` (3,): the share of single coordinates outside, or N_KF with κ². ``untruncated``
    (3,): as ``outside`` with the P before its truncation; NaN for a window. ``ellipsoid``: the volume that P gives,
    4/3 π √|P|. ``seconds``: of a step.
    """

    states: Array
    fits: Array
    predictions: Array
    volume: float
    outside: Array
    other: Array
    untruncated: Array
    ellipsoid: float
    seconds: float


def simulate(correlated: bool, seed: int, steps: int) -> tuple[Array, Array, Array]:
    """States x_0 … x_T (T + 1, 3), outputs (T + 1, 2) without y_0, inputs (T, 1); states are clipped at the box."""
    random = np.random.default_rng(seed)
    X, Y, U = np.zeros((steps + 1, 3)), np.full((steps + 1, 2), np.nan), random.uniform(-1.0, 1.0, (steps, 1))
    left = np.linalg.inv(E if correlated else np.eye(3))
    output = np.linalg.inv(F if correlated else np.eye(2))
    for t in range(1, steps + 1):
        x = left @ (np.array(A) @ X[t - 1] + np.array(B) @ U[t - 1] + random.uniform(-RHO, RHO, 3))
        X[t] = np.clip(x, LOWER, UPPER)
        Y[t] = output @ (np.array(C) @ X[t] + random.uniform(-R, R, 2))
    return X, Y, U


def estimator(job: Job) -> Filter:
    """The window estimator, or the truncated Kalman filter, of a job."""
    size, box = np.sqrt(job.factor), (LOWER, UPPER)
    model = LSUModel(A=A, B=B, C=C, rho=size * RHO, r=size * R, domain=box)
    if not job.window:
        return TruncatedKalman(model, box)
    unknown = UNKNOWN if job.case.estimated else ()
    return WindowMAP(model, box, window=job.window, unknown=unknown, point=job.point, handover=1.0)


def result(job: Job) -> Result:
    """Run one estimator; the first Δ + 1 steps do not count."""
    X, Y, U = simulate(job.case.correlated, job.seed, job.steps)
    filter = estimator(job)
    first = (job.window or KALMAN_SKIPS) + 1
    errors: list[tuple[Array, Array, Array]] = []
    sizes: list[tuple[float, Shares, Shares, Shares]] = []
    seconds = 0.0
    for t in range(job.steps + 1):
        predicted = filter.predict_output().point
        began = time.process_time()
        filter.update(Y[t])
        seconds += time.process_time() - began
        if t >= first:
            fitted = filter.predict_output().point
            errors.append((np.abs(X[t] - filter.point), np.abs(Y[t] - fitted), np.abs(Y[t] - predicted)))
            sizes.append(_size(filter, X, t, job.window))
        began = time.process_time()
        if t < job.steps:
            filter.predict(U[t])
        seconds += time.process_time() - began
    states, fits, predictions = (np.mean(column, axis=0) for column in zip(*errors, strict=True))
    volumes, *who = zip(*sizes, strict=True)
    outside, other, untruncated = (100.0 * np.mean(column, axis=0) for column in who)
    ellipsoid = np.nan if job.window else 4.0 / 3.0 * np.pi * float(np.mean(np.sqrt(volumes)))
    return Result(
        states=states,
        fits=fits,
        predictions=predictions,
        volume=float(np.mean(volumes)),
        outside=outside,
        other=other,
        untruncated=untruncated,
        ellipsoid=ellipsoid,
        seconds=seconds / (job.steps + 1),
    )


def _size(filter: Filter, X: Array, t: int, window: int) -> tuple[float, Shares, Shares, Shares]:
    """Volume, who is outside for each κ, the share of coordinates (or with κ²), and with P before its truncation.

    Of x_{t−Δ}, or of x_t.
    """
    kappas = np.array(KAPPAS)
    if isinstance(filter, WindowMAP):
        lower, upper = filter.interval_estimates(1.0, met=False)
        middle, half = 0.5 * (lower[1] + upper[1]), 0.5 * (upper[1] - lower[1])
        is_outside = np.abs(X[t - window] - middle) > kappas[:, np.newaxis] * half
        nothing = np.full(len(KAPPAS), np.nan)
        return float(np.prod(2.0 * half)), is_outside.any(axis=1), is_outside.mean(axis=1), nothing
    assert isinstance(filter, TruncatedKalman)
    P, error = filter.covariance, X[t] - filter.point
    distance, wider = (float(error @ np.linalg.solve(S, error)) for S in (P, filter.untruncated.covariance))
    shares = (np.asarray(far) for far in (distance > kappas**3, distance > kappas**2, wider > kappas**3))
    over, over_squared, over_untruncated = shares
    return float(np.linalg.det(P)), over, over_squared, over_untruncated


def untruncated_determinant(factor: float) -> float:
    """det P of the Kalman filter without truncation once it has settled; no data change it."""
    size, box = np.sqrt(factor), (LOWER, UPPER)
    filter = Kalman(LSUModel(A=A, B=B, C=C, rho=size * RHO, r=size * R), box)
    for _ in range(SETTLED):
        filter.update(np.zeros(len(C)))
        filter.predict(np.zeros(1))
    filter.update(np.zeros(len(C)))
    return float(np.linalg.det(filter.covariance))
