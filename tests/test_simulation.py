"""The simulated plant: reproducible from (seed, name, step), and true to its declared bounds in exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact_flow import fixed, floats, flow, times
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import LSUModel, ModelError, simulate, systems
from lsu_mesh.simulation import NOISE_SHARE, measure, next_state, random_corner, random_normal, random_uniform
from lsu_mesh.testing.exact_plant import exact_product


def test_values_are_functions_of_seed_name_and_step() -> None:
    """Whoever starts at step 7 draws what the one that ran from step 1 drew there."""
    late = random_uniform(1, "plant", 7, 3)
    for step in range(1, 7):
        random_uniform(1, "plant", step, 3)
    np.testing.assert_array_equal(random_uniform(1, "plant", 7, 3), late)
    others = [random_uniform(2, "plant", 7, 3), random_uniform(1, "s1", 7, 3), random_uniform(1, "plant", 8, 3)]
    assert all((other != late).all() for other in others)


def test_the_values_themselves_are_frozen() -> None:
    """A recording can be recomputed years later only if these numbers never change."""
    np.testing.assert_array_equal(random_corner(1, "plant", 1, 6), [-1.0, 1.0, -1.0, -1.0, -1.0, 1.0])
    assert random_uniform(1, "plant", 1, 1)[0] == -0.8454190157429398
    assert random_normal(1, "plant", 1, 1)[0] == -0.7914536597940793


def test_uniform_and_normal_have_their_moments() -> None:
    uniform = np.array([random_uniform(3, "x", k, 4) for k in range(2000)])
    assert np.abs(uniform).max() <= 1.0
    assert uniform.mean() == pytest.approx(0.0, abs=0.03)
    assert uniform.var() == pytest.approx(1 / 3, abs=0.02)
    assert np.array([random_normal(3, "x", k, 4) for k in range(2000)]).std() == pytest.approx(1.0, abs=0.03)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 6), exponent=st.integers(-6, 6), corners=st.booleans())
def test_stored_numbers_fulfil_the_bounds_exactly(seed: int, n: int, exponent: int, corners: bool) -> None:
    rng, scale = np.random.default_rng(seed), 10.0**exponent
    model = LSUModel(
        rng.normal(size=(n, n)) * 0.5, rng.normal(size=(n, 1)), rng.normal(size=(2, n)),
        scale * rng.random(n), scale * rng.random(2),
    )  # fmt: skip
    data = simulate(model, 6, seed, x1=scale * rng.normal(size=n), noise="corners" if corners else "uniform")
    assert model.B is not None
    for k in range(6):
        x = [Fraction(v) for v in data.X[k].tolist()]
        for y, exact, r in zip(data.Y[k].tolist(), exact_product(model.C, x), model.r.tolist(), strict=True):
            assert abs(Fraction(y) - exact) <= Fraction(r)
        if k < 5:
            drift = exact_product(model.A, x)
            driven = exact_product(model.B, [Fraction(v) for v in data.U[k].tolist()])
            for v, a, b, rho in zip(data.X[k + 1].tolist(), drift, driven, model.rho.tolist(), strict=True):
                assert abs(Fraction(v) - a - b) <= Fraction(rho)


def test_corner_noise_reaches_the_corners() -> None:
    model = LSUModel([[1.0]], None, [[1.0]], 0.5, 0.25)
    data = simulate(model, 50, seed=1, noise="corners")
    np.testing.assert_allclose(np.abs(np.diff(data.X[:, 0])), 0.5, rtol=1e-12)
    np.testing.assert_allclose(np.abs(data.Y - data.X), 0.25, rtol=1e-12)


def test_a_run_can_be_continued_from_any_step() -> None:
    """The pieces that plant and sensors use, step by step, give what ``simulate`` gives."""
    model = systems.get("P3")
    data = simulate(model, 20, seed=5)
    for k in range(10, 19):
        x = next_state(model, data.X[k], data.U[k], random_uniform(5, "process", k + 1, 3))
        np.testing.assert_array_equal(x, data.X[k + 1])
        np.testing.assert_array_equal(
            measure(model.C, model.r, data.X[k], random_uniform(5, "output", k + 1, 2)), data.Y[k]
        )


def test_inputs() -> None:
    model = systems.get("S3")
    assert (simulate(model, 5, 1, inputs="zero").U == 0).all()
    assert np.abs(simulate(model, 200, 1, inputs="sine").U).max() == pytest.approx(1.0)
    given_inputs = np.arange(5.0).reshape(5, 1)
    np.testing.assert_array_equal(simulate(model, 5, 1, inputs=given_inputs).U, given_inputs)
    with pytest.raises(ModelError, match='"normal", "zero", "sine"'):
        simulate(model, 5, 1, inputs="cosine")
    with pytest.raises(ModelError, match="shape"):
        simulate(model, 5, 1, inputs=np.zeros((4, 1)))
    with pytest.raises(ModelError, match="x1 must have 2"):
        simulate(model, 5, 1, x1=[0.0])


def test_the_truth_of_a_continuous_plant_is_that_of_the_exact_flow() -> None:
    """At any moment within a step, to the last digits: the noise is constant within a step."""
    flow_model = LSUModel.continuous(
        [[0.0, 1.0], [-4.0, -0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [0.3], [0.1], [[0.5], [1.0]], a=[0, 0.2]
    )
    run = simulate(flow_model, 5, 1, x1=[1.0, 0.0], dt_ns=100_000_000)
    assert run.times == [100_000_000 * k for k in range(1, 6)]
    A, rates = fixed(flow_model.rates.A), flow_model.rates
    for k in range(5):
        drive = fixed(rates.B @ run.U[k] + rates.a + rates.noise_map @ (NOISE_SHARE * rates.rho * run.units[k]))  # type: ignore[operator]
        for rest in (0, 1, 33_333_333, 99_999_999):
            E, F = flow(A, rest)
            exact = floats(times(E, fixed(run.X[k])) + times(F, drive))
            np.testing.assert_allclose(run.truth_at(run.times[k] + rest), exact, rtol=1e-13, atol=1e-14)
    np.testing.assert_array_equal(run.truth_at(run.times[2]), run.X[2])
    np.testing.assert_array_equal(run.input_at(run.times[2] + 5), run.U[2])
    with pytest.raises(ModelError, match="the simulation goes from"):
        run.truth_at(99_999_999)
    with pytest.raises(ModelError, match="dt_ns, the length of a step, belongs to a continuous model"):
        simulate(flow_model, 5, 1)  # type: ignore[call-overload]


def test_outputs_with_offsets_and_periods_keep_their_bounds() -> None:
    model = LSUModel(
        [[1.0]], [[1.0]], [[1.0], [1.0]], 0.1, 0.25, D=[[2.0], [0.0]], a=[30.0], d=[1.0, 0.0], period=[0, 360.0]
    )
    run = simulate(model, 50, 2, noise="corners")
    for x, y, u in zip(run.X, run.Y, run.U, strict=True):
        assert abs(Fraction(y[0]) - Fraction(x[0]) - 2 * Fraction(u[0]) - 1) <= Fraction(0.25)
        assert -180.0 <= y[1] < 180.0
        assert abs((y[1] - x[0] + 180.0) % 360.0 - 180.0) <= 0.25 + 1e-9
    for before, after, u in zip(run.X, run.X[1:], run.U, strict=False):
        assert abs(Fraction(after[0]) - Fraction(before[0]) - Fraction(u[0]) - 30) <= Fraction(0.1)
