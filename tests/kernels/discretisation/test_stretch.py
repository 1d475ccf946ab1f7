"""A stretch of a continuous model holds the exact flow of every measurable noise, the worst one included."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact_flow import ONE, OWN_ROUNDING, Flow, doubled, fixed, floats, flow, times, within

from lsu_mesh.kernels.discretisation.stretch import discretise

CASES, SOAK_CASES = 400, 100_000
DOUBLINGS = 6
SWITCH_POINTS = 2**DOUBLINGS
KINDS = ("plain", "stiff", "oscillating", "nilpotent", "unstable", "mixed units", "one state")


def draw(rng: np.random.Generator, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]:
    """A (n, n), B (n, p), N (n, q), rho (q,) of this kind, and a stretch in ns."""
    n = 1 if kind == "one state" else int(rng.integers(2, 9))
    q, h = int(rng.integers(1, n + 1)), float(10.0 ** rng.uniform(-3, 0.3))
    A = rng.normal(size=(n, n)) / np.sqrt(n)
    if kind == "stiff":
        A = A - np.diag(10.0 ** rng.uniform(0, 3, n))
    elif kind == "oscillating":
        A = 10.0 ** rng.uniform(0, 1.5) * (A - A.T) - 0.1 * np.eye(n)
    elif kind == "nilpotent":
        A = np.triu(A, 1)
    elif kind == "unstable":
        A = A + np.eye(n)
    elif kind == "mixed units":
        units = 10.0 ** rng.uniform(-4, 4, n)
        A = A * units[:, None] / units
    N = rng.normal(size=(n, q)) * (rng.random((n, q)) < 0.7)
    return A, rng.normal(size=(n, 2)), N, rng.random(q) * 10.0 ** rng.uniform(-3, 3), round(h * 1e9)


def worst_noise(step: Flow, N: np.ndarray, rho: np.ndarray, d: np.ndarray) -> int:
    """``d' ∫₀ʰ e^{As} N w(s) ds`` times 2⁴⁴⁸ for the w that switches with the sign of ``d' e^{As} N``, exactly.

    The switches are taken to the next of ``SWITCH_POINTS`` points: wherever they are, w is a noise like any other.
    """
    row, total = fixed(d), 0
    exact_N, E = fixed(N), floats(step.E)
    now = d
    for _ in range(SWITCH_POINTS):
        now, before = now @ E, now
        w = fixed(rho * np.where((now + before) @ N < 0, -1.0, 1.0))
        total += int(times(times(times(row, step.F), exact_N), w))
        row = times(row, step.E)
    return total


def reach(columns: np.ndarray, widths: np.ndarray, d: np.ndarray) -> int:
    """The support ``Σ_j |d' g_j| widths_j`` of the noise in direction d, exactly, times 2⁴⁴⁸."""
    return int(times(np.abs(times(fixed(d), fixed(columns))), fixed(widths))) + OWN_ROUNDING


def holds(rng: np.random.Generator, kind: str) -> bool:
    A, B, N, rho, h_ns = draw(rng, kind)
    finite, A_h, A_radius, B_h, B_radius, columns, widths, _ = discretise(A, B, N, rho, float(h_ns))
    assert finite
    step = flow(fixed(A), Fraction(h_ns, SWITCH_POINTS))
    whole = step
    for _ in range(DOUBLINGS):
        whole = doubled(whole)
    assert within(whole.E, A_h, A_radius), kind
    assert within(times(whole.F, fixed(B)), B_h, B_radius), kind
    d = rng.normal(size=len(A)) if rng.random() < 0.7 else np.eye(len(A))[rng.integers(len(A))]
    return worst_noise(step, N, rho, d) <= reach(columns, widths, d)


@pytest.mark.parametrize("kind", KINDS)
def test_the_exact_flow_of_bang_bang_noise_is_inside(kind: str) -> None:
    rng = np.random.default_rng(KINDS.index(kind))
    assert all(holds(rng, kind) for _ in range(CASES // len(KINDS)))


@pytest.mark.soak
@pytest.mark.timeout(0)
def test_the_exact_flow_of_bang_bang_noise_is_inside_in_full() -> None:
    rng = np.random.default_rng(99)
    assert all(holds(rng, KINDS[k % len(KINDS)]) for k in range(SOAK_CASES))


def test_the_double_integrator_is_exact_to_rounding() -> None:
    A, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    for h_ns in (1, 333_333_333, 10**9, 3600 * 10**9):
        h = Fraction(h_ns, 10**9)
        _, A_h, A_radius, B_h, B_radius, columns, widths, _ = discretise(A, b, b, np.array([0.5]), float(h_ns))
        exact = {"A": [1, h, 0, 1], "B": [h * h / 2, h], "hull": [h * h / 4, h / 2]}
        hull = np.abs(columns) @ widths
        for name, found in (("A", A_h), ("B", B_h), ("hull", hull)):
            np.testing.assert_allclose(found.ravel(), [float(v) for v in exact[name]], rtol=2e-14, atol=0)
        assert (A_radius <= 2e-14 * np.abs(A_h)).all()
        assert (B_radius <= 2e-14 * np.abs(B_h)).all()
        assert columns.shape == (2, 4)  # one slice, and the box
        assert (widths[2:] <= 2e-14 * hull).all()


@pytest.mark.parametrize("kind", ["plain", "oscillating", "nilpotent", "unstable"])
def test_the_hull_is_tight_where_the_stretch_is_short(kind: str) -> None:
    """``|A| h ≤ 1``: at most 1.02 times what a noise reaches in each coordinate."""
    rng = np.random.default_rng(5)
    worst = 1.0
    for _ in range(12):
        A, B, N, rho, h_ns = draw(rng, kind)
        A /= max(1.0, np.abs(A).sum(axis=1).max() * h_ns / 1e9)
        _, _, _, _, _, columns, widths, _ = discretise(A, B, N, rho, float(h_ns))
        step = flow(fixed(A), Fraction(h_ns, SWITCH_POINTS))
        for i in range(len(A)):
            d = np.eye(len(A))[i]
            exact = worst_noise(step, N, rho, d) / ONE
            if exact > 1e-9 * (np.abs(columns) @ widths).max():
                worst = max(worst, float(np.abs(columns[i]) @ widths) / exact)
    assert worst <= 1.02, worst


def test_a_stretch_that_overflows_is_named() -> None:
    A, B, N = np.array([[1000.0]]), np.zeros((1, 0)), np.ones((1, 1))
    assert not discretise(A, B, N, np.ones(1), 1e9)[0]
    assert not discretise(A, B, N, np.ones(1), 1e30)[0]
