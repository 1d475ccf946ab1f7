"""The covariance that noise of a continuous model collects over a stretch."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.points.density import noise_covariance
from lsu_mesh.kernels.runtime.compile import inlined, kernel

TERMS = 14
"""Of the series, at ``‖A‖ h ≤ ½``: the rest is below 1e-16."""


@kernel
def stretch_covariance(A: Matrix, N: Matrix, rho: Vector, h: float, Q: Matrix) -> None:
    """``Q ← ∫₀ʰ e^{As} N diag(rho²/3) N' e^{A's} ds``; A (n, n) in 1/s, N (n, q), h in seconds.

    By its series over ``h/2^k``, then doubled: ``Q(2h) = Q(h) + e^{Ah} Q(h) e^{A'h}``. An approximation, no bound.
    """
    n = A.shape[0]
    norm = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(A[i, j])
        norm = max(norm, row)
    doublings = 0
    while norm * h > 0.5 and doublings < 1000:
        h, doublings = 0.5 * h, doublings + 1
    term, E, power, product = np.zeros((n, n)), np.eye(n), np.eye(n), np.zeros((n, n))
    noise_covariance(N, rho, term)
    for i in range(n):
        for j in range(n):
            term[i, j] *= h
            Q[i, j] = term[i, j]
    for k in range(1, TERMS + 1):
        _multiply(A, term, product)
        for i in range(n):
            for j in range(n):
                term[i, j] = (product[i, j] + product[j, i]) * h / (k + 1)
        _multiply(A, power, product)
        for i in range(n):
            for j in range(n):
                Q[i, j] += term[i, j]
                power[i, j] = product[i, j] * h / k
                E[i, j] += power[i, j]
    other = np.zeros((n, n))
    for _ in range(doublings):
        _multiply(E, Q, product)
        for i in range(n):
            for j in range(n):
                total = 0.0
                for k in range(n):
                    total += product[i, k] * E[j, k]
                other[i, j] = Q[i, j] + total
        _multiply(E, E, product)
        for i in range(n):
            for j in range(n):
                Q[i, j], E[i, j] = other[i, j], product[i, j]


@inlined
def _multiply(A: Matrix, B: Matrix, product: Matrix) -> None:
    for i in range(A.shape[0]):
        for j in range(A.shape[0]):
            total = 0.0
            for k in range(A.shape[0]):
                total += A[i, k] * B[k, j]
            product[i, j] = total
