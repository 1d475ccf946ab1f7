"""LSU-CZ: its steps, its limits, its answers, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import (
    LSUCZ,
    ConstrainedZonotope,
    InconsistentData,
    Intersection,
    LSUModel,
    ModelError,
    Orthotope,
    Parallelotope,
    UnboundedSupport,
    Zonotope,
)

A = [[1.0, -0.5, 0.2], [0.5, 0.1, 0.0], [0.3, 0.0, -0.1]]
B = [[0.1], [0.6], [0.3]]
C = [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5]]
MODEL = LSUModel(A, B, C, rho=0.1, r=0.3)
PRIOR = Orthotope([-1.0] * 3, [1.0] * 3)


def _run(estimator: LSUCZ, steps: int, seed: int = 0, missing: float = 0.0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Bounds after each update, with the truth checked to lie in the support, the bounds and the predicted outputs."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1, 1, 3)
    history = []
    for _ in range(steps):
        y = MODEL.C @ x + rng.uniform(-0.3, 0.3, 2)
        predicted = estimator.predict_output()
        assert (predicted.lower <= y).all()
        assert (y <= predicted.upper).all()
        y[rng.random(2) < missing] = np.nan
        estimator.update(y)
        lower, upper = estimator.bounds()
        assert (lower <= x).all()
        assert (x <= upper).all()
        assert estimator.support.contains(x)
        history.append((lower, upper))
        u = rng.normal(size=1)
        estimator.predict(u)
        x = MODEL.A @ x + B @ u + rng.uniform(-0.1, 0.1, 3)
    return history


@pytest.mark.parametrize("limits", [(3, 0), (3, 8), (7, 4), (12, 4), (20, 8), (None, 2), (15, None)])
def test_the_posterior_stays_within_its_limits(limits: tuple[int | None, int | None]) -> None:
    estimator = LSUCZ(MODEL, PRIOR, *limits)
    rng = np.random.default_rng(1)
    x = np.zeros(3)
    for _ in range(12):
        posterior = estimator.update(MODEL.C @ x + rng.uniform(-0.3, 0.3, 2))
        assert posterior.contains(x)
        assert limits[0] is None or posterior.generator_count <= limits[0]
        assert limits[1] is None or posterior.constraint_count <= limits[1]
        prediction = estimator.predict([0.0])
        assert limits[0] is None or prediction.generator_count <= limits[0] + 6
        x = MODEL.A @ x
    for _ in range(5):  # without data the complexity is bounded all the same
        prediction = estimator.predict([0.0])
    assert limits[0] is None or prediction.generator_count <= limits[0] + 6


def test_the_truth_is_held_with_and_without_missing_data() -> None:
    _run(LSUCZ(MODEL, PRIOR), 30)
    _run(LSUCZ(MODEL, PRIOR, 12, 4, point="nearest"), 30, seed=3, missing=0.4)


def test_unreduced_bounds_lie_inside_reduced_ones() -> None:
    exact = _run(LSUCZ(MODEL, PRIOR, reduce=False), 15)
    reduced = _run(LSUCZ(MODEL, PRIOR, 12, 4), 15)
    for (low, high), (outer_low, outer_high) in zip(exact, reduced, strict=True):
        assert (outer_low <= low + 1e-12).all()
        assert (high <= outer_high + 1e-12).all()


def test_reduction_never_widens_the_bounds() -> None:
    estimator = LSUCZ(MODEL, PRIOR, 4, 1)
    estimator.update([0.3, 0.2])
    narrow = estimator.bounds()
    hull = estimator.support.bounds()
    assert (hull[0] <= narrow[0]).all()
    assert (narrow[1] <= hull[1]).all()
    exact = LSUCZ(MODEL, PRIOR, reduce=False)
    exact.update([0.3, 0.2])
    assert np.abs(np.subtract(exact.bounds(), narrow)).max() <= 1e-12


def test_points() -> None:
    by_hull, nearest = LSUCZ(MODEL, PRIOR, point="hull"), LSUCZ(MODEL, PRIOR, point="nearest")
    for estimator in (by_hull, nearest):
        estimator.update([0.9, 0.8])
    lower, upper = by_hull.bounds()
    assert (by_hull.point == 0.5 * lower + 0.5 * upper).all()
    assert nearest.support.contains(nearest.point)
    # the centre of the prior box violates both strips by .6 and .5, so the nearest point lies on them
    assert MODEL.C @ nearest.point == pytest.approx([0.6, 0.5], abs=1e-9)


def test_what_is_asked_between_steps_changes_nothing() -> None:
    silent, asked = LSUCZ(MODEL, PRIOR, 12, 4), LSUCZ(MODEL, PRIOR, 12, 4)
    rng = np.random.default_rng(5)
    for _ in range(10):
        y, u = rng.uniform(-0.2, 0.2, 2), rng.uniform(-0.1, 0.1, 1)
        for estimator in (silent, asked):
            if estimator is asked:
                estimator.bounds(), estimator.predict_output(), estimator.point, estimator.support.vertices()
            estimator.update(y)
            if estimator is asked:
                estimator.bounds(), estimator.volume()
            estimator.predict(u)
    for one, other in zip(silent.support.arrays, asked.support.arrays, strict=True):
        assert one.tobytes() == other.tobytes()
    assert np.array(silent.bounds()).tobytes() == np.array(asked.bounds()).tobytes()


def test_a_snapshot_brings_back_every_bit() -> None:
    estimator = LSUCZ(MODEL, PRIOR)
    _run(estimator, 8)
    snapshot, y = estimator.snapshot(), estimator.predict_output().point
    first = estimator.update(y).arrays
    estimator.predict([1.0])
    estimator.restore(snapshot)
    again = estimator.update(y).arrays
    assert all(one.tobytes() == other.tobytes() for one, other in zip(first, again, strict=True))
    with pytest.raises(ModelError, match="snapshot"):
        estimator.restore("yesterday")


def test_a_contradiction_names_its_rows_and_changes_nothing() -> None:
    estimator = LSUCZ(MODEL, PRIOR)
    _run(estimator, 5)
    before = estimator.snapshot()
    reach = estimator.predict_output()
    with pytest.raises(InconsistentData, match=r"y2 \(by 5\)") as caught:
        estimator.update([np.nan, reach.upper[1] + 5.0])
    assert caught.value.rows == (1,)
    assert caught.value.gap == pytest.approx(5.0, abs=1e-9)
    assert estimator.snapshot() is before


def test_a_contradiction_of_strips_that_agree_alone() -> None:
    """Each output can be 1 alone, with the state in the unit box, but x₁ + x₂ = 2 and x₁ − x₂ = 2 cannot be both."""
    model = LSUModel(np.eye(2), None, [[1.0, 1.0], [1.0, -1.0]], rho=0.0, r=0.1)
    estimator = LSUCZ(model, ([-1.0, -1.0], [1.0, 1.0]))
    with pytest.raises(InconsistentData, match="no point in common") as caught:
        estimator.update([1.9, 1.9])
    assert caught.value.rows == (0, 1)
    assert caught.value.gap == 0.0


def test_strips_that_just_touch_are_no_contradiction() -> None:
    model = LSUModel([[1.0]], None, [[1.0]], rho=0.0, r=0.5)
    estimator = LSUCZ(model, ([0.0], [1.0]))
    estimator.update([1.5])
    lower, upper = estimator.bounds()
    assert lower[0] == pytest.approx(1.0, abs=1e-12)
    assert lower[0] <= 1.0 <= upper[0]


def test_the_domain_is_kept_and_its_contradiction_proved() -> None:
    model = MODEL.replace(domain=([-1.0] * 3, [1.0] * 3))
    estimator = LSUCZ(model, PRIOR)
    for _ in range(4):
        estimator.predict([0.5])
        lower, upper = estimator.bounds()
        assert (lower >= -1.0).all()
        assert (upper <= 1.0).all()
        assert estimator.support.bounds()[1] == pytest.approx(np.minimum(estimator.support.bounds()[1], 1.0), abs=1e-9)
    before = estimator.snapshot()
    with pytest.raises(InconsistentData, match="domain"):
        estimator.predict([100.0])
    assert estimator.snapshot() is before


def test_an_unknown_input_is_a_box() -> None:
    known, unknown = LSUCZ(MODEL, PRIOR), LSUCZ(MODEL, PRIOR)
    known.predict([0.7])
    unknown.predict(Orthotope([-1.0], [1.0]))
    (low, high), (outer_low, outer_high) = known.bounds(), unknown.bounds()
    assert (outer_low < low).all()
    assert (high < outer_high).all()
    assert outer_high - high == pytest.approx(0.3 * np.array(B).ravel(), abs=1e-12)


def test_bounds_and_models_of_one_step() -> None:
    estimator = LSUCZ(MODEL, PRIOR)
    estimator.predict([0.0], rho=[0.0, 0.0, 2.0])
    assert estimator.bounds()[1] == pytest.approx([1.7, 0.6, 2.4], abs=1e-12)
    estimator.reset(PRIOR)
    estimator.predict(model=LSUModel(2 * np.eye(3), None, C, rho=0.0, r=0.3))
    assert estimator.bounds()[1] == pytest.approx([2.0] * 3, abs=1e-12)
    estimator.reset(PRIOR)
    estimator.update([0.0, 0.0], r=[0.01, 10.0])
    assert estimator.support.support([1.0, 0.0, 0.5]) == pytest.approx(0.01, abs=1e-12)


def test_a_noise_map_spans_its_columns_only() -> None:
    model = LSUModel(np.eye(2), None, [[1.0, 0.0]], rho=0.5, r=0.1, noise_map=[[1.0], [1.0]])
    estimator = LSUCZ(model, ([0.0, 0.0], [0.0, 0.0]))
    estimator.predict()
    assert estimator.support.support([1.0, -1.0]) <= 1e-12
    assert estimator.support.support([1.0, 1.0]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    "other",
    [
        Orthotope([-0.5] * 3, [0.2] * 3),
        Parallelotope(np.zeros(3), np.array([[0.5, 0.2, 0.0], [0.0, 0.5, 0.2], [0.2, 0.0, 0.5]])),
        ConstrainedZonotope(np.zeros(3), 0.3 * np.eye(3), [[1.0, 1.0, 1.0]], [0.5]),
        Intersection([Orthotope([-0.5] * 3, [0.5] * 3), Zonotope(np.zeros(3), np.full((3, 1), 0.4))]),
        Zonotope(np.zeros(3), np.random.default_rng(0).normal(size=(3, 90)) * 0.004),
    ],
    ids=lambda support: type(support).__name__,
)
def test_conditioning_keeps_common_points_and_gains(other: Orthotope) -> None:
    estimator = LSUCZ(MODEL, PRIOR, 12, 4)
    lower, upper = estimator.bounds()
    gain = estimator.condition(other, "hull")
    after = estimator.bounds()
    assert gain > 0
    assert gain == pytest.approx(np.log(upper - lower).sum() - np.log(after[1] - after[0]).sum(), abs=1e-9)
    assert (after[0] >= np.maximum(lower, other.bounds()[0])).all()
    assert (after[1] <= np.minimum(upper, other.bounds()[1])).all()
    corners = other.vertices()
    for point in corners[:5] + 1e-9 * (corners.mean(axis=0) - corners[:5]):
        assert estimator.support.contains(point) or not PRIOR.contains(point)
    assert estimator.condition(other) == pytest.approx(0.0, abs=1e-9)


def test_conditioning_on_a_disjoint_set_is_refused() -> None:
    estimator = LSUCZ(MODEL, PRIOR)
    before = estimator.snapshot()
    with pytest.raises(InconsistentData, match="no point in common"):
        estimator.condition(Orthotope([2.0] * 3, [3.0] * 3))
    assert estimator.snapshot() is before


def test_reset_takes_any_set() -> None:
    estimator = LSUCZ(MODEL, PRIOR)
    _run(estimator, 3)
    estimator.reset(Parallelotope(np.ones(3), 0.1 * np.eye(3)))
    assert estimator.bounds()[0] == pytest.approx([0.9] * 3, abs=1e-12)
    estimator.reset(Zonotope(np.zeros(3), np.random.default_rng(1).normal(size=(3, 50))))
    assert estimator.support.generator_count <= 20


def test_growth_without_end_is_reported() -> None:
    estimator = LSUCZ(LSUModel([[1e200]], None, [[1.0]], rho=1.0, r=1.0), ([-1.0], [1.0]))
    estimator.predict()
    with pytest.raises(UnboundedSupport, match="outgrown"):
        estimator.predict()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"max_generators": 2}, "max_generators must be at least 3"),
        ({"max_constraints": -1}, "max_constraints must not be negative"),
        ({"point": "middle"}, 'point must be "mean", "nearest" or "centre"'),
    ],
)
def test_wrong_options_are_named(options: dict[str, object], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        LSUCZ(MODEL, PRIOR, **options)  # type: ignore[arg-type]


def test_wrong_data_are_refused() -> None:
    estimator = LSUCZ(MODEL, PRIOR)
    with pytest.raises(ModelError, match="y must have 2 entries"):
        estimator.update([1.0])
    with pytest.raises(ModelError, match="1 input"):
        estimator.predict()
    with pytest.raises(ModelError, match="3 states"):
        estimator.predict(model=LSUModel([[1.0]], None, [[1.0]], 0.1, 0.1))
    with pytest.raises(ModelError, match="3 coordinates"):
        LSUCZ(MODEL, Orthotope([0.0], [1.0]))
