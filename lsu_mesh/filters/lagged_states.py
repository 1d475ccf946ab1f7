"""The states of the last steps as one vector, (x_k, x_{k−1}, …, x_{k−L}), for a set that holds all of them together.

A set of the stacked state knows how the states of different steps hang together: what is learned of x_k cuts x_{k−l}.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.filters.validation import KernelModel
from lsu_mesh.supports.reduction import Body


class StackedStep(NamedTuple):
    """The time update of a stack of ``depth`` states, ``R`` (n depth⁺, n depth), ``B`` (n depth⁺, p), ``G`` alike."""

    R: Matrix
    B: Matrix
    G: Matrix


def stacked_step(arrays: KernelModel, depth: int, lag: int) -> StackedStep:
    """``x⁺ = A x + B u + G w`` on top, every state one place further down; no more than ``lag`` of them stay."""
    n = len(arrays.A)
    if not lag:
        return StackedStep(arrays.A, arrays.B, arrays.G)
    kept = min(depth, lag) * n
    R = np.zeros((n + kept, n * depth))
    R[:n, :n] = arrays.A
    R[n:, :kept] = np.eye(kept)
    below = np.zeros((kept, max(arrays.B.shape[1], arrays.G.shape[1])))
    return StackedStep(
        R, np.vstack([arrays.B, below[:, : arrays.B.shape[1]]]), np.vstack([arrays.G, below[:, : arrays.G.shape[1]]])
    )


def rows_of(P: Matrix, place: int, depth: int) -> Matrix:
    """Rows P (k, n) of the state ``place`` steps back, as rows (k, n depth) of the stack."""
    if depth == 1:
        return P
    rows = np.zeros((len(P), P.shape[1] * depth))
    rows[:, place * P.shape[1] : (place + 1) * P.shape[1]] = P
    return rows


def body_of(body: Body, place: int, n: int) -> Body:
    """The set of the state ``place`` steps back: its rows of (c, G, A, b)."""
    c, G, A, b = body
    if c.size == n:
        return body
    rows = slice(place * n, (place + 1) * n)
    return c[rows].copy(), G[rows].copy(), A, b


def with_newest(stack: Vector, newest: Vector) -> Vector:
    """A side (n depth,) of a box with its first n entries replaced."""
    return np.concatenate([newest, stack[newest.size :]])
