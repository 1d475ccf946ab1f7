"""Equations ``[H B; B' S] [u; v] = [f; h]`` with a band H of many unknowns and a border of few, by Cholesky's method.

The band is kept by rows: ``band[i, j] = H[i, i − j]`` for 0 ≤ j ≤ reach.
"""

from __future__ import annotations

import math

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.compile import inlined, inner

BEYOND = 1e64
"""Root of the pivot of an unknown whose equation says nothing new."""


@inner
def factor_bordered(band: Matrix, border: Matrix, corner: Matrix, least: float) -> None:
    """Factor in place: band (N, reach + 1), border (N, k), corner (k, k), its lower part.

    ``least``: the share of a diagonal entry that must be left of it, or its unknown stays where it is.
    """
    _factor_band(band, least)
    _forward_columns(band, border)
    count, k = border.shape
    given = np.empty(k)
    for a in range(k):
        given[a] = corner[a, a]
    for i in range(count):
        for a in range(k):
            value = border[i, a]
            if value != 0.0:
                for b in range(a + 1):
                    corner[a, b] -= value * border[i, b]
    _factor_dense(corner, given, least)


@inner
def solve_bordered(band: Matrix, border: Matrix, corner: Matrix, u: Vector, v: Vector) -> None:
    """Solve with what :func:`factor_bordered` has left; u (N,), v (k,) come as the right side, go as the answer."""
    count, k = border.shape
    reach = band.shape[1] - 1
    for i in range(count):
        total = u[i]
        for j in range(1, min(reach, i) + 1):
            total -= band[i, j] * u[i - j]
        u[i] = total / band[i, 0]
    for i in range(count):
        for a in range(k):
            v[a] -= border[i, a] * u[i]
    _solve_dense(corner, v)
    for i in range(count):
        total = u[i]
        for a in range(k):
            total -= border[i, a] * v[a]
        u[i] = total
    for i in range(count - 1, -1, -1):
        value = u[i] / band[i, 0]
        u[i] = value
        for j in range(1, min(reach, i) + 1):
            u[i - j] -= band[i, j] * value


@inlined
def _pivot(left: float, given: float, least: float) -> float:
    """The root of what is left of a diagonal entry; beyond all measure where only rounding is: that unknown stays."""
    return math.sqrt(left) if left > least * given else BEYOND


@inner
def _factor_band(band: Matrix, least: float) -> None:
    count, width = band.shape
    for i in range(count):
        for j in range(min(width - 1, i), -1, -1):
            column = i - j
            given = total = band[i, j]
            for s in range(j + 1, min(width - 1, i) + 1):
                if s - j < width:
                    total -= band[i, s] * band[column, s - j]
            band[i, j] = total / band[column, 0] if j > 0 else _pivot(total, given, least)


@inner
def _forward_columns(band: Matrix, border: Matrix) -> None:
    count, k = border.shape
    reach = band.shape[1] - 1
    for i in range(count):
        for j in range(1, min(reach, i) + 1):
            value = band[i, j]
            if value != 0.0:
                for a in range(k):
                    border[i, a] -= value * border[i - j, a]
        pivot = band[i, 0]
        for a in range(k):
            border[i, a] /= pivot


@inner
def _factor_dense(corner: Matrix, given: Vector, least: float) -> None:
    k = corner.shape[0]
    for i in range(k):
        for j in range(i + 1):
            total = corner[i, j]
            for s in range(j):
                total -= corner[i, s] * corner[j, s]
            corner[i, j] = total / corner[j, j] if j < i else _pivot(total, given[i], least)


@inner
def _solve_dense(corner: Matrix, v: Vector) -> None:
    k = corner.shape[0]
    for i in range(k):
        for j in range(i):
            v[i] -= corner[i, j] * v[j]
        v[i] /= corner[i, i]
    for i in range(k - 1, -1, -1):
        for j in range(i + 1, k):
            v[i] -= corner[j, i] * v[j]
        v[i] /= corner[i, i]
