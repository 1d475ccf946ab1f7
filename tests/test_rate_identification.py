"""The rates of a continuous model that explain data: the exact ones where they are known, whatever the step is."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUCZ, InconsistentData, LSUModel, ModelError, Orthotope, run_filter, simulate
from lsu_mesh.identification import explain
from lsu_mesh.rate_identification import explain_rates

SECOND = 10**9


def drifting(rho: float = 1.0, r: float = 0.2):  # type: ignore[no-untyped-def]
    """``ẋ = w``, ``y = x + v``."""
    return LSUModel.continuous([[0.0]], None, [[1.0]], [rho], [r], domain=([-1e3], [1e3]))


def moving(rho: float = 2.0, r: float = 0.05):  # type: ignore[no-untyped-def]
    """A body on a line."""
    return LSUModel.continuous(
        [[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [rho], [r], [[0.0], [1.0]],
        domain=([-1e4, -1e3], [1e4, 1e3]),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("dt", [0.1, 0.5, 3.0])
def test_the_smallest_rate_of_a_drift_is_the_steepest_pair(seed: int, dt: float) -> None:
    """``|x_i − x_j| ≤ rho (t_i − t_j)`` for all pairs is all that ``|w| ≤ rho`` asks: rho is known by hand."""
    rng = np.random.default_rng(seed)
    y = np.cumsum(rng.uniform(-1, 1, 40))
    y[rng.integers(0, 40, 6)] = np.nan
    r, known = 0.2, np.flatnonzero(~np.isnan(y))
    steepest = max((abs(y[j] - y[i]) - 2 * r) / (dt * (j - i)) for n, i in enumerate(known) for j in known[n + 1 :])
    found = explain_rates(drifting(0.5, r), y[:, None], dt_ns=round(dt * SECOND), learn="rho", margin=1.0, share=1.0)
    assert found.rho == pytest.approx([steepest], rel=1e-6)
    assert found.factor == pytest.approx(steepest / 0.5, rel=1e-6)
    assert found.r.tolist() == [r]
    assert found.model.flow is not None
    assert found.model.flow.rates.rho == pytest.approx([steepest], rel=1e-6)


@pytest.mark.parametrize("every", [1, 2, 5])
def test_the_true_rates_need_no_factor_above_one_whatever_the_step_is(every: int) -> None:
    """Data of the same course at every step, every second, every fifth: no factor of dt in what is found."""
    flow, dt = moving(), SECOND // 10
    inputs = np.repeat(np.random.default_rng(0).uniform(-1, 1, (60, 1)), 5, axis=0)
    data = simulate(flow, 300, 1, inputs=inputs, dt_ns=dt)
    found = explain_rates(flow, data.Y[::every], data.U[::every], dt_ns=every * dt, learn="rho", margin=1.0, share=1.0)
    assert 0.2 < found.factor <= 1.0 + 1e-9
    assert found.rho == pytest.approx(found.factor * flow.rates.rho)


def test_a_rate_that_was_declared_too_small_is_found_out() -> None:
    data = simulate(moving(), 400, 1, inputs="zero", dt_ns=SECOND // 5)
    found = explain_rates(moving(rho=0.25), data.Y, data.U, dt_ns=SECOND // 5, learn="rho")
    assert 2.0 < found.factor <= 8.0
    assert found.held_out is not None
    assert found.held_out.is_explained
    prior = Orthotope([-1e3, -1e2], [1e3, 1e2])
    run_filter(LSUCZ(found.model, prior), data.Y, data.U)  # raises where it contradicts
    with pytest.raises(InconsistentData):
        run_filter(LSUCZ(moving(rho=0.25).discretised(SECOND // 5), prior), data.Y, data.U)


def test_r_alone_and_both() -> None:
    data = simulate(moving(), 150, 2, inputs="zero", dt_ns=SECOND // 5)
    alone = explain_rates(moving(r=0.01), data.Y, data.U, dt_ns=SECOND // 5, learn="r", margin=1.5, share=1.0)
    assert alone.rho.tolist() == alone.smallest_rho.tolist() == [2.0]
    assert alone.r == pytest.approx(1.5 * alone.factor * np.array([0.01]))
    assert 0.01 < alone.smallest_r[0] <= 0.05 * (1 + 1e-9)
    both = explain_rates(moving(), data.Y, data.U, dt_ns=SECOND // 5, margin=1.5, share=1.0)
    assert both.rho == pytest.approx(1.5 * both.factor * np.array([2.0]))
    assert both.factor <= 1.0 + 1e-9


def test_what_makes_no_sense_for_rates_is_refused() -> None:
    Y = np.zeros((10, 1))
    with pytest.raises(ModelError, match="several columns of a step's noise come from one rate"):
        explain_rates(moving(), Y, np.zeros((10, 1)), dt_ns=SECOND, learn="separate")
    with pytest.raises(ModelError, match="whole number of nanoseconds"):
        explain_rates(moving(), Y, np.zeros((10, 1)), dt_ns=0.1)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=r"explain_rates"):
        explain(moving(), Y)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=r"explain_rates"):
        explain(moving().discretised(SECOND), Y, np.zeros((10, 1)))
