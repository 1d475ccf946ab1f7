"""Filters on nonlinear models: they hold the state, are tight, and on affine models give the linear filter's bits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    ConstrainedZonotope,
    Filter,
    InconsistentData,
    Kalman,
    ModelError,
    NonlinearFilter,
    NonlinearModel,
    Orthotope,
    ZonotopicKalman,
    run_filter,
)

H = 0.1
BEACONS = ((0.0, 0.0), (10.0, 0.0), (0.0, 10.0))
KINDS: tuple[tuple[type[Filter], dict[str, Any]], ...] = (
    (LSUO, {}), (LSUP, {}), (LSUPB, {}), (LSUCZ, {"max_generators": 20, "max_constraints": 8}), (ZonotopicKalman, {}),
)  # fmt: skip
IDS = [kind.__name__ for kind, _ in KINDS]


def unicycle(beacon: tuple[float, float]) -> NonlinearModel:
    return NonlinearModel(
        ["x + h*v*cos(th) + w1", "y + h*v*sin(th) + w2", "th + h*om + w3"],
        ["hypot(x - bx, y - by)", "atan2(y - by, x - bx) - th"],
        ["x", "y", "th"], rho=[0.01, 0.01, 0.005], r=[0.1, 0.02], inputs=["v", "om"], noises=["w1", "w2", "w3"],
        parameters={"h": H, "bx": beacon[0], "by": beacon[1]}, period=[None, 2 * math.pi],
    )  # fmt: skip


class Course:
    """A drive past three beacons that are heard in turn; noise is often at its bounds, or uniform."""

    def __init__(self, seed: int, steps: int, *, at_bounds: bool = True) -> None:
        rng = np.random.default_rng(seed)

        def noise(half_widths: list[float]) -> np.ndarray:
            drawn = rng.uniform(-1, 1, len(half_widths))
            if at_bounds:
                drawn = rng.choice([-1.0, 1.0, rng.uniform(-1, 1)], len(half_widths))
            return drawn * half_widths

        x = np.array([3.0, 4.0, 0.3])
        self.x: list[np.ndarray] = []
        self.y: list[np.ndarray] = []
        self.u: list[np.ndarray] = []
        for k in range(steps):
            u, (bx, by) = np.array([1.0, 0.3 * math.sin(k / 15)]), BEACONS[k % 3]
            v = noise([0.1, 0.02])
            self.x.append(x)
            self.u.append(u)
            turned = math.atan2(x[1] - by, x[0] - bx) - x[2] + v[1] + 2 * math.pi * rng.integers(-1, 2)
            self.y.append(np.array([math.hypot(x[0] - bx, x[1] - by) + v[0], turned]))
            w = noise([0.01, 0.01, 0.005])
            x = x + H * np.array([u[0] * math.cos(x[2]), u[0] * math.sin(x[2]), u[1]]) + w


def driven(base: type[Filter], options: dict[str, Any], course: Course) -> tuple[np.ndarray, int]:
    """Widths (steps, 3), and how many true states lie outside."""
    models = [unicycle(beacon) for beacon in BEACONS]
    engine = NonlinearFilter(base, models[0], ([2.5, 3.5, 0.1], [3.5, 4.5, 0.5]), **options)
    widths, outside = [], 0
    for k, (x, y, u) in enumerate(zip(course.x, course.y, course.u, strict=True)):
        engine.system = models[k % 3]
        engine.update(y, u=u)
        lower, upper = engine.bounds()
        outside += not (bool(((lower <= x) & (x <= upper)).all()) and engine.support.contains(x))
        widths.append(upper - lower)
        engine.predict(u)
    return np.array(widths), outside


@pytest.mark.parametrize(("base", "options"), KINDS, ids=IDS)
def test_the_sets_hold_the_state(base: type[Filter], options: dict[str, Any]) -> None:
    for seed in range(2):
        assert driven(base, options, Course(seed, 60))[1] == 0


def particle_widths(course: Course, count: int) -> np.ndarray:
    """Widths of the hull of states that explain all data so far: an inner bound on the exact set's."""
    rng = np.random.default_rng(7)
    cloud = np.array([3.0, 4.0, 0.3]) + rng.uniform(-1, 1, (count, 3)) * [0.5, 0.5, 0.2]
    widths = []
    for k, (y, u) in enumerate(zip(course.y, course.u, strict=True)):
        bx, by = BEACONS[k % 3]
        far = np.abs(np.hypot(cloud[:, 0] - bx, cloud[:, 1] - by) - y[0])
        turned = np.arctan2(cloud[:, 1] - by, cloud[:, 0] - bx) - cloud[:, 2] - y[1]
        turned = (turned + math.pi) % (2 * math.pi) - math.pi
        cloud = cloud[(far <= 0.1) & (np.abs(turned) <= 0.02)]
        widths.append(cloud.max(axis=0) - cloud.min(axis=0))
        cloud = cloud[rng.integers(len(cloud), size=count)]
        w = rng.uniform(-1, 1, cloud.shape)
        w = np.where(rng.random(cloud.shape) < 0.3, np.sign(w), w) * [0.01, 0.01, 0.005]
        move = np.stack([u[0] * np.cos(cloud[:, 2]), u[0] * np.sin(cloud[:, 2]), np.full(len(cloud), u[1])], axis=1)
        cloud = cloud + H * move + w
    return np.array(widths)


