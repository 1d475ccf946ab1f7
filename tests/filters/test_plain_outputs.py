"""Feedthrough, offsets and periods: what is a true strip of y stays one, in exact arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    Filter,
    FilterBank,
    InconsistentData,
    Kalman,
    LSUModel,
    ModelError,
    Orthotope,
    TruncatedKalman,
    WindowMAP,
    ZonotopicKalman,
    run_filter,
    simulate,
    systems,
)
from lsu_mesh.testing.exact_plant import Exact, exact_product, inside_box, measured, unit_noise

MADE = (LSUO, LSUP, LSUPB, LSUCZ, ZonotopicKalman)
BOX = Orthotope([-1.0, -1.0], [1.0, 1.0])


def exact(values: np.ndarray) -> Exact:
    return [Fraction(v) for v in np.asarray(values, dtype=float).tolist()]


def added(*parts: Exact) -> Exact:
    return [sum(entries, Fraction(0)) for entries in zip(*parts, strict=True)]


@pytest.mark.parametrize("made", MADE)
def test_sets_hold_the_exact_state_with_feedthrough_and_offsets(made: type[Filter]) -> None:
    """Offsets of up to 1e9 beside r of 1e-6: the rounding of y − d − D u is charged, not lost."""
    rng = np.random.default_rng(7)
    for _ in range(40):
        scale = 10.0 ** rng.uniform(-3, 9)
        model = LSUModel(
            0.6 * rng.normal(size=(2, 2)), rng.normal(size=(2, 1)), rng.normal(size=(2, 2)), 0.01, 1e-6,
            D=scale * rng.normal(size=(2, 1)), a=rng.normal(size=2), d=scale * rng.normal(size=2),
        )  # fmt: skip
        assert model.D is not None
        assert model.a is not None
        assert model.d is not None
        filter = made(model, BOX)  # type: ignore[call-arg]
        x = exact(rng.uniform(-1, 1, 2))
        for _ in range(10):
            u = rng.normal(size=1)
            shift = added(exact_product(model.D, exact(u)), exact(model.d))
            # y − D u − d of the double y is within r of C x: a measurement whose noise is smaller than y's last digit
            y = measured(np.vstack([model.C.T, np.eye(2)]).T, model.r, [*x, *shift], unit_noise(rng, 2, False))
            predicted = filter.predict_output(u)
            known = ~np.isnan(y)
            assert (predicted.lower[known] <= y[known]).all()
            assert (y[known] <= predicted.upper[known]).all()
            filter.update(y, u=u)
            assert inside_box(*filter.bounds(), x)
            filter.predict(u)
            w = [Fraction(0.01) * s for s in unit_noise(rng, 2, False)]
            x = added(exact_product(model.A, x), exact_product(model.B, exact(u)), exact(model.a), w)  # type: ignore[arg-type]
            assert inside_box(*filter.bounds(), x)


@pytest.mark.parametrize("made", MADE)
def test_zero_parts_are_no_parts(made: type[Filter]) -> None:
    """D = 0, a = 0, d = 0 and no period: today's bits."""
    plain = systems.get("P3")
    full = LSUModel(
        plain.A, plain.B, plain.C, plain.rho, plain.r, D=np.zeros((plain.output_count, 1)), a=[0.0] * 3,
        d=np.zeros(plain.output_count), period=[None] * plain.output_count,
    )  # fmt: skip
    data = simulate(plain, 30, 1)
    prior = Orthotope([-5.0] * 3, [5.0] * 3)
    one = run_filter(made(plain, prior), data.Y, data.U)  # type: ignore[call-arg]
    other = run_filter(made(full, prior), data.Y, data.U)  # type: ignore[call-arg]
    np.testing.assert_array_equal(one.lower, other.lower)
    np.testing.assert_array_equal(one.y_upper, other.y_upper)
    assert full.has_plain_outputs


