"""The strip update against linear programs, enumeration and exact rationals."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest
from from_python import from_python
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from lsu_mesh.kernels.parallelotopes import box, enclosure, strip_update
from lsu_mesh.kernels.runtime.scratch import scratch
from lsu_mesh.supports.exact import Membership, parallelotope_membership

cut_in_place, tighten = from_python(strip_update.cut), from_python(box.tighten)
enclose = from_python(enclosure.enclose)


class Cut(NamedTuple):
    """A parallelotope c + T ξ, a strip lo ≤ p'x ≤ hi, and what the update made of them."""

    c: np.ndarray
    T: np.ndarray
    p: np.ndarray
    lo: float
    hi: float
    status: int
    new_c: np.ndarray
    new_T: np.ndarray
    delta: np.ndarray


def cut(c: np.ndarray, T: np.ndarray, p: np.ndarray, lo: float, hi: float) -> Cut:
    new_c, new_T, delta = c.copy(), T.copy(), np.zeros(len(c))
    status = cut_in_place(new_c, new_T, delta, p, lo, hi, False, np.zeros((strip_update.STRIP_ROWS, len(c))))
    return Cut(c, T, p, lo, hi, status, new_c, new_T, delta)


def random_cut(rng: np.random.Generator, n: int, offset: float = 1.1) -> Cut:
    c, T, p = rng.normal(size=n), rng.normal(size=(n, n)), rng.normal(size=n)
    reach = np.abs(p @ T).sum()
    middle = p @ c + reach * rng.uniform(-offset, offset)
    width = reach * rng.uniform(0.0, 1.0)
    return cut(c, T, p, middle - width, middle + width)


def tightened_range(case: Cut, j: int) -> tuple[float, float]:
    """The range of ξ_j over the cube and the strip, by two linear programs."""
    g, s = case.p @ case.T, case.p @ case.c
    rows, sides = np.vstack([g, -g]), np.array([case.hi - s, s - case.lo])
    objective = np.eye(len(g))[j]
    ends = [sign * linprog(sign * objective, A_ub=rows, b_ub=sides, bounds=(-1, 1)).fun for sign in (1, -1)]
    return ends[0], ends[1]


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_no_other_choice_of_n_strips_has_less_volume(n: int) -> None:
    """Enumeration: tighten all n + 1 strips by linear programs, leave out each in turn, take the least volume."""
    rng, compared = np.random.default_rng(n), 0
    while compared < 15:
        case = random_cut(rng, n)
        if case.status == strip_update.EMPTY:
            continue
        g = case.p @ case.T
        s, total = case.p @ case.c, np.abs(g).sum()
        own = [np.subtract(*tightened_range(case, j)[::-1]) for j in range(n)]
        new = min(case.hi - s, total) - max(case.lo - s, -total)
        # volume relative to |det T|, with edge k left out: the strip of the others, and the new one along edge k
        volumes = [np.prod(own)] + [np.prod(np.delete(own, k)) * new / abs(g[k]) for k in range(n)]
        made = abs(np.linalg.det(case.new_T)) * 2**n / abs(np.linalg.det(case.T))
        assert made == pytest.approx(min(volumes), rel=1e-7, abs=1e-12)
        compared += 1


