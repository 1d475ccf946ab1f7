"""LSU-CZ and the zonotopic Kalman filter never lose a state that is simulated in exact rationals."""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import LSUCZ, LSUModel, Orthotope, ZonotopicKalman
from lsu_mesh.filters.filter import Filter
from lsu_mesh.supports import reduction
from lsu_mesh.supports.exact import Membership
from lsu_mesh.supports.linear_programs import Maxima

Exact = list[Fraction]
LARGEST_EXACT = 24
"""Generators up to which membership is decided exactly at the steps that ask for it: its cost grows with the cube."""


class Case(NamedTuple):
    """A model, a prior and how far from the corners the noise is drawn (0: at the corners only)."""

    model: LSUModel
    prior: Orthotope
    inner: bool


def _draw_case(rng: np.random.Generator, kind: str) -> Case:
    n, m, scale = int(rng.integers(1, 5)), int(rng.integers(1, 4)), 10.0 ** float(rng.integers(-6, 7))
    if kind == "dyadic":  # outputs are representable, so that r = 0 is possible
        A = rng.integers(-2, 3, size=(n, n)) / 2.0
        C = rng.integers(-2, 3, size=(m, n)) / 2.0
        rho = rng.choice([0.0, 0.5, 1.0], size=n)
        r = rng.choice([0.0, 0.25], size=m)
        return Case(LSUModel(A, None, C, rho, r), Orthotope(-np.ones(n), np.ones(n)), False)
    A = rng.normal(size=(n, n))
    A *= {"stable": 0.9, "unstable": 1.3}.get(kind, 1.0) / max(1e-9, np.abs(np.linalg.eigvals(A)).max())
    if kind == "singular":
        A[:, 0] = A[:, -1] if n > 1 else 0.0
    C = rng.normal(size=(m, n))
    rho = (
        scale * rng.random(n) * rng.choice([0.0, 1e-9, 1.0], size=n) if kind == "degenerate" else scale * rng.random(n)
    )
    r = scale * (0.05 + rng.random(m)) * (1e-7 if kind == "degenerate" else 1.0)
    noise_map = rng.normal(size=(n, 1)) if kind == "rank one" else None
    rho = rho[:1] if kind == "rank one" else rho
    center = scale * rng.normal(size=n)
    widths = scale * rng.random(n) * rng.choice([0.0, 1.0], p=[0.2, 0.8], size=n)
    return Case(
        LSUModel(A, None, C, rho, r, noise_map), Orthotope(center - widths, center + widths), bool(rng.random() < 0.3)
    )


def _product(M: np.ndarray, x: Exact) -> Exact:
    return [sum((Fraction(a) * v for a, v in zip(row, x, strict=True)), Fraction(0)) for row in M.tolist()]


def _measured(rng: np.random.Generator, model: LSUModel, x: Exact, inner: bool) -> np.ndarray:
    """Outputs as doubles that keep ``|y − C x| ≤ r`` exactly, mostly at the end of that range."""
    y = np.empty(model.output_count)
    for i, (output, r) in enumerate(zip(_product(model.C, x), model.r.tolist(), strict=True)):
        y[i] = float(output + Fraction(r) * Fraction(float(rng.uniform(-1, 1)) if inner else int(rng.choice([-1, 1]))))
        while abs(Fraction(float(y[i])) - output) > Fraction(r):
            assert r > 0, "this output cannot be measured without rounding"
            y[i] = np.nextafter(y[i], float(output))
    return y


def _holds(estimator: Filter, x: Exact, in_support: bool) -> None:
    lower, upper = estimator.bounds()
    assert all(Fraction(a) <= v <= Fraction(z) for a, v, z in zip(lower.tolist(), x, upper.tolist(), strict=True))
    body = estimator.support.to_constrained_zonotope()
    if in_support and body.generator_count <= LARGEST_EXACT:
        assert body.membership(x) is Membership.INSIDE
    assert body.contains([float(v) for v in x]) or body.membership(x) is Membership.INSIDE


