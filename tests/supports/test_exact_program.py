"""Feasibility in exact arithmetic, against HiGHS on integer programs that are clearly one or the other."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from lsu_mesh.supports.exact_program import exact_solution


def _fractions(A: np.ndarray) -> list[list[Fraction]]:
    return [[Fraction(int(a)) for a in row] for row in A]


@settings(max_examples=120, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_agrees_with_highs_and_fulfils_the_equations(seed: int) -> None:
    rng = np.random.default_rng(seed)
    g, m = int(rng.integers(1, 8)), int(rng.integers(1, 8))
    A = rng.integers(-3, 4, size=(m, g))
    b = A @ (rng.integers(-2, 3, size=g) / 2) if rng.random() < 0.5 else rng.integers(-4, 5, size=m).astype(float)
    found = exact_solution(_fractions(A), [Fraction(side) for side in b], rng.uniform(-1, 1, g).tolist())
    assert (found is not None) == (linprog(np.zeros(g), A_eq=A, b_eq=b, bounds=(-1, 1)).status == 0)
    if found is not None:
        assert all(abs(xi) <= 1 for xi in found)
        assert all(
            sum(int(a) * xi for a, xi in zip(row, found, strict=True)) == side for row, side in zip(A, b, strict=True)
        )


@pytest.mark.parametrize(("excess", "feasible"), [(Fraction(0), True), (Fraction(1, 10**40), False)])
def test_decides_what_no_floating_point_can(excess: Fraction, feasible: bool) -> None:
    row = [Fraction(1), Fraction(1, 3), Fraction(-2)]
    side = Fraction(10, 3) + excess
    assert (exact_solution([row], [side], [0.0, 0.0, 0.0]) is not None) == feasible


def test_no_variables_and_no_equations() -> None:
    assert exact_solution([], [], []) == []
    assert exact_solution([[]], [Fraction(1)], []) is None
    assert exact_solution([], [], [0.3]) is not None
