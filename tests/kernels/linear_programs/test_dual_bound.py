"""The dual bound is above the exact value of its own formula, by less than 1e-12 of its scale."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh.kernels.linear_programs.dual_bound import absolute_row_sums, dual_bound


def _exact_bound(d: np.ndarray, A: np.ndarray, b: np.ndarray, y: np.ndarray) -> Fraction:
    """``b'y + Σ_j |d_j − (A'y)_j|`` in rationals."""
    y_exact = [Fraction(v) for v in y.tolist()]
    total = sum((Fraction(s) * v for s, v in zip(b.tolist(), y_exact, strict=True)), Fraction(0))
    for j, d_j in enumerate(d.tolist()):
        total += abs(Fraction(d_j) - sum((Fraction(float(A[i, j])) * v for i, v in enumerate(y_exact)), Fraction(0)))
    return total


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-300, 1e-9, 1.0, 1e9, 1e150]))
def test_is_rounded_up_and_loses_little(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    m, g = int(rng.integers(0, 12)), int(rng.integers(1, 30))
    A, b, d = rng.normal(size=(m, g)), rng.normal(size=m), rng.normal(size=g) * scale
    y = rng.normal(size=m) * scale
    bound = Fraction(dual_bound(d, A, b, absolute_row_sums(A, np.ones(A.shape[1])), y))
    exact = _exact_bound(d, A, b, y)
    size = sum(
        abs(Fraction(v))
        for v in [*d.tolist(), *(y * absolute_row_sums(A, np.ones(A.shape[1]))).tolist(), *(y * b).tolist()]
    )
    assert exact <= bound
    assert bound - exact <= Fraction(1e-13) * size + Fraction(1e-300)


def test_multipliers_that_are_not_finite_count_as_none() -> None:
    d, A, b = np.array([1.0, -2.0]), np.ones((1, 2)), np.array([0.5])
    bound = dual_bound(d, A, b, absolute_row_sums(A, np.ones(A.shape[1])), np.array([np.nan]))
    assert 3.0 <= bound <= 3.0 + 1e-14


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_row_sums_are_rounded_up(seed: int) -> None:
    A = np.random.default_rng(seed).normal(size=(3, 17))
    for got, row in zip(absolute_row_sums(A, np.ones(A.shape[1])), A, strict=True):
        assert Fraction(float(got)) >= sum(abs(Fraction(v)) for v in row.tolist())
