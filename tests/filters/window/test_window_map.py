"""The sliding window: growth, hand-over, interval estimates, and what it is as a filter."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lsu_mesh import InconsistentData, LSUModel, ModelError, Orthotope, WindowMAP, run_filter, simulate, systems
from lsu_mesh.filters.window.batch_map import batch_map, record
from lsu_mesh.filters.window.interval_estimate import interval_estimate
from lsu_mesh.filters.window.program import HalfWidths
from lsu_mesh.filters.window.structure import Structure

PRIOR = Orthotope([-1.0] * 3, [1.0] * 3)
P3 = systems.get("P3")


def fed(filter: WindowMAP, steps: int, seed: int = 1, missing: float = 0.0) -> NDArray[np.float64]:
    """True states (steps, 3), after the filter has seen the data."""
    data = simulate(P3, steps, seed)
    Y = data.Y.copy()
    Y[np.random.default_rng(seed).random(Y.shape) < missing] = np.nan
    for k in range(steps):
        filter.update(Y[k])
        if k + 1 < steps:
            filter.predict(data.U[k])
    return data.X


def test_until_the_window_is_full_it_is_the_map_of_all_data() -> None:
    data = simulate(P3, 12, 3)
    filter = WindowMAP(P3, PRIOR, window=20)
    for k in range(12):
        filter.update(data.Y[k])
        if k < 11:
            filter.predict(data.U[k])
    structure = Structure(P3)
    widths = HalfWidths.separate(np.zeros(5), np.full(5, np.inf), np.ones(5))
    whole = batch_map(structure, record(structure, data.Y, data.U), widths, PRIOR)
    assert filter.solution is not None
    assert filter.solution.objective == pytest.approx(whole.objective, abs=1e-7)
    assert filter.states.shape == (12, 3)


def test_memory_does_not_grow() -> None:
    filter = WindowMAP(P3, PRIOR, window=5)
    fed(filter, 60, missing=0.4)
    assert filter.states.shape == (7, 3)
    assert all(len(array) in (6, 7) for array in filter.snapshot().data[:8])  # type: ignore[attr-defined]


def test_the_state_that_leaves_is_confined_to_its_interval_estimate() -> None:
    filter = WindowMAP(P3, PRIOR, window=5, handover=2.0)
    fed(filter, 20)
    before = filter.interval_estimates(2.0)
    filter.predict([0.3])
    data = filter.snapshot().data  # type: ignore[attr-defined]
    np.testing.assert_array_equal(data.lower[0], before[0][1])
    np.testing.assert_array_equal(data.upper[0], before[1][1])
    assert np.isnan(data.Y[0]).all()
    assert np.isinf(data.lower[1:]).all()


def test_interval_estimates_are_the_papers() -> None:
    """``μ ± κ n/(n − 2) σ`` for n + 1 estimates; nothing before there are more than three."""
    low, high = np.array([[1.0], [1.0], [1.0]]), np.array([[3.0], [3.0], [3.0]])
    lower, upper = interval_estimate(low, high, np.array([3, 4, 11]), 1.5)
    np.testing.assert_allclose(upper[:, 0], [np.inf, 2 + 1.5 * 3, 2 + 1.5 * 10 / 8])
    np.testing.assert_allclose(lower[:, 0], [-np.inf, 2 - 1.5 * 3, 2 - 1.5 * 10 / 8])


def test_the_factor_is_the_expectation_of_the_posterior() -> None:
    """``E ρ = n/(n − 2) σ`` under the density ``ρ^{−n−1}`` over ``ρ ≥ σ + |x − μ|``, by quadrature (eqs 30, 31)."""
    from scipy.integrate import quad

    n, sigma = 7, 0.4
    mass = quad(lambda rho: 2 * (rho - sigma) * rho ** (-n - 1.0), sigma, np.inf)[0]
    mean = quad(lambda rho: 2 * (rho - sigma) * rho ** (-float(n)), sigma, np.inf)[0] / mass
    _, upper = interval_estimate(np.array([[-sigma]]), np.array([[sigma]]), np.array([n + 1]), 1.0)
    assert upper[0, 0] == pytest.approx(mean, rel=1e-9)


def test_a_snapshot_brings_everything_back_bit_by_bit() -> None:
    filter = WindowMAP(P3, PRIOR, window=6)
    fed(filter, 15)
    filter.predict([0.1])
    snapshot = filter.snapshot()
    first = [filter.update([0.2, -0.1]).bounds(), filter.point, filter.rho]
    filter.restore(snapshot)
    second = [filter.update([0.2, -0.1]).bounds(), filter.point, filter.rho]
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


def test_unknown_entries_move_towards_the_truth() -> None:
    quiet = systems.get("P3", rho=0.01, r=0.01)
    data = simulate(quiet, 120, 1)
    wrong = quiet.replace(A=[[0.7, -0.5, 0.2], [0.5, 0.1, 0.0], [0.3, 0.0, -0.1]])
    filter = WindowMAP(wrong, PRIOR, window=30, unknown=[["A", 1, 1, 0.0, 1.5]])
    run_filter(filter, data.Y, data.U)
    assert filter.theta[0] == pytest.approx(1.0, abs=0.02)


def test_it_runs_like_every_filter() -> None:
    data = simulate(P3, 40, 2)
    run = run_filter(WindowMAP(P3, PRIOR, window=10), data.Y, data.U)
    assert (run.lower <= run.points).all()
    assert (run.points <= run.upper).all()
    assert np.abs(run.points - data.X)[10:].mean() < 0.15
    assert WindowMAP.guarantee == "none"


def test_a_domain_holds_every_state_of_the_window() -> None:
    model = P3.replace(domain=([-0.3] * 3, [0.3] * 3))
    filter = WindowMAP(model, PRIOR, window=8)
    fed(filter, 25)
    assert (np.abs(filter.states) <= 0.3).all()
    assert (np.abs(filter.bounds()) <= 0.3).all()


def test_a_transferred_box_confines_the_newest_state() -> None:
    filter = WindowMAP(P3, PRIOR, window=8)
    fed(filter, 20)
    filter.predict([0.0])
    box = Orthotope(filter.point - 0.01, filter.point + 0.01)
    assert filter.condition(box) > 0
    filter.update([0.0, 0.0])
    assert box.contains(filter.point)
    with pytest.raises(InconsistentData, match="no point in common"):
        filter.condition(Orthotope(filter.point + 5, filter.point + 6))


def test_the_reweighted_objective_has_a_smaller_product() -> None:
    """Objective (20), Σ ln, by reweighting (21), Σ: its Σ ln is lower, its Σ higher."""
    sums, logs = [], []
    for objective in ("sum", "log"):
        filter = WindowMAP(P3, PRIOR, window=20, objective=objective)
        fed(filter, 30, seed=4)
        widths = np.concatenate([filter.rho, filter.r])
        sums.append(widths.sum())
        logs.append(np.log(np.maximum(widths, 1e-3 * widths.max())).sum())
    assert sums[0] <= sums[1]
    assert logs[1] < logs[0]


def test_an_input_that_is_an_interval_costs_no_half_width() -> None:
    model = LSUModel([[1.0]], [[1.0]], [[1.0]], 0.1, 0.1)
    filter = WindowMAP(model, ([-1.0], [1.0]), window=5)
    y = [0.0, 0.7, 1.4, 2.1]
    for k in range(4):
        filter.update([y[k]])
        if k < 3:
            filter.predict(Orthotope([-1.0], [1.0]))
    np.testing.assert_allclose([filter.rho, filter.r], 0.0, atol=1e-8)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"window": 0}, "window must be at least 1"),
        ({"objective": "mean"}, '"sum" or "log"'),
        ({"point": "middle"}, '"centre" or "vertex"'),
        ({"kappa": 0.0}, "kappa must be a number > 0"),
        ({"rho_range": (1.0, 0.5)}, "rho_range must hold"),
        ({"r_range": (0.0, [1.0, 2.0, 3.0])}, "r_range must be a pair"),
    ],
)
def test_a_wrong_option_is_named(options: dict[str, object], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        WindowMAP(P3, PRIOR, **options)  # type: ignore[arg-type]


@pytest.mark.soak
def test_no_program_stays_unsolved() -> None:
    """1e5 steps over random models, windows from 3 to 50, up to half of the outputs missing."""
    done = 0
    for seed in range(100_000):
        rng = np.random.default_rng(seed)
        n, m, p = int(rng.integers(1, 6)), int(rng.integers(1, 4)), int(rng.integers(0, 3))
        A = rng.normal(size=(n, n))
        A *= rng.uniform(0.3, 1.05) / np.abs(np.linalg.eigvals(A)).max()
        size = 10.0 ** rng.integers(-3, 4)
        limit = size * rng.uniform(0.5, 5.0)
        box = (np.full(n, -limit), np.full(n, limit)) if rng.random() < 0.5 else None
        rho = size * rng.random(n) * rng.integers(0, 2, n)
        model = LSUModel(
            A, rng.normal(size=(n, p)) if p else None, rng.normal(size=(m, n)), rho, size * rng.random(m), domain=box
        )
        unknown = [["A", 1, 1, A[0, 0] - 0.3, A[0, 0] + 0.3]] if rng.random() < 0.3 else []
        unknown += [["E", 1, 2, -1.0, 1.0]] if n > 1 and rng.random() < 0.4 else []
        data = simulate(model, 120, seed, inputs=size * rng.normal(size=(120, p)))
        Y = np.where(rng.random(data.Y.shape) < rng.uniform(0.0, 0.5), np.nan, data.Y)
        window = int(rng.integers(3, 51))
        filter = WindowMAP(model, Orthotope([-10 * size] * n, [10 * size] * n), window=window, unknown=unknown)
        run_filter(filter, Y, data.U)  # raises where a program stays unsolved
        done += len(Y)
        if done >= 100_000:
            break
    assert done >= 100_000