@pytest.mark.parametrize(("base", "options"), KINDS[2:4], ids=IDS[2:4])
def test_the_unicycle_is_tight(base: type[Filter], options: dict[str, Any]) -> None:
    """Widths ÷ those of an inner hull of particles, converged: at most 1.8, 1.7, 1.5."""
    course = Course(0, 100, at_bounds=False)
    widths, outside = driven(base, options, course)
    inner = particle_widths(course, 100_000)
    ratio = widths[30:].mean(axis=0) / inner[30:].mean(axis=0)
    assert outside == 0
    assert (ratio <= [1.8, 1.7, 1.5]).all(), ratio
    assert (ratio >= 1.0).all(), ratio


def test_example_1_of_rego_et_al_is_met() -> None:
    """Exact hull 1.44 × 2.28; at most 1.05 of it on each side, never below; area at most 1.55."""
    model = NonlinearModel(
        ["3*x1 - x1**2/7 - 4*x1*x2/(4 + x1)", "-2*x2 + 3*x1*x2/(4 + x1)"], [], ["x1", "x2"], rho=0, r=[]
    )
    prior = ConstrainedZonotope([-1, 1], [[0.2, 0.4, 0.2], [0.2, 0, -0.2]], [[2, 2, 2]], [-3])
    engine = NonlinearFilter(LSUCZ, model, prior)
    engine.predict()
    lower, upper = engine.bounds()
    exact = np.array([1.44, 2.28])
    assert (upper - lower >= exact * (1 - 1e-3)).all()
    assert (upper - lower <= 1.05 * exact).all()
    assert engine.volume() <= 1.55
    rng = np.random.default_rng(3)
    for _ in range(2_000):
        x = rng.uniform([-1.5, 0.7], [-1.2, 1.3])
        if prior.contains(x):
            image = [3 * x[0] - x[0] ** 2 / 7 - 4 * x[0] * x[1] / (4 + x[0]), -2 * x[1] + 3 * x[0] * x[1] / (4 + x[0])]
            assert engine.support.contains(np.array(image))


