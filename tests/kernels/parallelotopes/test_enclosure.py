"""The verified enclosure of a zonotope by a parallelotope, in exact rationals."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from from_python import from_python
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh.kernels.parallelotopes import enclosure
from lsu_mesh.kernels.parallelotopes.enclosure import enclose_along_edges
from lsu_mesh.kernels.runtime import linear_algebra
from lsu_mesh.kernels.runtime.scratch import scratch
from lsu_mesh.supports.exact import Membership, _eliminate, parallelotope_membership

enclose, invert = from_python(enclosure.enclose), from_python(linear_algebra.invert)


def corners(
    T: np.ndarray, G: np.ndarray, widths: np.ndarray, delta: np.ndarray, rng: np.random.Generator
) -> list[list[Fraction]]:
    """Some exact vertices of ``T ⊕ G diag(widths) ⊕ box(delta)``."""
    generators = [[Fraction(v) for v in column] for column in T.T.tolist()]
    generators += [
        [Fraction(v) * Fraction(w) for v in column] for column, w in zip(G.T.tolist(), widths.tolist(), strict=True)
    ]
    generators += [
        [Fraction(d) if i == j else Fraction(0) for i in range(len(delta))] for j, d in enumerate(delta.tolist())
    ]
    signs = list(itertools.islice(itertools.product((-1, 1), repeat=len(generators)), 16))
    signs += [tuple(rng.choice([-1, 1], len(generators)).tolist()) for _ in range(30)]
    return [
        [sum((g[i] * e for g, e in zip(generators, row, strict=True)), Fraction(0)) for i in range(len(delta))]
        for row in signs
    ]


@settings(max_examples=120, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 5),
    kind=st.sampled_from(["full", "thin", "nearly singular", "singular", "zero", "flat box"]),
)
def test_every_vertex_lies_inside(seed: int, n: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    T, q = rng.normal(size=(n, n)), int(rng.integers(0, 4))
    if kind == "thin":
        T = T @ np.diag(10.0 ** rng.integers(-16, 3, n)) @ rng.normal(size=(n, n))
    elif kind == "nearly singular":  # the approximate inverse is off by per cents
        T[:, 0] = T[:, -1] + 10.0 ** -rng.uniform(13, 15.5) * rng.normal(size=n)
    elif kind == "singular":
        T[:, 0] = T[:, -1] * 2 if n > 1 else 0.0
    elif kind == "zero":
        T[:] = 0.0
    elif kind == "flat box":
        T = np.diag(rng.choice([0.0, 1.0], n))
    G, widths = rng.normal(size=(n, q)), rng.random(q) * rng.choice([0.0, 1.0], q)
    delta = rng.random(n) * rng.choice([0.0, 1e-16, 1e-3])
    made = T.copy()
    assert enclose(made, G, widths, delta, scratch(n, q))
    for x in corners(T, G, widths, delta, rng):
        assert parallelotope_membership(np.zeros(n), made, x) is Membership.INSIDE


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 4), exponent=st.floats(9.0, 14.0))
def test_edges_grow_enough_where_the_inverse_is_far_off(seed: int, n: int, exponent: float) -> None:
    """Each edge must grow by ``1 + Σ_q |T⁻¹ g_q| widths_q``, T⁻¹ in exact rationals."""
    rng = np.random.default_rng(seed)
    T, G, widths = rng.normal(size=(n, n)), rng.normal(size=(n, 2)), rng.random(2)
    T[:, 0] = T[:, -1] + 10.0**-exponent * rng.normal(size=n)
    made = T.copy()
    if not enclose_along_edges(made, G, widths, np.zeros(n), scratch(n, 2)):
        assert exponent > 11.0
        return
    needed = [Fraction(1)] * n
    for column, width in zip(G.T.tolist(), widths.tolist(), strict=True):
        rows = [[Fraction(v) for v in row] + [Fraction(g)] for row, g in zip(T.tolist(), column, strict=True)]
        _eliminate(rows, n)
        needed = [a + abs(row[-1]) * Fraction(width) for a, row in zip(needed, rows, strict=True)]
    for j in range(n):
        i = int(np.argmax(np.abs(T[:, j])))
        assert Fraction(float(made[i, j])) / Fraction(float(T[i, j])) >= needed[j]


def test_rounding_alone_costs_next_to_nothing() -> None:
    T = np.random.default_rng(1).normal(size=(4, 4))
    made = T.copy()
    assert enclose_along_edges(made, np.zeros((4, 0)), np.zeros(0), np.full(4, 1e-16), scratch(4, 0))
    np.testing.assert_allclose(made, T, rtol=1e-12)


def test_noise_along_the_edges_grows_them_by_its_share() -> None:
    made = np.diag([1.0, 2.0])
    assert enclose(made, np.eye(2), np.array([0.5, 0.5]), np.zeros(2), scratch(2, 2))
    np.testing.assert_allclose(made, np.diag([1.5, 2.5]), rtol=1e-13)


def test_dependent_edges_are_left_to_the_orthogonal_basis() -> None:
    T = np.array([[1.0, 2.0], [1.0, 2.0]])
    made = T.copy()
    work = scratch(2, 0)
    assert not enclose_along_edges(made, np.zeros((2, 0)), np.zeros(0), np.zeros(2), work)
    np.testing.assert_array_equal(made, T)
    assert enclose(made, np.zeros((2, 0)), np.zeros(0), np.zeros(2), work)
    assert abs(made[:, 0] @ made[:, 1]) < 1e-12
    np.testing.assert_allclose(np.abs(made).sum(axis=1), [3.0, 3.0], rtol=1e-12)


def test_what_overflows_is_refused() -> None:
    made = np.diag([1e308, 1e308])
    assert not enclose(made, np.eye(2), np.array([1e308, 1e308]), np.zeros(2), scratch(2, 2))


@pytest.mark.parametrize("n", [1, 2, 3, 6, 12])
def test_the_inverse_is_one(n: int) -> None:
    T = np.random.default_rng(n).normal(size=(n, n)) * 10.0 ** np.arange(n)[:, None]
    inverse = np.empty((n, n))
    assert invert(T, inverse, np.empty((n, n)))
    np.testing.assert_allclose(inverse @ T, np.eye(n), atol=1e-9)
    assert not invert(np.zeros((n, n)), inverse, np.empty((n, n)))
