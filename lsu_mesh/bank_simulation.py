"""Many simulated plants of one structure at once; instance by instance the same bits as :mod:`lsu_mesh.simulation`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lsu_mesh.array_types import Matrix, Stack
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma
from lsu_mesh.model import LSUModel


class BankDynamics:
    """Matrices and half-widths of the models of a bank, one for all of them or one per instance; without inputs."""

    def __init__(self, models: Sequence[LSUModel]) -> None:
        first = models[0]
        self._A = np.array([model.A for model in models])
        self._offset = np.array([np.zeros((first.state_count, 0)) if first.a is None else first.a.reshape(-1, 1)])
        self._rho = np.array([model.rho for model in models])
        self._noise_map = first.noise_map

    @property
    def noise_count(self) -> int:
        """q"""
        return int(self._rho.shape[1])

    def next_states(self, X: Matrix, unit: Matrix) -> Matrix:
        """``x⁺ = A x + a + N (rho · unit)`` of every instance, as :func:`lsu_mesh.simulation.next_state`.

        X (N, n), unit (N, q) in [−1, 1]; the result (N, n).
        """
        if self._noise_map is None:
            return bounded_rows(self._A, X, self._offset, unit, half_widths=self._rho)
        out = _terms(self._A, X)
        for column in self._offset.transpose(2, 0, 1):
            out = out + column
        noise = self._rho * unit
        for j in range(noise.shape[1]):
            out = out + self._noise_map[:, j] * noise[:, j : j + 1]
        return out


def measured_rows(C: Matrix, r: Matrix, X: Matrix, unit: Matrix) -> Matrix:
    """``y = C x + r · unit`` of every instance with abs(y − C x) ≤ r exactly, as :func:`lsu_mesh.simulation.measure`.

    C (m, n), r (m,), X (N, n), unit (N, m) in [−1, 1]; the result (N, m).
    """
    return bounded_rows(C[np.newaxis], X, np.zeros((1, len(C), 0)), unit, half_widths=r[np.newaxis])


def bounded_rows(A: Stack, X: Matrix, offset: Stack, unit: Matrix, half_widths: Matrix) -> Matrix:
    """``A x + a + w`` of every row of X, w shrunk by the rounding: ``kernels/plant_step.py`` over a leading axis.

    A (M, k, n), offset (M, k, 0 or 1), half_widths (M, k) with M = 1 or N; X (N, n), unit (N, k).
    """
    value = np.zeros((len(X), A.shape[1]))
    magnitude = np.broadcast_to(half_widths, value.shape).copy()
    columns = [A[:, :, j] * X[:, j : j + 1] for j in range(X.shape[1])]
    columns += [offset[:, :, j] * np.ones((len(X), 1)) for j in range(offset.shape[2])]
    for term in columns:
        value += term
        magnitude += np.abs(term)
    room = half_widths - (2.0 * gamma(X.shape[1] + offset.shape[2] + 4) * magnitude + UNDERFLOW)
    return np.where(room > 0.0, value + unit * room, value)


def _terms(A: Stack, X: Matrix) -> Matrix:
    out = np.zeros((len(X), A.shape[1]))
    for j in range(X.shape[1]):
        out = out + A[:, :, j] * X[:, j : j + 1]
    return out
