"""The gain of a transfer by exact volumes, by hulls, and as each class measures it at no cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from exact_volumes import exact_volume

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    Intersection,
    LSUModel,
    ModelError,
    Orthotope,
    Parallelotope,
    Support,
    ZonotopicKalman,
)
from lsu_mesh.filters.filter import Filter

MODEL = LSUModel(np.eye(2), None, [[1.0, 1.0]], 0.1, 0.1)
SQUARE = Orthotope([-1.0, -1.0], [1.0, 1.0])
BAND = Parallelotope([0.0, 0.0], [[1.0, 0.1], [-1.0, 0.1]])
"""|x₁ + x₂| ≤ .2, |x₁ − x₂| ≤ 2: it touches every side of the square and leaves .76 of the area of 4."""
KINDS = [LSUO, LSUP, LSUPB, LSUCZ, ZonotopicKalman]


def test_a_strip_that_leaves_the_hull_gains_by_the_volume_of_the_set() -> None:
    assert LSUCZ(MODEL, SQUARE).condition(BAND, "hull") == pytest.approx(0.0, abs=1e-9)
    for gain in ({}, {"gain": "support"}):
        found = LSUCZ(MODEL, SQUARE).condition(BAND, **gain)  # type: ignore[arg-type]
        assert found == pytest.approx(math.log(4.0 / 0.76), abs=1e-9)  # 5.3-fold, 1.66 nats
    assert LSUCZ(MODEL, SQUARE).condition(BAND, None) == pytest.approx(0.0, abs=1e-9)


def drawn(kind: Callable[..., Filter], n: int, seed: int) -> tuple[Filter, Support]:
    """A filter that has seen data, and a set that cuts it."""
    rng = np.random.default_rng([n, seed])
    model = LSUModel(rng.normal(size=(n, n)) / n, None, rng.normal(size=(1, n)), 0.1, 0.3)
    options = {"max_generators": 2 * n + 2, "max_constraints": 2} if kind is LSUCZ else {}
    filter = kind(model, Orthotope([-1.0] * n, [1.0] * n), **options)
    filter.update([0.1])
    filter.predict()
    lower, upper = filter.bounds()
    widths = upper - lower
    box = Orthotope(lower + rng.uniform(0.0, 0.3, n) * widths, upper - rng.uniform(0.0, 0.3, n) * widths)
    T = np.diag(0.5 * widths) @ (np.eye(n) + 0.3 * rng.normal(size=(n, n)))
    slanted = Parallelotope(0.5 * (lower + upper), 0.8 * T)
    return filter, (box, slanted, Intersection([slanted, box]))[seed % 3]


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_gains_are_the_logarithms_of_exact_volumes(kind: Callable[..., Filter], n: int) -> None:
    gains = []
    for seed in range(6 if n < 3 else 3):
        filter, other = drawn(kind, n, seed)
        before = exact_volume(filter.support)
        gains.append(filter.condition(other))
        after = exact_volume(filter.support)
        expected = math.log(Fraction(before) / after) if after < before else 0.0
        assert gains[-1] == pytest.approx(expected, abs=1e-9), f"seed {seed}"
    assert kind is ZonotopicKalman or max(gains) > 0.3, "some of the sets cut"


@pytest.mark.parametrize("kind", KINDS)
def test_gains_by_hulls_are_those_of_the_bounds(kind: Callable[..., Filter]) -> None:
    for n, seed in ((2, 0), (3, 2), (5, 2)):
        filter, other = drawn(kind, n, seed)
        before = np.subtract(*filter.bounds()[::-1])
        found = filter.condition(other, "hull")
        sides = np.subtract(*filter.bounds()[::-1])
        assert found == pytest.approx(max(0.0, np.log(before / sides).sum()), abs=1e-9)
        assert found > 0.01


@pytest.mark.parametrize("kind", KINDS)
def test_above_three_states_the_hulls_count(kind: Callable[..., Filter]) -> None:
    (one, other), (same, _) = drawn(kind, 4, 2), drawn(kind, 4, 2)
    assert one.condition(other) == same.condition(other, "hull") > 0.0


@pytest.mark.parametrize("kind", [LSUO, LSUPB, LSUCZ])
def test_a_flat_set_counts_by_the_sides_of_its_hull_that_have_a_width(kind: Callable[..., Filter]) -> None:
    filter = kind(MODEL, Orthotope([-1.0, 0.5], [1.0, 0.5]))
    assert filter.condition(Orthotope([0.0, 0.0], [2.0, 1.0])) == pytest.approx(math.log(2.0), abs=1e-9)


@pytest.mark.parametrize("kind", [LSUP, LSUPB, LSUCZ])
def test_a_set_that_is_flat_but_for_rounding_counts_by_its_hull(kind: Callable[..., Filter]) -> None:
    """Of a diagonal with the thickness of rounding a volume would tell nothing but what was rounded."""
    filter = kind(MODEL, Parallelotope([0.0, 0.0], [[0.5, 0.5e-15], [-0.5, 0.5e-15]]))
    before = np.subtract(*filter.bounds()[::-1])
    found = filter.condition(Orthotope([0.0, -1.0], [1.0, 0.0]))
    sides = np.subtract(*filter.bounds()[::-1])
    assert found == pytest.approx(np.log(before / sides).sum(), abs=1e-9)
    assert kind is LSUP or found == pytest.approx(math.log(4.0), abs=1e-9)


def test_a_width_that_vanishes_is_an_endless_gain() -> None:
    assert LSUO(MODEL, SQUARE).condition(Orthotope([-1.0, 0.0], [1.0, 0.0])) == math.inf


def test_another_word_is_refused() -> None:
    with pytest.raises(ModelError, match='gain must be "support", "hull" or None'):
        LSUCZ(MODEL, SQUARE).condition(BAND, "volume")  # type: ignore[arg-type]