@pytest.mark.parametrize(("base", "options"), KINDS, ids=IDS)
def test_an_affine_model_gives_the_bits_of_the_linear_filter(base: type[Filter], options: dict[str, Any]) -> None:
    model = NonlinearModel(
        ["x + 0.1*v + 0.5*w", "0.9*v + u"], ["x", "v + u"], ["x", "v"], rho=[0.1], r=[0.2, 0.3], inputs=["u"],
        noises=["w"],
    )  # fmt: skip
    assert model.linear is not None
    rng = np.random.default_rng(4)
    Y, U = rng.uniform(-0.1, 0.1, (12, 2)), rng.uniform(-0.1, 0.1, (12, 1))
    found = run_filter(NonlinearFilter(base, model, ([-1, -1], [1, 1]), **options), Y, U)
    linear = run_filter(base(model.linear, ([-1, -1], [1, 1]), **options), Y, U)  # type: ignore[call-arg]
    assert found.lower.tolist() == linear.lower.tolist()
    assert found.upper.tolist() == linear.upper.tolist()
    assert found.points.tolist() == linear.points.tolist()


def test_an_unknown_input_is_a_box() -> None:
    model = NonlinearModel(["x + u*cos(x)"], ["x*x"], ["x"], rho=0.0, r=[0.1], inputs=["u"])
    engine = NonlinearFilter(LSUPB, model, ([0.4], [0.6]))
    engine.predict(Orthotope([-0.5], [0.5]))
    lower, upper = engine.bounds()
    assert lower[0] <= 0.4 - 0.5 * math.cos(0.4)
    assert upper[0] >= 0.4 + 0.5 * math.cos(0.4)
    with pytest.raises(ModelError, match="input"):
        engine.predict()


def test_rows_that_cannot_be_enclosed_are_left_out_and_counted() -> None:
    model = NonlinearModel(["x", "y"], ["sqrt(x)", "y"], ["x", "y"], rho=0.0, r=[0.1, 0.1])
    engine = NonlinearFilter(LSUPB, model, ([-1.0, -1.0], [1.0, 1.0]))
    output = engine.predict_output()
    assert (output.lower[0], output.upper[0]) == (-math.inf, math.inf)
    engine.update([0.5, 0.0])
    assert engine.not_enclosed == 1
    lower, upper = engine.bounds()
    assert (lower[0], upper[0]) == (-1.0, 1.0)
    assert upper[1] <= 0.1 + 1e-9
    assert lower[1] >= -0.1 - 1e-9


def test_contradictions_leave_the_filter_as_it_was() -> None:
    model = NonlinearModel(["x"], ["x*x"], ["x"], rho=0.0, r=[0.1])
    engine = NonlinearFilter(LSUPB, model, ([0.5], [1.0]))
    with pytest.raises(InconsistentData):
        engine.update([9.0])
    assert [side.tolist() for side in engine.bounds()] == [[0.5], [1.0]]


def test_only_guaranteed_classes_and_discrete_models_are_taken() -> None:
    model = NonlinearModel(["x"], ["x*x"], ["x"], rho=0.0, r=[0.1])
    with pytest.raises(ModelError, match="Kalman holds estimates"):
        NonlinearFilter(Kalman, model, ([0.5], [1.0]))
    rates = NonlinearModel(["-x"], ["x*x"], ["x"], rho=0.0, r=[0.1], continuous=True)
    with pytest.raises(ModelError, match="discrete"):
        NonlinearFilter(LSUPB, rates, ([0.5], [1.0]))


def test_a_run_over_rows_needs_inputs_only_where_they_enter() -> None:
    blind = NonlinearModel(["x + sin(x)*u"], ["x*x"], ["x"], rho=0.01, r=[0.1], inputs=["u"])
    seeing = NonlinearModel(["x + sin(x)*u"], ["x*x + u"], ["x"], rho=0.01, r=[0.1], inputs=["u"])
    U = np.full((5, 1), 0.01)
    run = run_filter(NonlinearFilter(LSUPB, blind, ([0.4], [0.6])), np.full((5, 1), 0.25), U[:-1])
    assert (run.lower[:, 0] <= 0.5).all()
    assert (run.upper[:, 0] >= 0.5).all()
    engine = NonlinearFilter(LSUPB, seeing, ([0.4], [0.6]))
    with pytest.raises(ModelError, match="input"):
        engine.update([0.25])
    run_filter(engine, np.full((5, 1), 0.26), U)
