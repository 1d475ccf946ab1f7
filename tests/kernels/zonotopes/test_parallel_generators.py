"""Merged columns generate everything that the given ones and the slack generate, decided in rationals."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from from_python import from_python
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh.kernels.zonotopes import parallel_generators

merge_parallel = from_python(parallel_generators.merge_parallel)


def _support(d: list[int], L: np.ndarray, slack: np.ndarray) -> Fraction:
    """``max d'z`` over ``L ξ ⊕ box(slack)``, exact."""
    columns = [abs(sum(di * Fraction(v) for di, v in zip(d, column, strict=True))) for column in L.T.tolist()]
    return sum(columns, Fraction(0)) + sum(
        (abs(di) * Fraction(s) for di, s in zip(d, slack.tolist(), strict=True)), Fraction(0)
    )


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_direction_loses_and_next_to_nothing_is_gained(seed: int) -> None:
    rng = np.random.default_rng(seed)
    N, g = int(rng.integers(1, 5)), int(rng.integers(1, 6))
    L = rng.normal(size=(N, g)) * 10.0 ** rng.integers(-5, 6, size=(N, 1)) * (rng.random((N, g)) < 0.7)
    copies = L[:, rng.integers(0, g, size=4)] * rng.normal(size=4) * 10.0 ** rng.integers(-3, 4, size=4)
    near = copies * (1 + rng.normal(size=copies.shape) * rng.choice([0.0, 1e-15, 1e-13, 1e-3], size=4))
    whole = np.hstack([L, near])[:, rng.permutation(g + 4)]
    slack = np.abs(rng.normal(size=N)) * 1e-15
    after = slack.copy()
    merged = merge_parallel(whole.copy(), after)
    assert merged.shape[1] <= whole.shape[1]
    sizes = np.abs(whole).sum(axis=1)
    assert (after - slack <= 2.0**-38 * sizes + 1e-300).all()
    for _ in range(8):
        d = [int(v) for v in rng.integers(-3, 4, size=N)]
        before, now = _support(d, whole, slack), _support(d, merged, after)
        assert before <= now
        room = sum((abs(di) * Fraction(s) for di, s in zip(d, (sizes * 2.0**-37 + 1e-300).tolist(), strict=True)))
        assert now <= before + room


def test_axes_and_multiples_become_one_column_without_slack() -> None:
    L = np.array([[1.0, 2.0, 0.0, -0.5, 1.0], [0.0, 0.0, 4.0, 0.0, 1.0]])
    slack = np.zeros(2)
    merged = merge_parallel(L, slack)
    assert merged.shape == (2, 3)
    assert 3.5 <= merged[0, 0] <= 3.5 * (1 + 1e-15)
    assert merged[:, 1:].tolist() == [[0.0, 1.0], [4.0, 1.0]]
    assert slack[0] <= 1e-14
    assert slack[1] == 0.0


def test_columns_that_differ_in_a_small_row_stay_apart() -> None:
    L = np.array([[1.0, 1.0], [1e-9, -1e-9]])
    assert merge_parallel(L.copy(), np.zeros(2)).tolist() == L.tolist()
