"""What LSUP loses if its time update widens the bounds by rho, where ``|M A⁻¹| rho`` is meant.

The support is ``|M x − m| ≤ h``. The data update puts the strip ``|C x − y| ≤ r`` in the place of a row, or leaves all
rows. The time update is ``M ← M A⁻¹`` and ``h ← h + |M| rho``. With ``h ← h + rho`` it is right for M = I only, and too
narrow where the rows of M have become longer. The set is kept as ``c + T ξ``, ``|ξ|∞ ≤ 1``, ``T = M⁻¹ diag(h)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Flags, Matrix, Vector
from lsu_mesh.experiments.l2019.criteria import START, Job
from lsu_mesh.experiments.monte_carlo import simulate_all
from lsu_mesh.experiments.outcome import Spread
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import Simulation

TIE = 1.0 - 1e-9
"""A strip is taken only where it is narrower than the row's by more than rounding: ties keep the old row."""


class Losses(NamedTuple):
    """Shares of steps in per cent: states outside the support's hull, predicted outputs outside, data that miss it."""

    states: float
    outputs: float
    empty: float


class Body(NamedTuple):
    """``c + T ξ``: c (n,), T (n, n), and the half-widths h (n,) of the rows of M."""

    c: Vector
    T: Matrix
    half: Vector

    def hull(self) -> tuple[Vector, Vector]:
        """Interval hull."""
        reach = np.abs(self.T).sum(axis=1)
        return self.c - reach, self.c + reach


def losses(job: Job, is_right: bool = False) -> Losses:
    """Over all runs of a job with one output noise; ``is_right`` has the right widening, which loses nothing."""
    (model,) = job.models()
    data = simulate_all([model], job.draws(), START)
    flags = np.array([_run(model, data, run, is_right=is_right) for run in range(job.runs)])
    return Losses(*(100.0 * flags.mean(axis=(0, 1))))


def _run(model: LSUModel, data: Simulation, run: int, *, is_right: bool) -> Flags:
    """By step: state outside, output outside, data that contradict the set, which are left out then; (T, 3)."""
    n = model.state_count
    body = Body(np.zeros(n), START * np.eye(n), np.full(n, START))
    flags = np.zeros((data.X.shape[1], 3), dtype=np.bool_)
    for k in range(data.X.shape[1]):
        x, y = data.X[run, k], data.Y[run, k]
        flags[k, 1] = (np.abs(y - model.C @ body.c) > np.abs(model.C @ body.T).sum(axis=1) + model.r).any()
        cut = strip(body, model.C[0], low=y[0] - model.r[0], high=y[0] + model.r[0])
        flags[k, 2] = cut is None
        body = cut or body
        lower, upper = body.hull()
        flags[k, 0] = bool((lower > x).any() or (upper < x).any())
        body = advance(body, model, data.U[run, k], is_right=is_right)
    return flags


def strip(body: Body, p: Vector, low: float, high: float) -> Body | None:
    """Update with ``low ≤ p'x ≤ high`` (Vicino, Zappa 1996): the strip replaces the row that leaves the least volume.

    None where the strip misses the set.
    """
    s, g = float(p @ body.c), body.T.T @ p
    total = float(np.abs(g).sum())
    if low - s > total or high - s < -total:
        return None
    first, last = max(low - s, -total), min(high - s, total)
    others = total - np.abs(g)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort([(low - s - others) / g, (high - s + others) / g], axis=0)
    down = np.where(g == 0.0, -1.0, np.maximum(ends[0], -1.0))
    up = np.where(g == 0.0, 1.0, np.minimum(ends[1], 1.0))
    k = int(np.argmax(np.abs(g) * (up - down)))
    T, half = body.T.copy(), 0.5 * (up - down)
    middle, h = 0.5 * (up + down), body.half * half
    if abs(g[k]) * (up[k] - down[k]) * TIE > last - first:
        T -= np.outer(T[:, k], np.where(np.arange(len(g)) == k, 0.0, g)) / g[k]
        T[:, k] /= g[k]
        middle[k], half[k] = 0.5 * (last + first), 0.5 * (last - first)
        h[k] = half[k]
    return Body(body.c + T @ middle, T * half, h)


def advance(body: Body, model: LSUModel, u: Vector, *, is_right: bool) -> Body:
    """Time update with the right or the wrong widening."""
    T = model.A @ body.T
    shift = 0.0 if model.B is None else model.B @ u
    growth = np.abs(np.linalg.inv(T)) @ model.rho if is_right else model.rho / body.half
    return Body(model.A @ body.c + shift, T * (1.0 + growth), body.half * (1.0 + growth))


def over_cells(found: Sequence[Losses], what: str) -> Spread:
    """Mean and deviation over the cells of the grid."""
    return Spread.of([getattr(one, what) for one in found])
