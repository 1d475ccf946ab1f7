"""Data at their own moments, in the library: no set misses the exact truth, and no true datum is contradicted."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pytest
from exact_course import SECOND, Scene, inside, scene

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    Filter,
    FilterBank,
    InconsistentData,
    LSUModel,
    ModelError,
    Orthotope,
    WindowMAP,
    ZonotopicKalman,
    run_filter,
    simulate,
)
from lsu_mesh.filters.grid import step_of
from lsu_mesh.filters.held_inputs import HeldInputs
from lsu_mesh.filters.timed_data import TimedDatum, bring, contradicting, cut

MADE = (LSUO, LSUP, LSUPB, LSUCZ)
SEEDS = 100
CLOCK_NS = 5_000_000


@functools.cache
def car(seed: int, clock_ns: int = 0) -> Scene:
    """20 m/s, reports ± .5 m, .15 to .5 s apart."""
    return scene(seed, 20.0, 2.0, 0.5, (0.15, 0.5), 20, clock_ns)


@functools.cache
def ferry(seed: int, clock_ns: int = 0) -> Scene:
    """8 m/s, reports ± 3 m, 2 to 10 s apart."""
    return scene(seed, 8.0, 0.05, 3.0, (2.0, 10.0), 20, clock_ns)


def count_outside(made: type[Filter], drawn: Scene, time_error: int = 0) -> int:
    """Rows whose box misses the exact truth of the row's moment; −1 stands for a contradiction."""
    filter = made(drawn.flow.discretised(SECOND), drawn.prior)  # type: ignore[call-arg]
    try:
        run = run_filter(filter, drawn.Y, times=drawn.times, time_errors=time_error)
    except InconsistentData:
        return -1
    truth = [drawn.course.at(time) for time in drawn.times]
    return sum(not inside(low, high, x) for low, high, x in zip(run.lower, run.upper, truth, strict=True))


@pytest.mark.parametrize("made", MADE)
@pytest.mark.parametrize("draw", [car, ferry])
def test_sets_at_the_reports_moments_hold_the_truth(draw: Callable[[int, int], Scene], made: type[Filter]) -> None:
    assert [count_outside(made, draw(seed, 0)) for seed in range(SEEDS)] == [0] * SEEDS


@pytest.mark.parametrize("made", MADE)
@pytest.mark.parametrize("draw", [car, ferry])
def test_a_stated_clock_error_is_paid_for(draw: Callable[[int, int], Scene], made: type[Filter]) -> None:
    assert [count_outside(made, draw(seed, CLOCK_NS), CLOCK_NS) for seed in range(SEEDS)] == [0] * SEEDS


@pytest.mark.parametrize("draw", [car, ferry])
def test_an_unstated_clock_error_costs_truth(draw: Callable[[int, int], Scene]) -> None:
    """No filter can promise to notice it: the numbers are printed."""
    outcomes = [count_outside(LSUO, draw(seed, CLOCK_NS)) for seed in range(SEEDS)]
    contradictions, missed = outcomes.count(-1), sum(max(0, outcome) for outcome in outcomes)
    print(f"{draw.__name__}: clocks off by 5 ms, not said: {missed} sets miss, {contradictions} of {SEEDS} contradict")
    assert draw is ferry or missed + contradictions > 0


