"""Feasibility of ``A ξ = b, |ξ|∞ ≤ 1`` decided in exact rational arithmetic: a proof either way, in milliseconds."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

Row = list[Fraction]


def exact_solution(
    A: Sequence[Sequence[Fraction]], b: Sequence[Fraction], near: Sequence[float]
) -> list[Fraction] | None:
    """A ξ (g,) with ``A ξ = b`` and ``|ξ|∞ ≤ 1``, A (m, g), or ``None`` where there is none.

    The simplex method on the sum of what the basic variables are beyond ±1, with Bland's rule, so that it ends. It
    starts from the vertex that ``near`` (g,) suggests, any numbers; a good one saves nearly all of the work.
    """
    g = len(near)
    rows = [[Fraction(a) for a in row] + [Fraction(side)] for row, side in zip(A, b, strict=True)]
    basis = _reduce(rows, sorted(range(g), key=lambda j: abs(near[j])))
    if any(row[g] != 0 for row in rows[len(basis) :]):
        return None
    del rows[len(basis) :]
    at = {j: Fraction(1 if near[j] > 0 else -1) for j in range(g) if j not in basis}
    while True:
        level = [row[g] - sum(row[j] * value for j, value in at.items() if row[j]) for row in rows]
        beyond = [(value > 1) - (value < -1) for value in level]
        if not any(beyond):
            xi = [at.get(j, Fraction(0)) for j in range(g)]
            for i, j in enumerate(basis):
                xi[j] = level[i]
            return xi
        entering = _entering(rows, at, beyond)
        if entering is None:
            return None
        _step(rows, basis, at, level=level, beyond=beyond, j=entering)


def _reduce(rows: list[Row], order: Sequence[int]) -> list[int]:
    """Gauss–Jordan in place, columns in this order; returns the basic variables of the first rows, rank of them."""
    basis: list[int] = []
    for j in order:
        k = len(basis)
        pivot = max(range(k, len(rows)), key=lambda i: abs(rows[i][j]), default=None)
        if pivot is None:
            break
        if rows[pivot][j] == 0:
            continue
        rows[k], rows[pivot] = rows[pivot], rows[k]
        _pivot(rows, k, j)
        basis.append(j)
    return basis


def _pivot(rows: list[Row], k: int, j: int) -> None:
    """Make column j the unit vector of row k."""
    source = [entry / rows[k][j] if entry else entry for entry in rows[k]]
    rows[k] = source
    for i, row in enumerate(rows):
        if i != k and row[j]:
            factor = row[j]
            rows[i] = [a - factor * s if s else a for a, s in zip(row, source, strict=True)]


def _entering(rows: list[Row], at: dict[int, Fraction], beyond: list[int]) -> int | None:
    """The first variable whose move off its bound brings the basic variables nearer to their bounds."""
    for j in sorted(at):
        slope = sum(sign * row[j] for sign, row in zip(beyond, rows, strict=True) if sign and row[j])
        if slope * at[j] < 0:
            return j
    return None


def _step(rows: list[Row], basis: list[int], at: dict[int, Fraction], level: Row, beyond: list[int], j: int) -> None:
    """Move variable j off its bound until it or a basic variable meets one."""
    direction = -at[j]
    shortest, leaving, bound = Fraction(2), -1, Fraction(0)
    for i, row in enumerate(rows):
        speed = -row[j] * direction
        if speed == 0 or beyond[i] * speed > 0:
            continue
        # what lies beyond a bound stops where it comes back to it, what lies inside where it would leave
        stop = Fraction(beyond[i]) if beyond[i] else Fraction(1 if speed > 0 else -1)
        length = (stop - level[i]) / speed
        if length < shortest or (length == shortest and leaving >= 0 and basis[i] < basis[leaving]):
            shortest, leaving, bound = length, i, stop
    if leaving < 0:
        at[j] = direction
        return
    del at[j]
    at[basis[leaving]] = bound
    basis[leaving] = j
    _pivot(rows, leaving, j)
