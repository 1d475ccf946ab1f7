"""Every true state lies in the plain strip of its output, judged in rationals."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from lsu_mesh.kernels.plain_outputs import output_shift, plain_strips

PI = Fraction(31415926535897932384626433832795028841971, 10**40)
PERIODS = {2 * math.pi: 2 * PI, 360.0: Fraction(360), 0.1: Fraction(0.1), 0.0: Fraction(0)}


def test_the_strip_holds_the_exact_output() -> None:
    rng = np.random.default_rng(3)
    several = 0
    for _ in range(20_000):
        period = float(rng.choice(list(PERIODS)))
        turns = int(rng.integers(-1000, 1000)) if period else 0
        y, r = float(rng.normal() * 10.0 ** rng.uniform(-6, 3)), float(rng.choice([0.0, 1e-17, 1e-9, 0.01]))
        D, d, u = rng.normal(size=(1, 2)), rng.normal(size=1) * 1e3, rng.normal(size=2)
        u_width = np.array([0.0, float(rng.choice([0.0, 0.5]))])
        exact_u = [
            Fraction(a) + Fraction(b) * int(rng.choice([-1, 1])) for a, b in zip(u.tolist(), u_width, strict=True)
        ]
        shift = Fraction(d[0]) + sum(Fraction(a) * b for a, b in zip(D[0].tolist(), exact_u, strict=True))
        cx = Fraction(y) + turns * PERIODS[period] - shift - Fraction(r) * int(rng.choice([-1, 1]))
        reach = 10.0 ** rng.uniform(-12, 1) * max(period, 1.0)
        low, high = np.array([float(cx) - reach]), np.array([float(cx) + reach])
        middle, spread, out_y, out_r = np.empty(1), np.empty(1), np.empty(1), np.empty(1)
        output_shift(D, d, u, u_width, middle, spread)
        assert abs(shift - Fraction(middle[0])) <= Fraction(spread[0])
        missed = plain_strips(
            np.array([y]), np.array([r]), middle, spread, np.array([period]), low, high, out_y, out_r
        )  # fmt: skip
        assert missed == 0
        assert abs(cx - Fraction(out_y[0])) <= Fraction(out_r[0]), (period, turns, y, r)
        several += out_r[0] > r + spread[0] + 0.5 * period > 0.0
    assert several > 100


def test_no_multiple_is_told_and_the_nearest_is_given() -> None:
    out_y, out_r, none = np.empty(1), np.empty(1), np.zeros(1)
    period, low, high = np.array([360.0]), np.array([725.0]), np.array([726.0])
    assert plain_strips(np.array([10.0]), np.ones(1), none, none, period, low, high, out_y, out_r) == 1
    assert out_y[0] == 730.0


def test_a_set_that_spans_too_many_periods_says_nothing() -> None:
    out_y, out_r, none = np.empty(1), np.empty(1), np.zeros(1)
    low, high = np.array([-1e300]), np.array([1e300])
    assert plain_strips(np.array([10.0]), np.ones(1), none, none, np.array([1e-3]), low, high, out_y, out_r) == 0
    assert math.isnan(out_y[0])
