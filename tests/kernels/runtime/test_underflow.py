"""A product below the smallest double is not nothing: sets hold it, at scales of 1e-160, against exact rationals."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUO, LSUP, LSUPB, LSUModel, Orthotope, Zonotope, ZonotopicKalman
from lsu_mesh.filters.filter import Filter
from lsu_mesh.kernels.runtime.rounding import size_of_product

TINY = 1e-170
MADE: dict[str, Callable[[LSUModel, Orthotope], Filter]] = {
    "LSUO": LSUO,
    "LSUP image": LSUP,
    "LSUP cgz": lambda model, prior: LSUP(model, prior, time_update="cgz"),
    "LSUP strips": lambda model, prior: LSUP(model, prior, time_update="strips"),
    "LSUPB": LSUPB,
    "LSUCZ": LSUCZ,
    "ZonotopicKalman": ZonotopicKalman,
}


def holds(lower: np.ndarray, upper: np.ndarray, x: list[Fraction]) -> bool:
    return all(Fraction(a) <= v <= Fraction(b) for a, v, b in zip(lower.tolist(), x, upper.tolist(), strict=True))


@pytest.mark.parametrize("make", MADE.values(), ids=MADE.keys())
@pytest.mark.parametrize("what", ["state", "centre", "input", "noise"])
def test_a_time_update_holds_what_underflows(make: Callable[[LSUModel, Orthotope], Filter], what: str) -> None:
    A = [[TINY, TINY], [0.0, 0.0]] if what in ("state", "centre") else [[0.0, 0.0], [0.0, 0.0]]
    B = [[TINY], [0.0]] if what == "input" else [[0.0], [0.0]]
    N, rho = [[TINY], [0.0]], [TINY if what == "noise" else 0.0]
    low, high = {"state": (-TINY, TINY), "centre": (TINY, TINY)}.get(what, (0.0, 0.0))
    model = LSUModel(A, B, np.zeros((0, 2)), rho, [], noise_map=N)
    filter = make(model, Orthotope([low, low], [high, high]))
    u = TINY if what == "input" else 0.0
    filter.predict([u])
    x = Fraction(A[0][0]) * Fraction(high) + Fraction(A[0][1]) * Fraction(high)
    x += Fraction(B[0][0]) * Fraction(u) + Fraction(TINY) * Fraction(rho[0])
    assert x > 0
    assert float(x) == 0.0
    assert holds(*filter.bounds(), [x, Fraction(0)])
    assert holds(*filter.support.bounds(), [x, Fraction(0)])


@pytest.mark.parametrize("center", [[TINY, 0.0], [0.0, 0.0]])
@pytest.mark.parametrize("generators", [[[TINY], [0.0]], [[0.0], [0.0]]])
def test_a_linear_map_holds_what_underflows(center: list[float], generators: list[list[float]]) -> None:
    image = Zonotope(center, generators).linear_map([[TINY, 0.0], [1.0, 0.0], [0.0, 0.0]])
    top = Fraction(center[0]) + Fraction(generators[0][0])
    assert holds(*image.bounds(), [Fraction(TINY) * top, top, Fraction(0)])
    assert image.bounds()[0][2] == image.bounds()[1][2] == 0.0, "what is 0 stays exact"


def test_only_a_product_with_a_zero_is_nothing() -> None:
    assert size_of_product(0.0, 1e300) == size_of_product(-1e-300, 0.0) == 0.0
    assert size_of_product(-1e-170, 1e-170) > 0.0
    assert size_of_product(-2.0, 3.0) == 6.0
