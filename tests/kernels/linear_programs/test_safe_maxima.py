"""Maxima over ``{ξ : A ξ = b, |ξ|∞ ≤ 1}``: equal to HiGHS, never below an exact value, empty only with a proof."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from lsu_mesh.kernels.linear_programs.safe_maxima import EMPTY, TIGHT, maxima, open_program, variable_ranges


def _solve(D: np.ndarray, A: np.ndarray, b: np.ndarray) -> tuple[int, np.ndarray]:
    status, program = open_program(A, b)
    if status == EMPTY:
        return EMPTY, np.full(D.shape[0], -np.inf)
    solved, values, _ = maxima(program, D)
    return max(status, solved), values


def _feasible_program(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and sides with a feasible ξ that fulfils them *exactly*: eighths times sixteenths are exact in double."""
    g = int(rng.integers(1, 26))
    m = int(rng.integers(0, g + 2))
    A = rng.integers(-16, 17, size=(m, g)) / 8.0
    xi = rng.choice([-1.0, 1.0], size=g) if rng.random() < 0.4 else rng.integers(-16, 17, size=g) / 16.0
    if m > 2 and rng.random() < 0.3:
        A[-1] = A[0] - A[1]
    return A, xi, A @ xi


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_equals_highs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, _, b = _feasible_program(rng)
    D = rng.normal(size=(4, A.shape[1]))
    status, values = _solve(D, A, b)
    assert status == TIGHT
    for d, value in zip(D, values, strict=True):
        best = -linprog(-d, A_eq=A, b_eq=b, bounds=(-1, 1)).fun if A.shape[0] else np.abs(d).sum()
        assert abs(value - best) <= 1e-9 * np.abs(d).sum()


@settings(max_examples=400, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(-60, 60))
def test_an_exact_feasible_point_is_never_cut_off(seed: int, exponent: int) -> None:
    rng = np.random.default_rng(seed)
    A, xi, b = _feasible_program(rng)
    scale = np.exp2(rng.integers(-20, 21, size=b.size)) * 2.0**exponent
    D = rng.normal(size=(3, xi.size))
    status, values = _solve(D, A * scale[:, None], b * scale)
    assert status != EMPTY
    for d, value in zip(D, values, strict=True):
        reached = sum(Fraction(a) * Fraction(x) for a, x in zip(d.tolist(), xi.tolist(), strict=True))
        assert Fraction(float(value)) >= reached


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_loses_at_most_1e_minus_12(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, b = rng.normal(size=(8, 20)), rng.normal(size=8)
    D = rng.normal(size=(6, 20))
    status, program = open_program(A, b)
    if status == EMPTY:
        assert linprog(np.zeros(20), A_eq=A, b_eq=b, bounds=(-1, 1)).status == 2
        return
    _, values, points = maxima(program, D)
    assert np.abs(points).max() <= 1 + 1e-11
    assert np.abs(points @ A.T - b).max() <= 1e-11
    assert (values - np.einsum("ij,ij->i", D, points) <= 1e-12 * np.abs(D).sum(axis=1)).all()


@pytest.mark.parametrize("miss", [1e-3, 1e-9, 1e-11])
def test_a_small_gap_is_proved(miss: float) -> None:
    A = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, -1.0]])
    status, _ = open_program(A, np.array([2.0 + miss, 0.0]))
    assert status == EMPTY
    status, _ = open_program(A, np.array([2.0, 0.0]))
    assert status != EMPTY


def test_rows_that_contradict_each_other_are_proved_empty() -> None:
    A = np.array([[1.0, 0.5, 0.0], [1.0, 0.5, 0.0]])
    assert open_program(A, np.array([0.3, 0.4]))[0] == EMPTY
    assert open_program(A, np.array([0.3, 0.3]))[0] == TIGHT
    assert open_program(np.zeros((1, 3)), np.array([1e-30]))[0] == EMPTY
    assert open_program(np.zeros((1, 3)), np.zeros(1))[0] == TIGHT


def test_without_rows_or_variables() -> None:
    status, values = _solve(np.array([[1.0, -2.0]]), np.zeros((0, 2)), np.zeros(0))
    assert status == TIGHT
    assert 3.0 <= values[0] <= 3.0 + 1e-14
    status, values = _solve(np.zeros((1, 0)), np.zeros((0, 0)), np.zeros(0))
    assert status == TIGHT
    assert 0.0 <= values[0] <= 1e-290


def test_the_same_arrays_give_the_same_bits() -> None:
    rng = np.random.default_rng(5)
    A, D = rng.normal(size=(8, 20)), rng.normal(size=(6, 20))
    b = A @ rng.uniform(-1, 1, 20)
    first, second = _solve(D, A, b)[1], _solve(D.copy(), A.copy(), b.copy())[1]
    assert first.tobytes() == second.tobytes()


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_ranges_of_the_variables(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, xi, b = _feasible_program(rng)
    g = xi.size
    _, program = open_program(A, b)
    _, _, points = maxima(program, rng.normal(size=(3, g)))
    low, high = variable_ranges(program, points)
    assert (low <= xi).all()
    assert (xi <= high).all()
    if A.shape[0]:
        for j in range(0, g, 5):
            d = np.eye(g)[j]
            assert abs(high[j] + linprog(-d, A_eq=A, b_eq=b, bounds=(-1, 1)).fun) <= 2e-9
            assert abs(low[j] - linprog(d, A_eq=A, b_eq=b, bounds=(-1, 1)).fun) <= 2e-9


@pytest.mark.parametrize("size", [(60, 200), (30, 35)])
def test_larger_programs(size: tuple[int, int]) -> None:
    rng = np.random.default_rng(3)
    m, g = size
    A, D = rng.normal(size=(m, g)), rng.normal(size=(2, g))
    b = A @ rng.uniform(-0.9, 0.9, g)
    status, values = _solve(D, A, b)
    assert status == TIGHT
    for d, value in zip(D, values, strict=True):
        assert abs(value + linprog(-d, A_eq=A, b_eq=b, bounds=(-1, 1)).fun) <= 1e-9 * np.abs(d).sum()
