"""Reduction of constrained zonotopes: every exact point of the set stays in the reduced one."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from from_python import from_python
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh.kernels.zonotopes import constraint_elimination, lifted_zonotope
from lsu_mesh.kernels.zonotopes.complexity_reduction import reduce_complexity
from lsu_mesh.supports.exact_program import exact_solution

drop_constraint, eliminate = (
    from_python(constraint_elimination.drop_constraint),
    from_python(constraint_elimination.eliminate),
)
movability, lift, unlift = (
    from_python(constraint_elimination.movability),
    from_python(lifted_zonotope.lift),
    from_python(lifted_zonotope.unlift),
)
rescale_variables, scale_constraints = (
    from_python(lifted_zonotope.rescale_variables),
    from_python(lifted_zonotope.scale_constraints),
)
without_zero_columns = from_python(lifted_zonotope.without_zero_columns)

Lifted = tuple[np.ndarray, np.ndarray, np.ndarray]


def _set_and_point(seed: int) -> tuple[tuple[np.ndarray, ...], np.ndarray, list[Fraction]]:
    """(c, G, A, b), a ξ that fulfils ``A ξ = b`` exactly, and the exact point ``c + G ξ``."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 4)), int(rng.integers(1, 4))
    g = n + m + int(rng.integers(0, 4))
    xi = rng.choice([-1.0, 1.0], size=g) if seed % 2 else rng.integers(-16, 17, size=g) / 16.0
    A = rng.integers(-8, 9, size=(m, g)) / 8.0
    c, G = rng.normal(size=n), rng.normal(size=(n, g)) * 10.0 ** rng.integers(-6, 7, size=(n, 1))
    point = [
        Fraction(s) + sum(Fraction(a) * Fraction(x) for a, x in zip(row, xi.tolist(), strict=True))
        for s, row in zip(c.tolist(), G.tolist(), strict=True)
    ]
    return (c, G, A, A @ xi), xi, point


def _lifted_holds(n: int, L: np.ndarray, middle: np.ndarray, slack: np.ndarray, point: list[Fraction]) -> bool:
    """Whether ``[point; 0] = middle + L ξ + s`` has a solution with ``|ξ| ≤ 1``, ``|s| ≤ slack``."""
    rows = [
        [Fraction(v) for v in row] + [Fraction(width) if k == i else Fraction(0) for k in range(slack.size)]
        for i, (row, width) in enumerate(zip(L.tolist(), slack.tolist(), strict=True))
    ]
    target = point + [Fraction(0)] * (middle.size - n)
    sides = [v - Fraction(s) for v, s in zip(target, middle.tolist(), strict=True)]
    return exact_solution(rows, sides, [0.5] * (L.shape[1] + slack.size)) is not None


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_every_step_keeps_the_point(seed: int) -> None:
    body, xi, point = _set_and_point(seed)
    n = body[0].size
    rng = np.random.default_rng(seed)
    L, middle, slack = lift(*body)
    low = np.maximum(-1.0, xi - rng.random(xi.size) * rng.choice([0.0, 1.0], size=xi.size))
    high = np.minimum(1.0, xi + rng.random(xi.size))
    rescale_variables(L, middle, slack, low, high)
    assert _lifted_holds(n, L, middle, slack, point)
    L = without_zero_columns(L)
    scale_constraints(n, L, middle, slack)
    assert _lifted_holds(n, L, middle, slack, point)
    while L.shape[0] > n:
        L, middle, slack = drop_constraint(n, L, middle, slack)
        assert _lifted_holds(n, L, middle, slack, point)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_reduced_set_keeps_the_point_within_the_limits(seed: int) -> None:
    body, xi, point = _set_and_point(seed)
    n, g = body[1].shape
    rng = np.random.default_rng(seed)
    ones = np.ones(g)
    max_generators = -1 if seed % 5 == 0 else int(rng.integers(n, g + 1))
    max_constraints = -1 if seed % 7 == 0 else int(rng.integers(0, 3))
    c, G, A, b = reduce_complexity(*body, np.minimum(-ones * 0.5, xi), ones, max_generators, max_constraints)
    assert max_generators < 0 or G.shape[1] <= max_generators
    assert max_constraints < 0 or A.shape[0] <= max_constraints
    assert _lifted_holds(n, *lift(c, G, A, b)[:2], np.zeros(n + A.shape[0]), point)


def test_elimination_clears_the_column_and_charges_its_rounding() -> None:
    L = np.array([[0.1, 0.2, 0.3], [0.7, -0.9, 0.5], [0.3, 0.6, 0.8]])
    middle, slack = np.array([1.0, 0.1, 0.2]), np.zeros(3)
    eliminate(L, middle, slack, 2, 1)
    assert (L[:2, 1] == 0).all()
    assert ((slack[:2] > 0) & (slack[:2] < 1e-14)).all()
    assert slack[2] == 0


def test_a_constraint_that_does_not_bind_is_dropped_without_loss() -> None:
    """ξ₂ = (ξ₀ + ξ₁)/2 lies within ±1 by itself: dropping the constraint with it leaves the same box."""
    body = (np.zeros(2), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0.5, 0.5, -1.0]]), np.zeros(1))
    c, G, A, _ = reduce_complexity(*body, -np.ones(3), np.ones(3), 3, 0)
    assert A.shape == (0, G.shape[1])
    assert np.abs(c).max() <= 1e-14
    assert np.abs(G).sum(axis=1) == pytest.approx([1.0, 1.0], rel=1e-12)


def test_movability_is_the_diagonal_of_the_projector() -> None:
    rng = np.random.default_rng(2)
    n, m, g = 2, 3, 8
    L = rng.normal(size=(n + m, g))
    G = L[:n] / np.abs(L[:n]).sum(axis=1)[:, None]
    M = np.block([[L[n:], np.zeros((m, n))], [G, -np.eye(n)]])
    projector = np.eye(g + n) - np.linalg.pinv(M) @ M
    assert movability(n, L) == pytest.approx(np.diag(projector)[:g], abs=1e-12)


def test_lifting_and_back_changes_nothing() -> None:
    body, _, _ = _set_and_point(3)
    L, middle, slack = lift(*body)
    assert (slack == 0).all()
    for back, given_array in zip(unlift(body[0].size, L, middle), body, strict=True):
        assert (back == given_array).all()
