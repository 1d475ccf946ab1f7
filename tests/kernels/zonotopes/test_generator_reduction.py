"""Fewer columns generate everything that the given ones and the slack generate, decided in rationals."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from from_python import from_python
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh.kernels.zonotopes import generator_reduction
from lsu_mesh.supports.exact_program import exact_solution

approximate_inverse, reduce_columns = (
    from_python(generator_reduction.approximate_inverse),
    from_python(generator_reduction.reduce_columns),
)
box_smallest, swallow_column = (
    from_python(generator_reduction.box_smallest),
    from_python(generator_reduction.swallow_column),
)
swallow_box = from_python(generator_reduction.swallow_box)


def _generates(columns: np.ndarray, point: list[Fraction]) -> bool:
    rows = [[Fraction(v) for v in row] for row in columns.tolist()]
    return exact_solution(rows, point, [0.5] * columns.shape[1]) is not None


def _point(L: np.ndarray, xi: np.ndarray, slack: np.ndarray, s: np.ndarray) -> list[Fraction]:
    return [
        sum((Fraction(a) * int(x) for a, x in zip(row, xi.tolist(), strict=True)), Fraction(width) * int(sign))
        for row, width, sign in zip(L.tolist(), slack.tolist(), s.tolist(), strict=True)
    ]


def _columns(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, np.ndarray]:
    N = int(rng.integers(1, 6))
    L = rng.normal(size=(N, N + int(rng.integers(1, 6)))) * 10.0 ** rng.integers(-6, 7, size=(N, 1))
    slack = np.abs(rng.normal(size=N)) * 1e-15 * np.abs(L).sum(axis=1)
    if kind == "thin":
        L[-1] *= 1e-9
        L[-1] += L[0]
    if kind == "flat":
        L[-1] = 0.0
        slack[-1] = 0.0
    if kind == "dependent" and N > 1:
        L[-1] = L[0] * 0.5
    return L, slack


@pytest.mark.parametrize("kind", ["round", "thin", "flat", "dependent"])
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_reduced_columns_hold_every_corner(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    L, slack = _columns(rng, kind)
    N, g = L.shape
    limit = int(rng.integers(N, g + 1))
    for reduced in (reduce_columns(L, slack, limit), box_smallest(L, slack, limit)):
        assert reduced.shape[1] <= limit
        for _ in range(3):
            corner = rng.choice([-1, 1], size=g), rng.choice([-1, 1], size=N)
            assert _generates(reduced, _point(L, corner[0], slack, corner[1]))


def test_parallel_columns_merge_without_loss() -> None:
    L = np.array([[1.0, 0.0, 0.5, 0.0], [0.0, 1.0, 0.0, -2.0]])
    reduced = reduce_columns(L, np.zeros(2), 2)
    assert np.sort(np.abs(reduced).sum(axis=1)) == pytest.approx([1.5, 3.0], rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_box_is_swallowed_by_columns_that_grow_by_little(seed: int) -> None:
    rng = np.random.default_rng(seed)
    N = int(rng.integers(1, 7))
    C = rng.normal(size=(N, N))
    slack = np.abs(rng.normal(size=N)) * 1e-10
    grown = C.copy()
    if not swallow_box(grown, approximate_inverse(C), slack):
        assert np.linalg.cond(C) > 1e8
        return
    point = _point(C, rng.choice([-1, 1], size=N), slack, rng.choice([-1, 1], size=N))
    assert _generates(grown, point)
    needed = np.abs(np.linalg.inv(C)) @ slack
    assert (np.abs(grown / C - 1) <= 1.01 * needed + 1e-13 * np.linalg.cond(C)).all()


def test_no_proof_no_claim() -> None:
    singular = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert not swallow_box(singular.copy(), approximate_inverse(singular), np.full(2, 1e-3))
    assert not swallow_box(np.eye(2), np.zeros((2, 2)), np.full(2, 1e-3))
    assert not swallow_box(np.eye(2), np.eye(2), np.full(2, 10.0))


def test_wrong_coordinates_of_a_column_cost_slack_and_no_point() -> None:
    D, L = np.array([[1.0, 0.5], [0.0, 2.0]]), np.array([[0.3], [-0.7]])
    T = np.linalg.solve(D, L) + np.array([[1e-6], [-2e-6]])
    length, slack = np.ones(2), np.zeros(2)
    swallow_column(D, L, 0, T, length, slack)
    assert (length >= 1 + np.abs(T[:, 0])).all()
    assert (slack >= np.abs(L - D @ T)[:, 0]).all()
    assert (slack <= np.abs(L - D @ T)[:, 0] + 1e-14).all()
