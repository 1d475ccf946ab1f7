"""Bayesian transfer into every kind of filter: the truth stays inside, and the bounds never widen."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    ConstrainedZonotope,
    Filter,
    InconsistentData,
    Intersection,
    LSUModel,
    Orthotope,
    Parallelotope,
    Support,
    Zonotope,
    ZonotopicKalman,
    simulate,
    systems,
)
from lsu_mesh.filters.compiled import CompiledFilter

STEPS = 12
PRIOR = Orthotope([-5.0] * 3, [5.0] * 3)
FILTERS: dict[str, Callable[[LSUModel], Filter]] = {
    "LSUO": lambda model: LSUO(model, PRIOR),
    "LSUO lp": lambda model: LSUO(model, PRIOR, hull="lp"),
    "LSUP image": lambda model: LSUP(model, PRIOR),
    "LSUP cgz": lambda model: LSUP(model, PRIOR, time_update="cgz"),
    "LSUP strips": lambda model: LSUP(model, PRIOR, time_update="strips"),
    "LSUPB": lambda model: LSUPB(model, PRIOR),
    "LSUCZ": lambda model: LSUCZ(model, PRIOR, max_generators=12, max_constraints=4),
    "ZonotopicKalman": lambda model: ZonotopicKalman(model, PRIOR, order=9),
    "ZonotopicKalman predictor": lambda model: ZonotopicKalman(model, PRIOR, order=9, form="predictor"),
}
ROUNDING = {name: 1e-12 if "LSUP " in name else 0.0 for name in FILTERS}
"""A parallelotope has no room for the rounding of its new edges; all others meet their bounds exactly."""


def prepared(name: str, seed: int) -> tuple[Filter, np.ndarray]:
    """A filter at the prediction of step ``STEPS``, and the true state of that step."""
    model = systems.get("P3", rho=0.1, r=0.3)
    made = simulate(model, STEPS, seed, x1=[1.0, 0.5, -0.5])
    estimator = FILTERS[name](model)
    for k in range(STEPS - 1):
        estimator.update(made.Y[k])
        estimator.predict(made.U[k])
    return estimator, made.X[STEPS - 1]


def around(x: np.ndarray, shape: str, rng: np.random.Generator) -> Support:
    """A set of a shape that holds x."""
    n = x.size
    half = rng.uniform(0.02, 0.6, n)
    middle = x + 0.99 * half * rng.uniform(-1.0, 1.0, n)
    if shape == "orthotope":
        return Orthotope(middle - half, middle + half)
    if shape == "parallelotope":
        T = rng.uniform(-0.4, 0.4, (n, n))
        return Parallelotope(x + 0.99 * T @ rng.uniform(-1.0, 1.0, n), T)
    G, xi = rng.uniform(-0.3, 0.3, (n, n + 3)), rng.uniform(-0.9, 0.9, n + 3)
    if shape == "zonotope":
        return Zonotope(x - G @ xi, G)
    A = rng.normal(size=(2, n + 3))
    body = ConstrainedZonotope(x - G @ xi, np.hstack([G, 1e-9 * np.eye(n)]), np.hstack([A, np.zeros((2, n))]), A @ xi)
    if shape == "constrained zonotope":
        return body
    return Intersection([around(x, "parallelotope", rng), around(x, "orthotope", rng)])


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("shape", ["orthotope", "parallelotope", "zonotope", "constrained zonotope", "intersection"])
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_transfer_never_widens_the_bounds_and_keeps_the_truth(name: str, shape: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    estimator, x = prepared(name, seed)
    for _ in range(3):
        other = around(x, shape, rng)
        if not other.contains(x):
            continue
        lower, upper = estimator.bounds()
        rounding = ROUNDING[name] * np.maximum(np.abs(lower), np.abs(upper))
        assert estimator.condition(other) >= 0.0
        new_lower, new_upper = estimator.bounds()
        assert (new_lower >= lower - rounding).all()
        assert (new_upper <= upper + rounding).all()
        assert (new_lower <= x).all()
        assert (x <= new_upper).all()
        assert estimator.support.contains(x)


@pytest.mark.parametrize("name", FILTERS)
def test_a_second_transfer_of_the_same_set_changes_next_to_nothing(name: str) -> None:
    estimator, x = prepared(name, 3)
    box = Orthotope(x - 0.1, x + 0.2)
    assert estimator.condition(box) > 0.1
    lower, upper = estimator.bounds()
    estimator.condition(box)
    again_lower, again_upper = estimator.bounds()
    assert again_lower == pytest.approx(lower, abs=0.05)
    assert again_upper == pytest.approx(upper, abs=0.05)


@pytest.mark.parametrize("name", FILTERS)
def test_a_contradicting_transfer_leaves_the_filter_as_it_was(name: str) -> None:
    estimator, x = prepared(name, 4)
    before = estimator.bounds()
    with pytest.raises(InconsistentData, match="no point in common"):
        estimator.condition(Orthotope(x + 30.0, x + 31.0))
    for old, new in zip(before, estimator.bounds(), strict=True):
        assert (old == new).all()


def test_a_parallelotope_whose_hull_a_strip_would_push_out_is_shortened_instead() -> None:
    """The free strip update of the square has less volume, but reaches down to −1.1."""
    model = LSUModel(np.eye(2), None, np.zeros((0, 2)), rho=0.1, r=[])
    square = Orthotope([-1.0, -1.0], [1.0, 1.0])
    other = Parallelotope([0.6, -0.6], [[0.6, 0.05], [-0.6, 0.05]])
    free, kept = LSUP(model, square), LSUP(model, square)
    CompiledFilter.condition(free, other)
    assert free.bounds()[0][1] == pytest.approx(-1.1)
    assert kept.condition(other) == pytest.approx(np.log(4.0 / (1.05 * 1.05)))
    lower, upper = kept.bounds()
    assert lower == pytest.approx([-0.05, -1.0])
    assert upper == pytest.approx([1.0, 0.05])


def test_a_wide_source_does_not_spend_the_complexity_of_a_constrained_zonotope() -> None:
    estimator, x = prepared("LSUCZ", 5)
    body = estimator.support
    assert isinstance(body, ConstrainedZonotope)
    wide, _ = prepared("LSUCZ", 5)
    for _ in range(STEPS):
        wide.predict([0.0])
    lower, upper = wide.bounds()
    shift = x - 0.5 * (lower + upper)
    assert estimator.condition(wide.support.linear_map(np.eye(3), shift)) < 0.01
    after = estimator.support
    assert isinstance(after, ConstrainedZonotope)
    assert all((old == new).all() for old, new in zip(body.arrays, after.arrays, strict=True))