@pytest.mark.parametrize("made", MADE)
def test_the_input_is_asked_for_only_where_a_value_sees_it(made: type[Filter]) -> None:
    prior = Orthotope([-10.0], [10.0])
    both = LSUModel([[1.0]], [[1.0]], [[1.0], [1.0]], 0.0, [0.1, 0.1], D=[[2.0], [0.0]], d=[1.0, 0.5])
    alone = both.replace(C=[[1.0]], D=None, d=[0.5], r=[0.1], outputs=["y"])
    one, other = made(both, prior), made(alone, prior)  # type: ignore[call-arg]
    one.update([np.nan, 7.0])
    other.update([7.0])
    np.testing.assert_array_equal(one.bounds(), other.bounds())
    with pytest.raises(ModelError, match="D ≠ 0"):
        one.update([7.0, 7.0])


@pytest.mark.parametrize("made", MADE[:4])
def test_an_input_known_as_a_box_widens_the_strip(made: type[Filter]) -> None:
    model = LSUModel([[1.0]], [[1.0]], [[1.0]], 0.0, 0.1, D=[[2.0]], d=[1.0])
    filter = made(model, Orthotope([-10.0], [10.0]))  # type: ignore[call-arg]
    with pytest.raises(ModelError, match="D ≠ 0: an output depends on the input; give u"):
        filter.update([0.0])
    with pytest.raises(ModelError, match="D ≠ 0"):
        filter.predict_output()
    filter.update([7.0], u=Orthotope([1.0], [2.0]))  # 7 − 1 − 2 [1, 2] ± .1
    np.testing.assert_allclose(np.ravel(filter.bounds()), [1.9, 4.1], rtol=1e-12)
    band = filter.predict_output(Orthotope([1.0], [2.0]))
    np.testing.assert_allclose([band.lower[0], band.upper[0]], [1.9 + 1 + 2 - 0.1, 4.1 + 1 + 4 + 0.1], rtol=1e-12)


@pytest.mark.parametrize("made", [*MADE, Kalman])
def test_an_angle_that_passes_north_is_no_contradiction(made: type[Filter]) -> None:
    model = LSUModel([[1.0]], None, [[1.0]], 1.0, 0.5, period=360.0)
    filter = made(model, Orthotope([355.0], [358.0]))  # type: ignore[call-arg]
    for heading in (358.0, 359.0, 359.9, 0.7, 1.5, 2.0, 2.4, 3.0):
        filter.update([heading])
        truth = heading if heading > 180.0 else heading + 360.0
        assert filter.bounds()[0][0] <= truth <= filter.bounds()[1][0]
        filter.predict()


@pytest.mark.parametrize("made", MADE[:4])
def test_multiples_of_a_period(made: type[Filter]) -> None:
    """One candidate: its strip. Several: from the smallest to the largest. None: inconsistent, and kept as it was."""
    model = LSUModel(np.eye(2), None, [[1.0, 0.0]], 0.1, 1.0, period=10.0, outputs=["angle"])

    def updated(low: float, high: float, y: float) -> tuple[float, float]:
        filter = made(model, Orthotope([low, 0.0], [high, 1.0]))  # type: ignore[call-arg]
        filter.update([y])
        return float(filter.bounds()[0][0]), float(filter.bounds()[1][0])

    assert updated(100.0, 108.0, 4.0) == pytest.approx((103.0, 105.0))
    assert updated(-200.0, 200.0, 4.0) == pytest.approx((-197.0, 195.0))
    assert updated(100.0, 115.0, 4.0) == pytest.approx((103.0, 115.0))
    filter = made(model, Orthotope([100.0, 0.0], [102.0, 1.0]))  # type: ignore[call-arg]
    before = np.array(filter.bounds())
    with pytest.raises(InconsistentData, match="angle") as error:
        filter.update([6.0])
    assert error.value.rows == (0,)
    assert error.value.gap == pytest.approx(3.0, rel=1e-9)
    np.testing.assert_array_equal(filter.bounds(), before)