def _follow(estimator: Filter, case: Case, rng: np.random.Generator, steps: int, check_support_every: int) -> None:
    model = case.model
    lower, upper = case.prior.bounds()
    x = [Fraction(v) for v in np.where(rng.random(lower.size) < 0.5, lower, upper).tolist()]
    N = np.eye(model.state_count) if model.noise_map is None else model.noise_map
    for k in range(steps):
        y = _measured(rng, model, x, case.inner)
        predicted = estimator.predict_output()
        assert (predicted.lower <= y).all()
        assert (y <= predicted.upper).all()
        y[rng.random(y.size) < 0.15] = np.nan
        estimator.update(y)
        _holds(estimator, x, k % check_support_every == check_support_every - 1)
        estimator.predict()
        signs = rng.uniform(-1, 1, model.rho.size) if case.inner else rng.choice([-1.0, 1.0], size=model.rho.size)
        noise = [Fraction(r) * Fraction(s) for r, s in zip(model.rho.tolist(), signs.tolist(), strict=True)]
        x = [a + b for a, b in zip(_product(model.A, x), _product(N, noise), strict=True)]
        _holds(estimator, x, False)


KINDS = ["stable", "unstable", "singular", "degenerate", "rank one", "dyadic"]


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_lsucz_holds_the_exact_state(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    case = _draw_case(rng, kind)
    n = case.model.state_count
    limits = [(None, None), (20, 8), (12, 4), (n + 2, 2)][int(rng.integers(4))]
    _follow(LSUCZ(case.model, case.prior, *limits), case, rng, 10, 5)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_zonotopic_kalman_holds_the_exact_state(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    case = _draw_case(rng, kind)
    order = [None, 15, case.model.state_count][int(rng.integers(3))]
    form = "filter" if rng.random() < 0.5 else "predictor"
    _follow(ZonotopicKalman(case.model, case.prior, order, form), case, rng, 10, 5)


@pytest.mark.soak
@pytest.mark.parametrize("kind", KINDS)
def test_a_hundred_thousand_steps(kind: str) -> None:
    rng = np.random.default_rng(2024)
    for _ in range(850):
        case = _draw_case(rng, kind)
        limits = [(None, None), (20, 8), (12, 4), (case.model.state_count + 2, 2)][int(rng.integers(4))]
        _follow(LSUCZ(case.model, case.prior, *limits), case, rng, 20, 10)


@pytest.mark.parametrize("exponent", [-20, 20])
def test_a_scaled_copy_gives_the_scaled_sets_bit_by_bit(exponent: int) -> None:
    rng = np.random.default_rng(7)
    case = _draw_case(np.random.default_rng(11), "stable")
    model, scale = case.model, 2.0**exponent
    scaled = model.replace(rho=model.rho * scale, r=model.r * scale)
    lower, upper = case.prior.bounds()
    one, other = LSUCZ(model, case.prior, 12, 4), LSUCZ(scaled, (lower * scale, upper * scale), 12, 4)
    x = 0.5 * (lower + upper)
    for _ in range(12):
        y = model.C @ x + model.r * rng.uniform(-1, 1, model.output_count)
        one.update(y)
        other.update(y * scale)
        for plain, larger in zip(one.bounds(), other.bounds(), strict=True):
            assert (plain * scale == larger).all()
        assert (one.support.generators * scale == other.support.generators).all()
        one.predict()
        other.predict()
        x = model.A @ x + model.rho * rng.uniform(-1, 1, model.state_count)


def test_the_check_notices_a_bound_that_is_a_billionth_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = reduction.program_maxima

    def shrunk(*program: object) -> Maxima:
        found = honest(*program)  # type: ignore[arg-type]
        return found._replace(values=found.values - 1e-9 * np.abs(found.values))

    monkeypatch.setattr(reduction, "program_maxima", shrunk)
    case = Case(LSUModel([[0.9]], None, [[1.0]], 0.1, 10.0), Orthotope([-1.0], [1.0]), False)
    estimator = LSUCZ(case.model, case.prior)
    with pytest.raises(AssertionError):
        _follow(estimator, case, np.random.default_rng(0), 5, 5)
