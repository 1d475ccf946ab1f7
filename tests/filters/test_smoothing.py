"""Fixed-lag smoothing: the sets of earlier states given all data, beside the program over all of them at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh import LSUCZ, InconsistentData, LSUModel, ModelError, Orthotope, Simulation, simulate, systems
from lsu_mesh.array_types import Vector

S2 = systems.get("S2", 0.01, 0.1)
PRIOR = Orthotope([-5.0, -5.0], [5.0, 5.0])


def batch_bounds(model: LSUModel, data: Simulation, k: int, j: int) -> tuple[Vector, Vector]:
    """Bounds of x_j (row j) given the rows 0 … k of Y, by one linear program over all states for each side."""
    n, size = model.state_count, (k + 1) * model.state_count
    rows, sides = [], []
    for t in range(k + 1):
        for C, y, r in zip(model.C, data.Y[t], model.r, strict=True):
            row = np.zeros(size)
            row[t * n : (t + 1) * n] = C
            rows += [row, -row]
            sides += [y + r, r - y]
    for t in range(k):
        for i in range(n):
            row = np.zeros(size)
            row[t * n : (t + 1) * n] = -model.A[i]
            row[(t + 1) * n + i] = 1.0
            drive = float(model.B[i] @ data.U[t])
            rows += [row, -row]
            sides += [drive + model.rho[i], model.rho[i] - drive]
    limits = [(-5.0, 5.0)] * n + [(None, None)] * (size - n)
    found = []
    for i in range(n):
        for sign in (1.0, -1.0):
            aim = np.zeros(size)
            aim[j * n + i] = sign
            solved = linprog(aim, A_ub=np.array(rows), b_ub=sides, bounds=limits, method="highs")
            found.append(sign * solved.fun)
    sides_found = np.array(found).reshape(n, 2)
    return sides_found[:, 0], sides_found[:, 1]


@pytest.mark.parametrize("lag", [1, 5])
def test_without_reduction_the_sets_are_those_of_the_batch_program(lag: int) -> None:
    data = simulate(S2, 24, seed=1)
    filter = LSUCZ(S2, PRIOR, reduce=False, lag=lag)
    for k in range(24):
        filter.update(data.Y[k])
        for place in range(min(k, lag) + 1):
            if k in (2, 9, 16):
                lower, upper = filter.smoothed_bounds(place)
                expected = batch_bounds(S2, data, k, k - place)
                np.testing.assert_allclose((lower, upper), expected, rtol=0.0, atol=1e-9)
        if k < 23:
            filter.predict(data.U[k])


def _mean_widths(lag: int, data: Simulation, **options: object) -> tuple[Vector, Vector]:
    """Mean widths of the newest states and of those ``lag`` steps back, from row 8 on."""
    filter = LSUCZ(S2, PRIOR, lag=lag, **options)  # type: ignore[arg-type]
    now, before = [], []
    for k in range(len(data.Y)):
        filter.update(data.Y[k])
        if k >= 8 + lag:
            now.append(np.subtract(*reversed(filter.bounds())))
            before.append(np.subtract(*reversed(filter.smoothed_bounds(lag))))
        filter.predict(data.U[k])
    return np.mean(now, axis=0), np.mean(before, axis=0)


@pytest.mark.parametrize("lag", [1, 5])
def test_the_limits_of_complexity_cost_little(lag: int) -> None:
    for seed in range(3):
        data = simulate(S2, 30, seed=seed)
        now, exact = _mean_widths(lag, data, reduce=False)
        _, limited = _mean_widths(lag, data, max_generators=40, max_constraints=16)
        assert (exact < 0.9 * now).all(), "later data tell of earlier states"
        assert (limited <= 1.05 * exact).all()
        assert (limited >= exact - 1e-9).all()


@pytest.mark.parametrize("options", [{}, {"max_generators": 16, "max_constraints": 3}])
@pytest.mark.parametrize("name", ["S2", "P3"])
def test_truth_is_in_every_smoothed_set(name: str, options: dict[str, int]) -> None:
    model = systems.get(name)
    data = simulate(model, 120, seed=4)
    n = model.state_count
    filter = LSUCZ(model, Orthotope([-5.0] * n, [5.0] * n), lag=4, **options)
    for k in range(120):
        filter.update(data.Y[k])
        for place in range(min(k, 4) + 1):
            lower, upper = filter.smoothed_bounds(place)
            assert ((lower <= data.X[k - place]) & (data.X[k - place] <= upper)).all()
            assert filter.smoothed(place).contains(data.X[k - place])
        filter.predict(data.U[k])


@pytest.mark.soak
def test_truth_is_in_a_million_smoothed_sets() -> None:
    sets, lag, rng = 0, 5, np.random.default_rng(0)
    while sets < 10**6:
        model = systems.get(str(rng.choice(["S1", "S2", "S3", "P3"])), *rng.uniform(0.01, 0.3, 2))
        data = simulate(model, 500, seed=int(rng.integers(2**31)))
        n = model.state_count
        filter = LSUCZ(model, Orthotope([-5.0] * n, [5.0] * n), max_generators=n * 6 + 8, lag=lag)
        for k in range(500):
            filter.update(data.Y[k])
            for place in range(min(k, lag) + 1):
                lower, upper = filter.smoothed_bounds(place)
                assert ((lower <= data.X[k - place]) & (data.X[k - place] <= upper)).all()
                sets += 1
            filter.predict(data.U[k])


@pytest.mark.parametrize("name", ["S2", "P3"])
def test_late_data_within_the_lag_give_the_sets_of_data_in_order(name: str) -> None:
    model = systems.get(name)
    data = simulate(model, 14, seed=2)
    n = model.state_count
    prior = Orthotope([-5.0] * n, [5.0] * n)
    ordered, late = (LSUCZ(model, prior, reduce=False, lag=3) for _ in range(2))
    waiting: list[tuple[int, int]] = []
    for k in range(14):
        ordered.update(data.Y[k])
        if k % 3 == 1:
            waiting.append((k, k + 1 + k % 2))
        else:
            late.update(data.Y[k])
        for row, due in list(waiting):
            if due == k:
                late.update_late(data.Y[row], k - row)
                waiting.remove((row, due))
        if not waiting:
            for place in range(min(k, 3) + 1):
                np.testing.assert_allclose(
                    late.smoothed_bounds(place), ordered.smoothed_bounds(place), rtol=0.0, atol=1e-9
                )
        for filter in (ordered, late):
            filter.predict(data.U[k])


def test_transfers_and_the_domain_tighten_earlier_states_and_lose_nothing() -> None:
    model = S2.replace(domain=Orthotope([-50.0, -1.0], [50.0, 1.0]))
    data = simulate(model, 40, seed=7)
    filter = LSUCZ(model, PRIOR, max_generators=30, max_constraints=10, lag=3)
    for k in range(40):
        before = [np.subtract(*reversed(filter.smoothed_bounds(place))) for place in range(min(k, 3) + 1)]
        filter.condition(Orthotope(data.X[k] - 0.15, data.X[k] + 0.15))
        filter.update(data.Y[k])
        for place, widths in enumerate(before):
            lower, upper = filter.smoothed_bounds(place)
            assert ((lower <= data.X[k - place]) & (data.X[k - place] <= upper)).all()
            assert (upper - lower <= widths).all()
        filter.predict(data.U[k])


def test_a_filter_with_a_lag_goes_back_to_a_snapshot() -> None:
    data = simulate(S2, 20, seed=3)
    filter = LSUCZ(S2, PRIOR, lag=2)
    assert not filter.is_resumable
    for k in range(10):
        filter.update(data.Y[k])
        filter.predict(data.U[k])
    snapshot, found = filter.snapshot(), []
    for _ in range(2):
        filter.restore(snapshot)
        for k in range(10, 15):
            filter.update(data.Y[k])
            filter.predict(data.U[k])
        found.append([filter.smoothed_bounds(place) for place in range(3)])
    np.testing.assert_array_equal(found[0], found[1])


def test_what_does_not_fit_is_said() -> None:
    with pytest.raises(ModelError, match="lag must not be negative, it is -1"):
        LSUCZ(S2, PRIOR, lag=-1)
    with pytest.raises(ModelError, match="max_generators must be at least 8, the states of 4 steps, it is 7"):
        LSUCZ(S2, PRIOR, max_generators=7, lag=3)
    filter = LSUCZ(S2, PRIOR, lag=2)
    with pytest.raises(ModelError, match="the set of 1 steps ago is not held: the lag is 2, 0 steps are there"):
        filter.smoothed(1)
    filter.update([0.0])
    filter.predict([0.0])
    with pytest.raises(InconsistentData):
        filter.update_late([100.0], 1)
    with pytest.raises(ModelError, match="the set of 2 steps ago"):
        filter.update_late([0.0], 2)
