"""Membership in a parallelotope, decided in exact rational arithmetic."""

from __future__ import annotations

import enum
from fractions import Fraction

from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector

Row = list[Fraction]


class Membership(enum.Enum):
    """What exact arithmetic says about a point."""

    INSIDE = enum.auto()
    OUTSIDE = enum.auto()
    UNDECIDED = enum.auto()
    """The columns are dependent: a linear program has to decide."""


def parallelotope_membership(c: Vector, T: Matrix, x: NDArray | list[Fraction]) -> Membership:  # type: ignore[type-arg]
    """Whether ``T ξ = x − c`` has a solution with ``|ξ|∞ ≤ 1``; c, x (n,), T (n, n), x may hold fractions.

    Vanishing columns are left out (a flat box is decided); other dependent columns leave the question open unless
    x − c lies outside their span.
    """
    used = [j for j in range(T.shape[1]) if T[:, j].any()]
    rows = [[Fraction(float(T[i, j])) for j in used] + [Fraction(x[i]) - Fraction(float(c[i]))] for i in range(len(c))]
    rank = _eliminate(rows, len(used))
    if any(row[-1] != 0 for row in rows[rank:]):
        return Membership.OUTSIDE
    if rank < len(used):
        return Membership.UNDECIDED
    return Membership.INSIDE if all(abs(row[-1]) <= 1 for row in rows[:rank]) else Membership.OUTSIDE


def _eliminate(rows: list[Row], columns: int) -> int:
    """Gauss–Jordan in place on the first columns; returns the rank."""
    rank = 0
    for column in range(columns):
        pivot = next((i for i in range(rank, len(rows)) if rows[i][column] != 0), None)
        if pivot is None:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        rows[rank] = [entry / rows[rank][column] for entry in rows[rank]]
        for i, row in enumerate(rows):
            if i != rank and row[column] != 0:
                rows[i] = [a - row[column] * b for a, b in zip(row, rows[rank], strict=True)]
        rank += 1
    return rank
