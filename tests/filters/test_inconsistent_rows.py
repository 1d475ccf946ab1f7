"""A run bears masked entries, rows that contradict the set, and volumes that nobody asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUPB,
    InconsistentData,
    LSUModel,
    ModelError,
    Orthotope,
    UnboundedSupport,
    run_filter,
    simulate,
    systems,
)
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.inconsistent_rows import OnInconsistency
from lsu_mesh.filters.zonotopic_kalman import ZonotopicKalman
from lsu_mesh.simulation import Simulation

PRIOR = Orthotope([-1.0] * 3, [1.0] * 3)
MODEL = systems.get("P3").replace(domain=([-60.0] * 3, [60.0] * 3))
MADE: dict[str, Callable[[LSUModel], Filter]] = {
    "LSUPB": lambda model: LSUPB(model, PRIOR),
    "LSUO": lambda model: LSUO(model, PRIOR),
    "LSUCZ": lambda model: LSUCZ(model, PRIOR),
    "ZonotopicKalman": lambda model: ZonotopicKalman(model, PRIOR),
}
BAD = (0, 7, 8, 19)


@pytest.fixture(scope="module")
def data() -> Simulation:
    return simulate(MODEL, 20, seed=4)


def spoilt(data: Simulation) -> np.ndarray:
    Y = data.Y.copy()
    Y[list(BAD), 1] += 50.0
    return Y


@pytest.mark.parametrize("make", MADE.values(), ids=MADE.keys())
def test_a_masked_entry_is_missing(make: Callable[[LSUModel], Filter], data: Simulation) -> None:
    mask = np.zeros(data.Y.shape, dtype=bool)
    mask[3], mask[9, 1] = True, True
    wild = np.where(mask, 1e9, data.Y)
    missing = run_filter(make(MODEL), np.where(mask, np.nan, data.Y), data.U)
    for given in (np.ma.array(wild, mask=mask), list(np.ma.array(wild, mask=mask))):
        run = run_filter(make(MODEL), given, data.U)
        np.testing.assert_array_equal(run.lower, missing.lower)
        assert [k for k, status in enumerate(run.status) if status == "missing"] == [3]
    one, other = make(MODEL), make(MODEL)
    one.update(np.ma.array([1e9, 0.0], mask=[True, False]))
    other.update([np.nan, 0.0])
    np.testing.assert_array_equal(one.bounds(), other.bounds())


@pytest.mark.parametrize("wrong", ["text", [["1", "2"]] * 20, [[1.0, 2.0], [1.0]], [[1j, 2.0]] * 20, [[[], {}]] * 20])
def test_what_is_no_number_is_refused_by_name(wrong: object, data: Simulation) -> None:
    with pytest.raises(ModelError, match="Y must hold real numbers"):
        run_filter(LSUPB(MODEL, PRIOR), wrong, data.U)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="U must hold real numbers"):
        run_filter(LSUPB(MODEL, PRIOR), data.Y, wrong)  # type: ignore[arg-type]
    filter = LSUPB(MODEL, PRIOR)
    with pytest.raises(ModelError, match="y must hold real numbers"):
        filter.update(wrong)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="r must hold real numbers"):
        filter.update(data.Y[0], wrong)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="u must hold real numbers"):
        filter.predict(wrong)  # type: ignore[arg-type]


def test_masked_inputs_and_half_widths_are_refused(data: Simulation) -> None:
    with pytest.raises(ModelError, match="U must hold finite numbers"):
        run_filter(LSUPB(MODEL, PRIOR), data.Y, np.ma.array(data.U, mask=True))
    with pytest.raises(ModelError, match="r must be finite"):
        LSUPB(MODEL, PRIOR).update(data.Y[0], np.ma.array([0.1, 0.1], mask=[True, False]))


@pytest.mark.parametrize("make", MADE.values(), ids=MADE.keys())
@pytest.mark.parametrize("choice", ["hold", "reset", "widen"])
def test_rows_that_contradict_do_not_lose_the_run(
    make: Callable[[LSUModel], Filter], choice: OnInconsistency, data: Simulation
) -> None:
    run = run_filter(make(MODEL), spoilt(data), data.U, on_inconsistency=choice)
    word = {"hold": "held", "reset": "reset", "widen": "widened"}[choice]
    assert [status for status in run.status if status != "ok"] == [word] * len(BAD) or choice == "reset"
    assert run.status[0] == run.status[7] == word
    assert run.guarantee == ("none" if choice == "widen" else "declared")
    assert np.isfinite(run.lower).all()
    assert np.isfinite(run.volumes).all()
    if choice == "hold":
        left_out = data.Y.copy()
        left_out[list(BAD)] = np.nan
        reference = run_filter(make(MODEL), left_out, data.U)
        for name, table in reference._asdict().items():
            np.testing.assert_array_equal(getattr(run, name), table, err_msg=name)
        assert (run.lower <= data.X).all()
        assert (run.upper >= data.X).all()


def test_widened_data_lie_at_the_edge_of_the_set() -> None:
    model = LSUModel([[1.0]], None, [[1.0]], 0.1, 0.5)
    run = run_filter(LSUO(model, ([-1.0], [1.0])), [[6.0]], on_inconsistency="widen")
    assert run.status == ["widened"]
    assert 0.0 <= run.upper[0, 0] - run.lower[0, 0] <= 0.11  # r = 5 and at most 1 % more explain 6 from [−1, 1]
    assert run.upper[0, 0] == 1.0
    exact = run_filter(LSUO(model.replace(r=0.0), ([-1.0], [1.0])), [[6.0]], on_inconsistency="widen")
    assert exact.status == ["held"]


@pytest.mark.parametrize("make", MADE.values(), ids=MADE.keys())
def test_a_prediction_outside_the_domain_starts_again_from_it(make: Callable[[LSUModel], Filter]) -> None:
    U = np.zeros((5, 1))
    U[2] = 1e4
    run = run_filter(make(MODEL), np.full((5, 2), np.nan), U, on_inconsistency="hold")
    assert run.status == ["missing", "missing", "missing", "reset", "missing"]
    np.testing.assert_array_equal(run.lower[3], [-60.0] * 3)


@pytest.mark.parametrize("make", MADE.values(), ids=MADE.keys())
def test_an_error_holds_the_rows_before_it(make: Callable[[LSUModel], Filter], data: Simulation) -> None:
    Y = data.Y.copy()
    Y[7, 1] += 50.0
    with pytest.raises(InconsistentData) as caught:
        run_filter(make(MODEL), Y, data.U)
    part = caught.value.run
    assert part is not None
    whole = run_filter(make(MODEL), data.Y, data.U)
    for name, table in whole._asdict().items():
        np.testing.assert_array_equal(getattr(part, name), table[:7], err_msg=name)
    assert part.status == ["ok"] * 7


def test_an_overflow_holds_the_rows_before_it() -> None:
    model = LSUModel(np.eye(3) * 1e200, None, np.eye(3)[:1], 1.0, 1.0)
    with pytest.raises(UnboundedSupport) as caught:
        run_filter(LSUCZ(model, PRIOR), np.full((6, 1), np.nan), on_inconsistency="hold")
    assert caught.value.run is not None
    assert len(caught.value.run.lower) == caught.value.run.done > 0


def test_models_and_times_follow_the_same_rules(data: Simulation) -> None:
    Y = spoilt(data)
    plain = run_filter(LSUCZ(MODEL, PRIOR), Y, data.U, on_inconsistency="hold")
    each = run_filter(LSUCZ(MODEL, PRIOR), Y, data.U, models=[MODEL] * 20, on_inconsistency="hold")
    grid = run_filter(LSUCZ(MODEL, PRIOR), Y, data.U, times=np.arange(20) * 10, dt_ns=10, on_inconsistency="hold")
    for run in (each, grid):
        np.testing.assert_array_equal(run.lower, plain.lower)
        assert run.status == plain.status


def test_the_options_are_checked(data: Simulation) -> None:
    with pytest.raises(ModelError, match='one of "raise", "hold", "reset", "widen", it is \'skip\''):
        run_filter(LSUPB(MODEL, PRIOR), data.Y, data.U, on_inconsistency="skip")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=r"model\.domain"):
        run_filter(LSUPB(systems.get("P3"), PRIOR), data.Y, data.U, on_inconsistency="reset")


def test_volumes_are_computed_when_they_are_read(data: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    own = LSUCZ.volume
    monkeypatch.setattr(LSUCZ, "volume", lambda self: asked.append(1) or own(self))  # type: ignore[func-returns-value]
    filter = LSUCZ(MODEL, PRIOR)
    run, never = run_filter(filter, data.Y, data.U), run_filter(LSUCZ(MODEL, PRIOR), data.Y, data.U, volumes=False)
    assert not asked
    after = filter.snapshot()
    filter.reset(PRIOR)
    stepped, expected = LSUCZ(MODEL, PRIOR), []
    for k, y in enumerate(data.Y):
        stepped.update(y)
        expected.append(own(stepped))
        stepped.predict(data.U[k])
    np.testing.assert_array_equal(run.volumes, expected)
    np.testing.assert_array_equal(run[3], expected)
    np.testing.assert_array_equal(filter.bounds(), PRIOR.bounds())  # the filter is as it was
    filter.restore(after)
    assert len(asked) == 20
    assert np.isnan(never.volumes).all()
    assert len(asked) == 20
    at_once = run_filter(LSUCZ(MODEL, PRIOR), data.Y, data.U, volumes=True)
    assert len(asked) == 40
    np.testing.assert_array_equal(at_once.volumes, expected)
