"""Whole runs and banks give the bits of single steps, and say where the data contradict the bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    FilterBank,
    InconsistentData,
    LSUModel,
    ModelError,
    Orthotope,
    UnboundedSupport,
    run_filter,
    simulate,
    systems,
)
from lsu_mesh.filters.compiled import CompiledFilter
from lsu_mesh.filters.filter import Filter

PRIOR = Orthotope([-1.0] * 3, [1.0] * 3)
MODEL = systems.get("P3").replace(domain=([-6.0] * 3, [6.0] * 3))
COMPILED: dict[str, Callable[[LSUModel], CompiledFilter]] = {
    "LSUO": lambda model: LSUO(model, PRIOR),
    "LSUO without meet": lambda model: LSUO(model, PRIOR, meet=False),
    "LSUP image": lambda model: LSUP(model, PRIOR),
    "LSUP cgz": lambda model: LSUP(model, PRIOR, time_update="cgz"),
    "LSUP edges": lambda model: LSUP(model, PRIOR, time_update="edges"),
    "LSUP strips": lambda model: LSUP(model, PRIOR, time_update="strips"),
    "LSUPB": lambda model: LSUPB(model, PRIOR),
}
ALL: dict[str, Callable[[LSUModel], Filter]] = {
    **COMPILED,
    "LSUO lp": lambda model: LSUO(model, PRIOR, hull="lp"),
    "LSUCZ": lambda model: LSUCZ(model, PRIOR),
}


@pytest.fixture(scope="module")
def data() -> tuple[np.ndarray, np.ndarray]:
    made = simulate(MODEL, 60, seed=4)
    Y = made.Y.copy()
    Y[5] = np.nan
    Y[9, 1] = np.nan
    return Y, made.U


@pytest.mark.parametrize("make", ALL.values(), ids=ALL.keys())
def test_a_run_has_the_bits_of_its_steps(
    make: Callable[[LSUModel], Filter], data: tuple[np.ndarray, np.ndarray]
) -> None:
    Y, U = data
    whole, stepped = make(MODEL), make(MODEL)
    run = run_filter(whole, Y, U)
    for k in range(len(Y)):
        prediction = stepped.predict_output()
        np.testing.assert_array_equal(prediction.lower, run.y_lower[k])
        np.testing.assert_array_equal(prediction.upper, run.y_upper[k])
        np.testing.assert_array_equal(prediction.point, run.y_points[k])
        stepped.update(Y[k])
        np.testing.assert_array_equal(stepped.point, run.points[k])
        np.testing.assert_array_equal(stepped.bounds(), (run.lower[k], run.upper[k]))
        assert stepped.volume() == run.volumes[k]
        if k + 1 < len(Y):
            stepped.predict(U[k])
    np.testing.assert_array_equal(whole.bounds(), stepped.bounds())
    whole.predict(U[-1])
    stepped.predict(U[-1])
    np.testing.assert_array_equal(whole.bounds(), stepped.bounds())


@pytest.mark.parametrize("make", ALL.values(), ids=ALL.keys())
def test_a_contradiction_names_its_row_and_leaves_the_filter_before_it(
    make: Callable[[LSUModel], Filter], data: tuple[np.ndarray, np.ndarray]
) -> None:
    Y, U = data[0].copy(), data[1]
    Y[7, 1] += 50.0
    filter, reference = make(MODEL), make(MODEL)
    with pytest.raises(InconsistentData, match=r"row 7 \(step 8\).*y2") as caught:
        run_filter(filter, Y, U)
    assert caught.value.rows == (1,)
    assert 40.0 < caught.value.gap < 51.0
    run_filter(reference, Y[:7], U[:7])
    reference.predict(U[6])
    np.testing.assert_array_equal(filter.bounds(), reference.bounds())


@pytest.mark.parametrize("make", ALL.values(), ids=ALL.keys())
def test_a_prediction_outside_the_domain_is_a_contradiction(make: Callable[[LSUModel], Filter]) -> None:
    filter = make(MODEL)
    U = np.zeros((5, 1))
    U[2] = 1000.0
    with pytest.raises(InconsistentData, match=r"row 2 \(step 3\).*domain"):
        run_filter(filter, np.full((5, 2), np.nan), U)
    reference = make(MODEL)
    run_filter(reference, np.full((3, 2), np.nan), U[:3])
    np.testing.assert_array_equal(filter.bounds(), reference.bounds())


@pytest.mark.parametrize("make", COMPILED.values(), ids=COMPILED.keys())
def test_a_set_that_outgrows_double_precision_is_said_to(make: Callable[[LSUModel], CompiledFilter]) -> None:
    model = LSUModel(np.eye(3) * 1e200, None, np.eye(3)[:1], 1.0, 1.0)
    with pytest.raises(UnboundedSupport, match="row 1"):
        run_filter(make(model), np.full((6, 1), np.nan))


def test_shapes_are_checked() -> None:
    filter = LSUO(MODEL, PRIOR)
    with pytest.raises(ModelError, match=r"Y must have shape \(steps, 2\)"):
        run_filter(filter, np.zeros((5, 3)), np.zeros((5, 1)))
    with pytest.raises(ModelError, match=r"1 input\(s\)"):
        run_filter(filter, np.zeros((5, 2)))
    with pytest.raises(ModelError, match="U must have 5 rows"):
        run_filter(filter, np.zeros((5, 2)), np.zeros((3, 1)))
    with pytest.raises(ModelError, match="finite or NaN"):
        run_filter(filter, np.full((5, 2), np.inf), np.zeros((5, 1)))
    with pytest.raises(ModelError, match="finite"):
        run_filter(filter, np.zeros((5, 2)), np.full((5, 1), np.nan))


def test_the_last_input_is_not_used(data: tuple[np.ndarray, np.ndarray]) -> None:
    Y, U = data
    short, full = LSUO(MODEL, PRIOR), LSUO(MODEL, PRIOR)
    run_filter(short, Y, U[:-1])
    run_filter(full, Y, np.vstack([U[:-1], [[np.nan]]]))
    np.testing.assert_array_equal(short.bounds(), full.bounds())


@pytest.mark.parametrize("kind", [LSUO, LSUP, LSUPB])
@pytest.mark.parametrize("threads", [1, 2])
def test_a_bank_has_the_bits_of_single_filters(kind: type[CompiledFilter], threads: int) -> None:
    count = 150
    rng = np.random.default_rng(0)
    models = [MODEL.replace(rho=MODEL.rho * rng.uniform(0.5, 1.5), r=MODEL.r) for _ in range(count)]
    runs = [simulate(model, 12, seed=i) for i, model in enumerate(models)]
    Y, U = np.array([run.Y for run in runs]), np.array([run.U for run in runs])
    Y[3, 4] = np.nan
    bank = FilterBank(kind, models, PRIOR, threads=threads)
    record, done = bank.run(Y, U)
    assert (done == 12).all()
    stepped = FilterBank(kind, models, PRIOR, threads=threads)
    for k in range(12):
        assert stepped.update(Y[:, k]).all()
        if k < 11:
            assert stepped.predict(U[:, k]).all()
    np.testing.assert_array_equal(stepped.bounds(), bank.bounds())
    for i in (0, 3, 77, 149):
        single = kind(models[i], PRIOR)  # type: ignore[call-arg]
        run = run_filter(single, Y[i], U[i])
        for name, table in run._asdict().items():
            np.testing.assert_array_equal(getattr(record, name)[i], table)
        np.testing.assert_array_equal(single.point, bank.points[i])
        np.testing.assert_array_equal(single.support.center, bank.support(i).center)


def test_one_contradiction_does_not_stop_a_bank() -> None:
    runs = [simulate(MODEL, 8, seed=i) for i in range(4)]
    Y, U = np.array([run.Y for run in runs]), np.array([run.U for run in runs])
    Y[2, 5] += 100.0
    record, done = FilterBank(LSUO, MODEL, [PRIOR] * 4).run(Y, U)
    np.testing.assert_array_equal(done, [8, 8, 5, 8])
    assert np.isnan(record.lower[2, 5:]).all()
    assert np.isfinite(record.lower[2, :5]).all()
    bank = FilterBank(LSUO, MODEL, [PRIOR] * 4)
    before = bank.bounds()[0][2]
    assert bank.update(np.where(np.arange(4)[:, None] == 2, 100.0, Y[:, 0])).tolist() == [True, True, False, True]
    np.testing.assert_array_equal(bank.bounds()[0][2], before)


@pytest.mark.parametrize("kind", [LSUO, LSUP, LSUPB])
def test_a_masked_entry_of_a_bank_is_missing(kind: type[CompiledFilter]) -> None:
    runs = [simulate(MODEL, 8, seed=seed) for seed in range(3)]
    Y, U = np.array([run.Y for run in runs]), np.array([run.U for run in runs])
    mask = np.zeros(Y.shape, dtype=bool)
    mask[1, 3], mask[2, 5, 0] = True, True
    masked, missing = np.ma.array(np.where(mask, 99.0, Y), mask=mask), np.where(mask, np.nan, Y)
    record, done = FilterBank(kind, MODEL, [PRIOR] * 3).run(masked, U)
    expected, _ = FilterBank(kind, MODEL, [PRIOR] * 3).run(missing, U)
    assert (done == 8).all()
    np.testing.assert_array_equal(record.upper, expected.upper)
    stepped = FilterBank(kind, MODEL, [PRIOR] * 3)
    assert stepped.update(masked[:, 3]).all()
    other = FilterBank(kind, MODEL, [PRIOR] * 3)
    assert other.update(missing[:, 3]).all()
    np.testing.assert_array_equal(stepped.bounds(), other.bounds())


def test_banks_say_what_does_not_fit() -> None:
    with pytest.raises(ModelError, match="U must hold finite numbers only"):
        FilterBank(LSUO, MODEL, [PRIOR] * 2).run(np.zeros((2, 3, 2)), np.full((2, 3, 1), np.nan))
    with pytest.raises(ModelError, match="U must hold finite numbers only"):
        FilterBank(LSUO, MODEL, [PRIOR] * 2).predict(np.full((2, 1), np.inf))
    with pytest.raises(ModelError, match=r"Y must be finite or NaN \(missing\)"):
        FilterBank(LSUO, MODEL, [PRIOR] * 2).update(np.full((2, 2), np.inf))
    with pytest.raises(ModelError, match="3 models and 2 priors"):
        FilterBank(LSUO, [MODEL] * 3, [PRIOR] * 2)
    with pytest.raises(ModelError, match="3 coordinates, one per state, it has 2"):
        FilterBank(LSUO, systems.get("P3"), [Orthotope([0.0] * 3, [1.0] * 3), Orthotope([0.0] * 2, [1.0] * 2)])
    with pytest.raises(ModelError, match="equal shapes"):
        FilterBank(LSUO, [MODEL, systems.get("S1")], PRIOR)
    with pytest.raises(ModelError, match="no compiled bank"):
        FilterBank(LSUO, MODEL, [PRIOR] * 2, hull="lp")
    with pytest.raises(ModelError, match=r"Y must have shape \(2, 2\)"):
        FilterBank(LSUO, MODEL, [PRIOR] * 2).update(np.zeros((3, 2)))