@pytest.mark.parametrize("made", MADE)
@pytest.mark.parametrize(("draw", "dt_ns"), [(car, SECOND // 10), (ferry, 2 * SECOND)])
def test_sets_on_the_grid_hold_the_truth(draw: Callable[[int, int], Scene], dt_ns: int, made: type[Filter]) -> None:
    """Events of a step in order: from the posterior of k − 1 to each datum, then to t_k."""
    for seed in range(SEEDS // 4):
        drawn = draw(seed, CLOCK_NS if seed % 2 else 0)
        error = CLOCK_NS if seed % 2 else 0
        start, inputs = drawn.times[0], HeldInputs.constant()
        filter = made(drawn.flow.discretised(dt_ns), drawn.prior)  # type: ignore[call-arg]
        steps: dict[int, list[TimedDatum]] = {}
        for time, y in zip(drawn.times, drawn.Y, strict=True):
            steps.setdefault(step_of(time, start, dt_ns), []).append(TimedDatum(time, y, error))
        cut(filter, drawn.flow, steps[0][0], inputs)
        for k in range(1, max(steps)):
            now, then = start + k * dt_ns, start + (k - 1) * dt_ns
            data = steps.get(k, [])
            assert contradicting(filter, drawn.flow, data, then, inputs) == []
            assert bring(filter, drawn.flow, [d for d in data if d.time_ns < now], then, now, inputs) == []
            for datum in (d for d in data if d.time_ns == now):
                assert cut(filter, drawn.flow, datum, inputs)
            assert inside(*filter.bounds(), drawn.course.at(now)), (seed, k)


def test_the_order_of_arrival_is_nothing() -> None:
    drawn = car(3)
    inputs, data = (
        HeldInputs.constant(),
        [TimedDatum(t, y) for t, y in zip(drawn.times[1:6], drawn.Y[1:6], strict=True)],
    )
    ends = []
    for shuffled in (data, data[::-1], [data[i] for i in (2, 0, 4, 1, 3)]):
        filter = LSUPB(drawn.flow.discretised(SECOND), drawn.prior)
        bring(filter, drawn.flow, shuffled, drawn.times[0], drawn.times[6], inputs)
        ends.append(np.array(filter.bounds()))
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


def test_a_false_datum_is_named_and_the_filter_is_where_it_was() -> None:
    drawn, inputs = car(1), HeldInputs.constant()
    filter = LSUO(drawn.flow.discretised(SECOND), drawn.prior)
    before = np.array(filter.bounds())
    wrong = TimedDatum(drawn.times[1], drawn.Y[1] + 100.0, sensor="gps")
    data = [wrong, TimedDatum(drawn.times[2], drawn.Y[2])]
    assert contradicting(filter, drawn.flow, data, drawn.times[0], inputs) == [(wrong, (0,))]
    with pytest.raises(InconsistentData, match=f"gps at {drawn.times[1]} ns"):
        bring(filter, drawn.flow, data, drawn.times[0], drawn.times[3], inputs)
    np.testing.assert_array_equal(filter.bounds(), before)


def test_rows_at_one_time_and_times_on_the_grid_are_the_plain_steps() -> None:
    drawn = car(2)
    step = drawn.flow.discretised(SECOND // 10)
    Y = drawn.Y[:1] + 2.0 * np.arange(10)[:, None]
    plain = run_filter(LSUO(step, drawn.prior), Y)
    timed = run_filter(LSUO(step, drawn.prior), Y, times=[7 + k * SECOND // 10 for k in range(10)])
    np.testing.assert_array_equal(plain.lower, timed.lower)
    np.testing.assert_array_equal(plain.y_upper, timed.y_upper)
    stamps = np.array(["2026-01-01T00:00:00.1", "2026-01-01T00:00:00.2"], dtype="datetime64[ms]")
    dated = run_filter(LSUO(step, drawn.prior), Y[:2], times=stamps)
    np.testing.assert_array_equal(dated.lower, plain.lower[:2])
    twice = LSUO(step, drawn.prior)
    run_filter(twice, Y[[0, 0]], times=[5, 5])
    assert (twice.bounds()[1] <= plain.upper[0]).all()


@pytest.mark.parametrize("made", [*MADE, ZonotopicKalman])
def test_models_of_one_row_each(made: type[Filter]) -> None:
    """A step's own A, B, a, N, rho, C, D, d and r; the truth is exact in dyadic numbers."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        models, Y, U, x = [], [], [], np.array([0.0, 0.0])
        truth = []
        for _ in range(8):
            A, B, a = rng.integers(-2, 3, (2, 2)) / 2.0, rng.integers(-1, 2, (2, 1)) / 2.0, rng.integers(-2, 3, 2) / 2.0
            C, D, d = rng.integers(-2, 3, (1, 2)) / 2.0, rng.integers(-2, 3, (1, 1)) / 2.0, rng.integers(-2, 3, 1) / 2.0
            u, w = rng.integers(-2, 3, 1) / 2.0, rng.choice([-0.5, 0.5], 2)
            models.append(LSUModel(A, B, C, 0.5, 0.25, D=D, a=a, d=d))
            Y.append(C @ x + D @ u + d + rng.choice([-0.25, 0.25], 1))
            U.append(u)
            truth.append(x)
            x = A @ x + B @ u + a + w
        filter = made(models[0], Orthotope([-1.0, -1.0], [1.0, 1.0]))  # type: ignore[call-arg]
        run = run_filter(filter, Y, U, models=models)
        assert (run.lower <= truth).all()
        assert (truth <= run.upper).all()
        assert (run.y_lower <= Y).all()
        assert (run.y_upper >= Y).all()


def test_a_discrete_model_refuses_what_is_off_its_grid() -> None:
    model = LSUModel([[1.0]], None, [[1.0]], [0.1], [0.05])
    Y, times = np.zeros((3, 1)), [0, SECOND, 2 * SECOND + 300_000_000]

    def run(**options: object) -> np.ndarray:
        return run_filter(LSUO(model, Orthotope([-5.0], [5.0])), Y, times=times, dt_ns=SECOND, **options).upper  # type: ignore[arg-type]

    with pytest.raises(ModelError, match=r"row 2 .*off the grid: a datum at 2300000000 ns .* step at 3000000000 ns"):
        run()
    assert run(rate=0.2)[-1, 0] == pytest.approx(min(0.05 + 0.2 * 0.7, 0.05 + 0.2))
    nearest = run_filter(LSUO(model, Orthotope([-5.0], [5.0])), Y, times=times, dt_ns=SECOND, off_grid="nearest")
    assert nearest.guarantee == "none"
    assert nearest.upper[-1, 0] == pytest.approx(0.05)
    with pytest.raises(ModelError, match="give dt_ns"):
        run_filter(LSUO(model, Orthotope([-5.0], [5.0])), Y, times=times)


def test_what_does_not_fit_is_named() -> None:
    drawn = car(0)
    filter = LSUO(drawn.flow.discretised(SECOND), drawn.prior)
    Y = drawn.Y[:3]
    with pytest.raises(ModelError, match="times must be whole numbers of nanoseconds"):
        run_filter(filter, Y, times=[0.0, 0.1, 0.2])
    with pytest.raises(ModelError, match="must not decrease: row 1 is at 5 ns, row 2 at 4 ns"):
        run_filter(filter, Y, times=[0, 5, 4])
    with pytest.raises(ModelError, match="times must have 3 entries"):
        run_filter(filter, Y, times=[0, 5])
    with pytest.raises(ModelError, match="time_errors must be whole nanoseconds"):
        run_filter(filter, Y, times=[0, 5, 6], time_errors=[-1, 0, 0])
    with pytest.raises(ModelError, match="models must have 3 entries"):
        run_filter(filter, Y, models=[drawn.flow.discretised(5)])
    with pytest.raises(ModelError, match="needs times"):
        run_filter(filter, Y, models=[drawn.flow] * 3)
    with pytest.raises(ModelError, match="time_errors, dt_ns and rate need times"):
        run_filter(filter, Y, dt_ns=5)
    with pytest.raises(ModelError, match=r"a bank knows no radii \(a continuous model\)"):
        FilterBank(LSUO, drawn.flow.discretised(SECOND), [drawn.prior] * 2)
    bank = FilterBank(LSUO, LSUModel([[1.0]], None, [[1.0]], 0.1, 0.1), [Orthotope([0.0], [1.0])] * 2)
    with pytest.raises(ModelError, match="a bank knows no times and no models of one row"):
        bank.run(np.zeros((2, 3, 1)), times=[0, 1, 2])
    with pytest.raises(ModelError, match="the window estimators know no radii"):
        WindowMAP(drawn.flow.discretised(SECOND), drawn.prior)


@pytest.mark.parametrize("made", [*MADE, ZonotopicKalman])
def test_simulated_continuous_plants_are_in_the_sets(made: type[Filter]) -> None:
    """An oscillator with input, offset and feedthrough; the sensor looks between the steps."""
    flow = LSUModel.continuous(
        [[0.0, 1.0], [-9.0, -0.2]], [[0.0], [1.0]], [[1.0, 0.0]], [0.5], [0.02], [[0.0], [1.0]],
        D=[[0.1]], a=[0.0, 0.3], d=[0.05],
    )  # fmt: skip
    dt = SECOND // 20
    for seed in range(10):
        run = simulate(flow, 60, seed, x1=[0.3, 0.0], noise="corners", dt_ns=dt)
        rng = np.random.default_rng(seed)
        times = sorted(int(t) for t in rng.integers(dt, 60 * dt, 40))
        filter = made(flow.discretised(dt), Orthotope([0.2, -0.1], [0.4, 0.1]))  # type: ignore[call-arg]
        now, inputs = dt, HeldInputs([k * dt for k in range(1, 61)], list(run.U))
        for time in times:
            x = run.truth_at(time)
            y = [float(x[0] + 0.1 * run.input_at(time)[0] + 0.05 + 0.0199999 * rng.choice([-1, 1]))]
            bring(filter, flow, [], now, time, inputs)
            assert cut(filter, flow, TimedDatum(time, np.array(y)), inputs)
            assert (filter.bounds()[0] <= x).all()
            assert (x <= filter.bounds()[1]).all()
            now = time
