"""Mean and variance of truncated normal distributions, beside numerical integration and SciPy's functions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erfcx

from lsu_mesh.kernels.points.normal import scaled_tail, truncated_normal


def test_the_scaled_tail_is_that_of_scipy() -> None:
    x = np.concatenate([np.linspace(0.0, 12.0, 600), np.logspace(1, 8, 200)])
    found = np.array([scaled_tail(value) for value in x])
    np.testing.assert_allclose(found, erfcx(x / math.sqrt(2.0)), rtol=2e-14)


def moments(c: float, d: float) -> tuple[float, float]:
    """By quadrature, in units of the density where it is largest."""
    top = min(max(0.0, c), d)

    def density(t: float) -> float:
        return math.exp(0.5 * (top - t) * (top + t))

    ends = (max(c, top - 12.0), min(d, top + 12.0))
    mass = quad(density, *ends, epsabs=0.0, epsrel=1e-12, points=[top], limit=200)[0]
    mean = quad(lambda t: (t - top) * density(t), *ends, epsabs=1e-15, epsrel=1e-11, points=[top], limit=200)[0] / mass
    return top + mean, quad(lambda t: (t - top - mean) ** 2 * density(t), *ends, points=[top])[0] / mass


@pytest.mark.parametrize(
    ("c", "d"),
    [(-1.0, 2.0), (-0.3, 0.1), (0.5, 0.7), (3.0, 9.0), (-40.0, -30.0), (20.0, 20.5), (-8.0, 8.0), (1.0, 1.01)],
)  # fmt: skip
def test_moments_are_those_of_an_integral(c: float, d: float) -> None:
    mean, variance = truncated_normal(c, d)
    expected_mean, expected_variance = moments(c, d)
    assert mean == pytest.approx(expected_mean, abs=1e-7 * (d - c))
    assert variance == pytest.approx(expected_variance, rel=1e-4, abs=1e-9)
    mirrored, same = truncated_normal(-d, -c)
    assert (mirrored, same) == (-mean, variance)


def test_the_mean_never_leaves_the_interval() -> None:
    rng = np.random.default_rng(1)
    for _ in range(3000):
        c = float(rng.normal()) * 10.0 ** rng.integers(-3, 8)
        d = c + 10.0 ** rng.uniform(-12, 6)
        mean, variance = truncated_normal(c, d)
        assert c <= mean <= d
        assert 0.0 <= variance <= 1.0
