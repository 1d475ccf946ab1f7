"""Simulations of one system by the thousand: all runs and all noise levels at once, for the compiled banks.

The values are functions of (seed, run), the same for every noise level (common random numbers), so that a surface over
the noise shows the noise and not the luck of its cells. As in ``simulation``, the simulation's own rounding is charged
to the noise: the stored numbers fulfil the declared bounds in exact arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Stack
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import Simulation, generator


class Draws(NamedTuple):
    """Unit noise in [−1, 1] of R runs: start (R, n), process (R, T, n), output (R, T, m); inputs (R, T, p), N(0, 1)."""

    start: Matrix
    process: Stack
    output: Stack
    inputs: Stack

    def runs(self, first: int, last: int) -> Draws:
        """The runs first … last − 1."""
        return Draws(*(table[first:last] for table in self))


def draw(model: LSUModel, steps: int, seed: int, runs: int) -> Draws:
    """What drives ``runs`` runs of a model with n states, m outputs and p inputs."""
    n, m, p = model.state_count, model.output_count, model.input_count
    rows = []
    for run in range(runs):
        source = generator(seed, f"run {run}", 0)
        rows.append(
            (
                2.0 * source.random(n) - 1.0,
                2.0 * source.random((steps, n)) - 1.0,
                2.0 * source.random((steps, m)) - 1.0,
                source.standard_normal((steps, p)),
            )
        )
    return Draws(*(np.array(column) for column in zip(*rows, strict=True)))


def simulate_all(models: Sequence[LSUModel], draws: Draws, spread_of_start: float = 0.0) -> Simulation:
    """M models, which differ only in rho and r, times R runs: X (M R, T, n), Y (M R, T, m), U (M R, T, p).

    Runs of one model stand together. ``x_1 = spread_of_start · start``.
    """
    A, C = models[0].A, models[0].C
    B = np.zeros((len(A), 0)) if models[0].B is None else models[0].B
    count, (runs, steps, n) = len(models), draws.process.shape
    X, Y = np.empty((count, runs, steps, n)), np.empty((count, runs, steps, len(C)))
    rho = np.array([model.rho for model in models])[:, np.newaxis]
    r = np.array([model.r for model in models])[:, np.newaxis]
    x = np.broadcast_to(spread_of_start * draws.start, (count, runs, n))
    for k in range(steps):
        X[:, :, k] = x
        Y[:, :, k] = _noisy(C, x, np.zeros((len(C), 0)), u=np.zeros((runs, 0)), unit=draws.output[:, k], half_widths=r)
        x = _noisy(A, x, B, u=draws.inputs[:, k], unit=draws.process[:, k], half_widths=rho)
    U = np.broadcast_to(draws.inputs, (count, *draws.inputs.shape))
    return Simulation(*(table.reshape(count * runs, steps, -1) for table in (X, Y, U)))


def _noisy(A: Matrix, x: Stack, B: Matrix, u: Matrix, unit: Matrix, half_widths: Stack) -> Stack:
    """``A x + B u + w``, ``|w| ≤ half_widths``: ``w`` is shrunk by the rounding of this line."""
    value = np.einsum("ij,mrj->mri", A, x) + np.einsum("ij,rj->ri", B, u)
    size = np.einsum("ij,mrj->mri", np.abs(A), np.abs(x)) + np.einsum("ij,rj->ri", np.abs(B), np.abs(u)) + half_widths
    room = half_widths - (2.0 * gamma(A.shape[1] + B.shape[1] + 4) * size + UNDERFLOW)
    return np.asarray(value + unit * np.maximum(room, 0.0))
