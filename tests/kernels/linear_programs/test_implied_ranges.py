"""Ranges that rows imply: they hold every exact point, contain those of HiGHS, and are short where rows say so."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from lsu_mesh.kernels.linear_programs.implied_ranges import implied_ranges
from lsu_mesh.kernels.linear_programs.safe_maxima import EMPTY, Program, maxima, open_program


def _feasible_program(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, a ξ that fulfils them *exactly* and the sides: eighths times sixteenths are exact in double."""
    g = int(rng.integers(1, 20))
    m = int(rng.integers(0, g + 2))
    A = rng.integers(-16, 17, size=(m, g)) / 8.0
    xi = rng.choice([-1.0, 1.0], size=g) if rng.random() < 0.6 else rng.integers(-16, 17, size=g) / 16.0
    if m > 2 and rng.random() < 0.3:
        A[-1] = A[0] - A[1]
    return A, xi, A @ xi


def _at_a_vertex(A: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> Program:
    status, program = open_program(A, b)
    assert status != EMPTY
    maxima(program, rng.normal(size=(2, A.shape[1])))
    return program


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(-60, 60))
def test_an_exact_point_is_never_cut_off(seed: int, exponent: int) -> None:
    rng = np.random.default_rng(seed)
    A, xi, b = _feasible_program(rng)
    scale = np.exp2(rng.integers(-20, 21, size=b.size)) * 2.0**exponent
    low, high = implied_ranges(_at_a_vertex(A * scale[:, None], b * scale, rng))
    assert ((low >= -1.0) & (low <= xi) & (xi <= high) & (high <= 1.0)).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_never_below_the_ranges_of_highs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, _, b = _feasible_program(rng)
    low, high = implied_ranges(_at_a_vertex(A, b, rng))
    for j, d in enumerate(np.eye(A.shape[1])):
        limits = {"A_eq": A, "b_eq": b} if A.shape[0] else {}
        assert high[j] >= -linprog(-d, bounds=(-1, 1), **limits).fun - 1e-9
        assert low[j] <= linprog(d, bounds=(-1, 1), **limits).fun + 1e-9


def test_a_thin_row_shortens_the_range_of_its_variable() -> None:
    """``4 ξ₀ + ξ₁ = 2``: ξ₀ = (2 − ξ₁) / 4 lies in [1/4, 3/4]."""
    low, high = implied_ranges(_at_a_vertex(np.array([[4.0, 1.0]]), np.array([2.0]), np.random.default_rng(1)))
    assert low == pytest.approx([0.25, -1.0], abs=1e-12)
    assert high == pytest.approx([0.75, 1.0], abs=1e-12)
    assert low[0] <= 0.25
    assert high[0] >= 0.75
