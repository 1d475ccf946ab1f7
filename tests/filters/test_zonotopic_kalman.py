"""The zonotopic Kalman filter: guaranteed for any gain, optimal for one."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import InconsistentData, LSUModel, ModelError, Orthotope, Parallelotope, ZonotopicKalman
from lsu_mesh.kernels.zonotopes.zonotope import absorb_box
from lsu_mesh.kernels.zonotopes.zonotopic_kalman import box_shortest, corrected, kalman_gain
from lsu_mesh.supports.exact_program import exact_solution

A = [[1.0, -0.5, 0.2], [0.5, 0.1, 0.0], [0.3, 0.0, -0.1]]
MODEL = LSUModel(A, [[0.1], [0.6], [0.3]], [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5]], rho=0.1, r=0.3)
PRIOR = Orthotope([-1.0] * 3, [1.0] * 3)


@pytest.mark.parametrize("form", ["filter", "predictor"])
@pytest.mark.parametrize("order", [3, 15, None])
def test_the_truth_is_held(form: str, order: int | None) -> None:
    estimator = ZonotopicKalman(MODEL, PRIOR, order, form, reduce=order is not None)
    rng = np.random.default_rng(2)
    x = rng.uniform(-1, 1, 3)
    for _ in range(40):
        y = MODEL.C @ x + rng.uniform(-0.3, 0.3, 2)
        predicted = estimator.predict_output()
        assert (predicted.lower <= y).all()
        assert (y <= predicted.upper).all()
        y[rng.random(2) < 0.2] = np.nan
        estimator.update(y)
        lower, upper = estimator.bounds()
        assert (lower <= x).all()
        assert (x <= upper).all()
        assert estimator.support.contains(x)
        u = rng.normal(size=1)
        estimator.predict(u)
        x = MODEL.A @ x + MODEL.B @ u + rng.uniform(-0.1, 0.1, 3)
        assert order is None or estimator.support.generators.shape[1] <= order


def test_both_forms_predict_the_same_set() -> None:
    predictor, filtered = ZonotopicKalman(MODEL, PRIOR, form="predictor"), ZonotopicKalman(MODEL, PRIOR)
    for y in ([0.2, 0.1], [0.1, np.nan], [-0.1, 0.3]):
        before = predictor.support
        assert (predictor.update(y).generators == before.generators).all()  # it still waits
        filtered.update(y)
        predictor.predict([0.2])
        filtered.predict([0.2])
        assert np.abs(np.subtract(predictor.bounds(), filtered.bounds())).max() <= 1e-13


def _fractions(values: np.ndarray) -> list[Fraction]:
    return [Fraction(v) for v in np.asarray(values).ravel().tolist()]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_any_gain_keeps_the_exact_state(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, g, m = 2, 4, int(rng.integers(1, 3))
    c, H, C = rng.normal(size=n), rng.normal(size=(n, g)), rng.normal(size=(m, n))
    xi = rng.choice([-1, 1], size=g)
    x = [
        Fraction(s) + sum(Fraction(h) * int(z) for h, z in zip(row, xi, strict=True))
        for s, row in zip(c.tolist(), H.tolist(), strict=True)
    ]
    outputs = [sum(Fraction(a) * v for a, v in zip(row, x, strict=True)) for row in C.tolist()]
    y = np.array([float(v) for v in outputs]) + rng.choice([-0.5, 0.0, 0.5], size=m)
    r = np.array([np.nextafter(float(abs(v - Fraction(s))), np.inf) for v, s in zip(outputs, y.tolist(), strict=True)])
    K = kalman_gain(H, C, r) if seed % 2 else rng.normal(size=(n, m))
    centre, generators, slack = corrected(c, H, C, y, r, K)
    generators, _ = absorb_box(generators, np.zeros((0, generators.shape[1])), slack)
    for columns in (generators, box_shortest(generators, n + 1, True), box_shortest(generators, n + 1, False)):
        rows = [[Fraction(v) for v in row] for row in columns.tolist()]
        sides = [v - s for v, s in zip(x, _fractions(centre), strict=True)]
        assert exact_solution(rows, sides, [0.5] * columns.shape[1]) is not None


def test_the_gain_minimises_the_squares_of_the_generators() -> None:
    rng = np.random.default_rng(0)
    H, C, r = rng.normal(size=(3, 6)), rng.normal(size=(2, 3)), np.array([0.3, 0.7])
    K = kalman_gain(H, C, r)

    def squares(gain: np.ndarray) -> float:
        return float((corrected(np.zeros(3), H, C, np.zeros(2), r, gain)[1] ** 2).sum())

    best = squares(K)
    assert all(squares(K + 1e-3 * rng.normal(size=K.shape)) > best for _ in range(50))


def test_degenerate_sets_have_no_gain_and_no_error() -> None:
    model = LSUModel(np.eye(2), None, [[1.0, 0.0], [1.0, 0.0]], rho=0.0, r=0.0)
    estimator = ZonotopicKalman(model, ([0.5, -1.0], [0.5, 1.0]))
    estimator.update([0.5, 0.5])
    estimator.predict()
    assert estimator.bounds()[0] == pytest.approx([0.5, -1.0], abs=1e-12)


def test_contradictions_are_proved_and_change_nothing() -> None:
    estimator = ZonotopicKalman(MODEL, PRIOR)
    before = estimator.snapshot()
    with pytest.raises(InconsistentData, match="y1") as caught:
        estimator.update([4.0, 0.0])
    assert caught.value.rows == (0,)
    assert caught.value.gap == pytest.approx(4.0 - 0.3 - 1.5, abs=1e-9)
    with pytest.raises(InconsistentData, match="no point in common"):
        estimator.condition(Orthotope([2.0] * 3, [3.0] * 3))
    assert estimator.snapshot() is before


def test_the_domain_bounds_the_prediction() -> None:
    estimator = ZonotopicKalman(MODEL.replace(domain=([-1.0] * 3, [1.0] * 3)), PRIOR)
    estimator.predict([0.5])
    lower, upper = estimator.bounds()
    assert (lower >= -1.0).all()
    assert (upper <= 1.0).all()
    with pytest.raises(InconsistentData, match="domain"):
        estimator.predict([100.0])


@pytest.mark.parametrize(
    "other",
    [Orthotope([-0.5] * 3, [0.2] * 3), Parallelotope(np.zeros(3), 0.4 * np.eye(3) + 0.05)],
    ids=["box", "parallelotope"],
)
def test_conditioning_keeps_common_points(other: Orthotope) -> None:
    estimator = ZonotopicKalman(MODEL, PRIOR)
    estimator.update([0.0, 0.1])
    before = estimator.support
    lower, upper = estimator.bounds()
    assert estimator.condition(other, "hull") > 0
    after = estimator.bounds()
    assert (after[0] >= np.maximum(lower, other.bounds()[0])).all()
    assert (after[1] <= np.minimum(upper, other.bounds()[1])).all()
    for point in other.vertices() * (1 - 1e-9):
        assert estimator.support.contains(point) or not before.contains(point)


def test_a_snapshot_brings_back_waiting_data() -> None:
    estimator = ZonotopicKalman(MODEL, PRIOR, form="predictor")
    estimator.update([0.1, 0.2])
    snapshot = estimator.snapshot()
    first = estimator.predict([0.3])
    estimator.restore(snapshot)
    again = estimator.predict([0.3])
    assert first.generators.tobytes() == again.generators.tobytes()
    estimator.reset(PRIOR)
    assert estimator.predict([0.3]).generators.shape != first.generators.shape
    with pytest.raises(ModelError, match="snapshot"):
        estimator.restore(None)


@pytest.mark.parametrize(
    ("options", "message"), [({"order": 2}, "order must be at least 3"), ({"form": "x"}, "form must be")]
)
def test_wrong_options_are_named(options: dict[str, object], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        ZonotopicKalman(MODEL, PRIOR, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("form", "order", "expected", "spread"), [("predictor", 15, 0.8, 0.25), ("filter", 15, 0.5, 0.15)]
)
def test_squared_error_of_state_2_in_p2018(form: str, order: int, expected: float, spread: float) -> None:
    """Σ (x̂₂ − x₂)² over 100 steps of P3 with ρ = .1, r = .3, mean of ten runs; no state outside its bounds."""
    model = LSUModel(A, MODEL.B, MODEL.C, rho=0.1, r=0.3)
    sums = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        x = rng.uniform(-1, 1, 3)
        estimator = ZonotopicKalman(model, PRIOR, order, form, point="centre")
        total = 0.0
        for _ in range(100):
            estimator.update(model.C @ x + rng.uniform(-0.3, 0.3, 2))
            total += float(estimator.point[1] - x[1]) ** 2
            lower, upper = estimator.bounds()
            assert (lower <= x).all()
            assert (x <= upper).all()
            u = rng.normal(size=1)
            estimator.predict(u)
            x = model.A @ x + model.B @ u + rng.uniform(-0.1, 0.1, 3)
        sums.append(total)
    assert abs(np.mean(sums) - expected) <= spread
