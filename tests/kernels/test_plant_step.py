"""The plant's step has the bits of a loop over the entries, and its noise keeps the bounds exactly."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray

from lsu_mesh.kernels.plant_step import bounded, mapped
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma

Array = NDArray[np.float64]


def bounded_by_loops(A: Array, x: Array, B: Array, u: Array, unit: Array, half_widths: Array) -> list[float]:
    """Entry by entry, in the order that recordings and other peers count on."""
    out = []
    for i in range(half_widths.size):
        value, magnitude = 0.0, float(half_widths[i])
        for row, entries in ((A[i], x), (B[i], u)):
            for coefficient, entry in zip(row.tolist(), entries.tolist(), strict=True):
                term = coefficient * entry
                value += term
                magnitude += abs(term)
        room = float(half_widths[i]) - (2.0 * gamma(x.size + u.size + 4) * magnitude + UNDERFLOW)
        out.append(value + float(unit[i]) * room if room > 0.0 else value)
    return out


def mapped_by_loops(A: Array, x: Array, B: Array, u: Array, N: Array, unit: Array, half_widths: Array) -> list[float]:
    out = []
    for i in range(A.shape[0]):
        value = 0.0
        for row, entries in ((A[i], x), (B[i], u)):
            for coefficient, entry in zip(row.tolist(), entries.tolist(), strict=True):
                value += coefficient * entry
        for coefficient, width, share in zip(N[i].tolist(), half_widths.tolist(), unit.tolist(), strict=True):
            value += coefficient * (width * share)
        out.append(value)
    return out


def numbers(draw: np.random.Generator, *shape: int) -> Array:
    """Of very different size, zeros of both signs among them."""
    values = draw.normal(size=shape) * 10.0 ** draw.integers(-12, 12, size=shape)
    return np.where(draw.random(shape) < 0.1, draw.choice([0.0, -0.0], size=shape), values)


@pytest.mark.parametrize(("k", "n", "p", "q"), [(1, 1, 0, 1), (3, 3, 1, 3), (2, 5, 2, 4), (0, 2, 1, 0), (40, 40, 9, 9)])
def test_the_bits_are_those_of_a_loop(k: int, n: int, p: int, q: int) -> None:
    draw = np.random.default_rng(n)
    for _ in range(50):
        A, x, B, u = numbers(draw, k, n), numbers(draw, n), numbers(draw, k, p), numbers(draw, p)
        unit, widths = draw.uniform(-1, 1, k), abs(numbers(draw, k))
        got = bounded(A, x, B, u, unit, widths)
        assert got.tobytes() == np.array(bounded_by_loops(A, x, B, u, unit, widths)).tobytes()
        N, unit, widths = numbers(draw, k, q), draw.uniform(-1, 1, q), abs(numbers(draw, q))
        got = mapped(A, x, B, u, N, unit, widths)
        assert got.tobytes() == np.array(mapped_by_loops(A, x, B, u, N, unit, widths)).tobytes()


def test_the_noise_keeps_its_bounds_in_exact_arithmetic() -> None:
    draw = np.random.default_rng(7)
    for _ in range(200):
        A, x, B, u = draw.normal(size=(3, 3)), draw.normal(size=3), draw.normal(size=(3, 1)), draw.normal(size=1)
        widths, unit = 10.0 ** draw.uniform(-12, 0, size=3), draw.choice([-1.0, 1.0], size=3)
        out = bounded(A, x, B, u, unit, widths)
        for i in range(3):
            exact = sum(Fraction(a) * Fraction(b) for a, b in zip(A[i], x, strict=True)) + Fraction(B[i, 0]) * Fraction(
                u[0]
            )
            assert abs(Fraction(out[i]) - exact) <= Fraction(widths[i])


def test_a_plant_that_outgrows_the_numbers_warns_of_nothing(recwarn: pytest.WarningsRecorder) -> None:
    huge = np.full((1, 1), 1e300)
    assert bounded(huge, huge[0], huge, huge[0], np.ones(1), np.ones(1))[0] == np.inf
    assert mapped(huge, huge[0], huge, -huge[0], huge, np.ones(1), np.ones(1)).size == 1
    assert not recwarn.list
