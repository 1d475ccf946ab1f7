"""The flow of ``ẋ = A x + B u + N w`` in fixed-point arithmetic of 448 bits: the truth for continuous models.

Numbers are Python integers times 2⁻⁴⁴⁸; every double down to 1e-80 is one exactly, and a product loses 2⁻⁴⁴⁸.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

BITS = 448
ONE = 1 << BITS
OWN_ROUNDING = 1 << 48
Table = np.ndarray
"""Of Python integers (dtype object)."""


def fixed(M: np.ndarray) -> Table:
    """Doubles as integers times 2⁻⁴⁴⁸."""
    flat = [int(Fraction(v) * ONE) for v in np.asarray(M, dtype=float).ravel().tolist()]
    table = np.empty(len(flat), dtype=object)
    table[:] = flat
    return table.reshape(np.shape(M))


def times(A: Table, B: Table) -> Table:
    """``A B``"""
    return (A @ B) >> BITS


class Flow(NamedTuple):
    """``E = e^{At}`` and ``F = ∫₀ᵗ e^{As} ds``."""

    E: Table
    F: Table


def flow(A: Table, ns: int | Fraction) -> Flow:
    """E and F for t in nanoseconds, off by less than 2⁻³⁰⁰ of their size."""
    n = len(A)
    t = Fraction(ns) / 10**9
    scaled = t * sum(abs(v) for v in A.ravel()) / ONE
    halvings = max(0, int(scaled).bit_length() + 8)
    step = t / 2**halvings
    X = (A * step.numerator) // step.denominator
    identity = fixed(np.eye(n))
    term, total = identity.copy(), identity.copy()
    for k in range(1, 34):
        term = times(term, X) // (k + 1)
        total = total + term
    answer = Flow(identity + times(X, total), (total * step.numerator) // step.denominator)
    for _ in range(halvings):
        answer = doubled(answer)
    return answer


def doubled(flow: Flow) -> Flow:
    """The flow of twice the time."""
    E, F = flow
    return Flow(times(E, E), F + times(F, E))


def floats(table: Table) -> np.ndarray:
    """The nearest doubles."""
    return np.array([float(Fraction(int(v), ONE)) for v in table.ravel()]).reshape(table.shape)


def within(table: Table, middle: np.ndarray, radius: np.ndarray) -> bool:
    """Whether ``|table − middle| ≤ radius`` in every entry, to 2⁻⁴⁰⁰: the rounding of the table itself."""
    return bool((np.abs(table - fixed(middle)) <= fixed(radius) + OWN_ROUNDING).all())