@given(
    st.integers(-50, 50),
    st.floats(0.0, 6.28),
    st.sampled_from([0.0, 1e-15, 1e-9, 0.03]),
    st.sampled_from([-1, 1]),
    st.sampled_from([2 * math.pi, 360.0, 0.1]),
)
@settings(max_examples=300, deadline=None)
def test_the_true_multiple_is_always_kept(turns: int, rest: float, r: float, sign: int, period: float) -> None:
    """2π means 2π: with an exact turn of 2π (to 40 digits) the truth stays inside."""
    pi = Fraction(31415926535897932384626433832795028841971, 10**40)
    turn = 2 * pi if period == 2 * math.pi else Fraction(period)
    truth = turns * turn + Fraction(rest) + sign * Fraction(r)  # the state; the sensor says ``rest``
    middle = float(truth)
    reach = 0.4 * period
    model = LSUModel([[1.0]], None, [[1.0]], 0.0, r, period=period)
    filter = LSUO(model, Orthotope([middle - reach], [middle + reach]))
    filter.update([rest])
    assert Fraction(float(filter.bounds()[0][0])) <= truth <= Fraction(float(filter.bounds()[1][0]))


def test_offsets_in_the_compiled_loop_and_the_bank_have_the_same_bits() -> None:
    model = systems.get("P3").replace(a=[0.1, -0.2, 0.3])
    prior = Orthotope([-5.0] * 3, [5.0] * 3)
    data = simulate(model, 30, 1)
    loop, single = LSUPB(model, prior), LSUPB(model, prior)
    run = run_filter(loop, data.Y, data.U)
    assert loop.has_compiled_loop
    for k, (y, u) in enumerate(zip(data.Y, data.U, strict=True)):
        single.update(y)
        np.testing.assert_array_equal(single.bounds()[0], run.lower[k])
        assert (run.lower[k] <= data.X[k]).all()
        assert (data.X[k] <= run.upper[k]).all()
        single.predict(u)
    record, done = FilterBank(LSUPB, model, [prior] * 3).run([data.Y] * 3, [data.U] * 3)
    np.testing.assert_array_equal(record.upper[1], run.upper)
    assert done.tolist() == [30] * 3
    with pytest.raises(ModelError, match=r"a bank knows no D, d"):
        FilterBank(LSUO, model.replace(D=np.ones((model.output_count, 1)), d=1.0), [prior] * 2)


def test_the_gaussian_filters_take_offsets_and_feedthrough_off() -> None:
    model = LSUModel([[1.0]], [[1.0]], [[1.0]], 0.1, 0.1, D=[[2.0]], a=[0.5], d=[3.0], domain=([-50.0], [50.0]))
    for made in (Kalman, TruncatedKalman):
        filter = made(model, Orthotope([-1.0], [1.0]))
        filter.update([0.2 + 2.0 * 4.0 + 3.0], u=[4.0])
        assert filter.point[0] == pytest.approx(0.2, abs=0.01)
        filter.predict([4.0])
        assert filter.point[0] == pytest.approx(0.2 + 4.0 + 0.5, abs=0.01)


def test_the_window_refuses_by_name() -> None:
    model = LSUModel([[1.0]], [[1.0]], [[1.0]], 0.1, 0.1, D=[[2.0]], a=[0.5], period=3.0)
    with pytest.raises(ModelError, match="the window estimators know no D, a, period"):
        WindowMAP(model, Orthotope([-1.0], [1.0]))


def test_mistakes_in_the_new_parts_are_named() -> None:
    with pytest.raises(ModelError) as error:
        LSUModel(np.eye(2), None, [[1.0, 0.0]], 0.1, 0.1, D=[[1.0]], a=[1.0], d=[np.nan], period=-2.0)
    assert error.value.problems == (
        "D must have 1 rows, one per output, and 0 columns, one per input; it is (1, 1)",
        "a must have 2 entries, one per state, it has shape (1,)",
        "d must be finite, it is [nan]",
        "period must be above 0, or 0 (or None) where there is none, it is [-2.0]",
    )


def test_a_change_of_outputs_drops_their_parts() -> None:
    model = LSUModel([[1.0]], [[1.0]], [[1.0]], 0.1, 0.1, D=[[2.0]], a=[0.5], d=[3.0], period=4.0)
    other = model.replace(C=[[1.0], [2.0]], r=0.1)
    assert other.has_plain_outputs
    assert other.a is not None
    kept = model.replace(rho=0.2)
    assert kept.period is not None
    assert kept.D is not None