def test_empty_is_said_exactly_where_the_linear_program_is_infeasible() -> None:
    rng, empty = np.random.default_rng(0), 0
    for _ in range(200):
        case = random_cut(rng, int(rng.integers(1, 6)), offset=2.0)
        g, s = case.p @ case.T, case.p @ case.c
        program = linprog(np.zeros(len(g)), A_ub=np.vstack([g, -g]), b_ub=[case.hi - s, s - case.lo], bounds=(-1, 1))
        assert (case.status == strip_update.EMPTY) == (program.status == 2)
        empty += case.status == strip_update.EMPTY
    assert 20 < empty < 100


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 5), exponent=st.integers(-8, 8), flat=st.booleans())
def test_no_point_of_the_set_in_the_strip_is_lost(seed: int, n: int, exponent: int, flat: bool) -> None:
    """In exact rationals: a corner of the old set on the very edge of the strip."""
    rng = np.random.default_rng(seed)
    c, T, p = rng.normal(size=n), rng.normal(size=(n, n)), rng.normal(size=n)
    T[:, -1] *= 0.0 if flat else 10.0**exponent
    corner = [Fraction(int(v)) for v in rng.choice([-1, 1], n)]
    x = [
        Fraction(a) + sum(Fraction(t) * v for t, v in zip(row, corner, strict=True))
        for a, row in zip(c.tolist(), T.tolist(), strict=True)
    ]
    value = sum((Fraction(a) * v for a, v in zip(p.tolist(), x, strict=True)), Fraction(0))
    hi = np.nextafter(float(value), np.inf)
    lo = hi - abs(rng.normal())
    case = cut(c, T, p, lo, hi)
    assert case.status != strip_update.EMPTY
    assert within(case, x)


def within(case: Cut, x: list[Fraction]) -> bool:
    """Whether x lies in the parallelotope that the update ends in, which holds ``new_c + new_T ξ ⊕ box(delta)``."""
    n = len(x)
    assert enclose(case.new_T, np.zeros((n, 0)), np.zeros(0), case.delta, scratch(n, 0))
    return parallelotope_membership(case.new_c, case.new_T, x) is Membership.INSIDE


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 5))
def test_the_volume_never_grows(seed: int, n: int) -> None:
    case = random_cut(np.random.default_rng(seed), n)
    assert abs(np.linalg.det(case.new_T)) <= abs(np.linalg.det(case.T)) * (1 + 1e-12)


def test_a_strip_that_does_not_cut_changes_nothing() -> None:
    case = cut(np.array([0.5, 0.5]), np.eye(2), np.array([1.0, 1.0]), -10.0, 10.0)
    assert case.status == strip_update.UNCHANGED
    np.testing.assert_array_equal(case.new_T, case.T)
    np.testing.assert_array_equal(case.delta, 0.0)


def test_a_vanishing_row_is_no_strip() -> None:
    case = cut(np.zeros(2), np.eye(2), np.zeros(2), -1.0, 1.0)
    assert case.status == strip_update.UNCHANGED


def test_a_vanishing_row_that_misses_zero_is_a_contradiction() -> None:
    assert cut(np.zeros(2), np.eye(2), np.zeros(2), 1.0, 2.0).status == strip_update.EMPTY


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 5))
def test_a_tightened_box_is_the_hull_of_box_and_strip(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    lower = rng.normal(size=n)
    upper, p = lower + rng.random(n), rng.normal(size=n)
    inside = lower + (upper - lower) * rng.random(n)
    lo, hi = p @ inside - rng.random() * 0.2, p @ inside + rng.random() * 0.2
    new_lower, new_upper = lower.copy(), upper.copy()
    assert tighten(new_lower, new_upper, p, lo, hi) != strip_update.EMPTY
    for j in range(n):
        ends = [
            sign
            * linprog(
                sign * np.eye(n)[j],
                A_ub=np.vstack([p, -p]),
                b_ub=[hi, -lo],
                bounds=list(zip(lower, upper, strict=True)),
            ).fun
            for sign in (1, -1)
        ]
        np.testing.assert_allclose([new_lower[j], new_upper[j]], ends, atol=1e-7)


@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (0, 2, 1), (2, 1, 0)])
def test_a_sum_that_cancels_does_not_empty_a_box(order: tuple[int, ...]) -> None:
    """``2⁵³ + 1 − 2⁵³`` is 1, in doubles 0 in some orders: the strip ``x₁ + x₂ + x₃ = 1`` holds this very point."""
    point = np.array([2.0**53, 1.0, -(2.0**53)])[list(order)]
    lower, upper = point.copy(), point.copy()
    assert tighten(lower, upper, np.ones(3), 1.0, 1.0) != strip_update.EMPTY
    assert (lower <= point).all()
    assert (point <= upper).all()
