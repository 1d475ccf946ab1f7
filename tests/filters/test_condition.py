"""Bayesian transfer into every kind of filter, beyond the contract that ``test_contracts.py`` checks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lsu_mesh import (
    LSUCZ,
    LSUO,
    LSUP,
    LSUPB,
    ConstrainedZonotope,
    Filter,
    LSUModel,
    Orthotope,
    Parallelotope,
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
EXACT = [name for name in FILTERS if "LSUP " not in name]
"""Filters that meet their bounds exactly; a parallelotope has no room for the rounding of its new edges."""


def prepared(name: str, seed: int) -> tuple[Filter, np.ndarray]:
    """A filter at the prediction of step ``STEPS``, and the true state of that step."""
    model = systems.get("P3", rho=0.1, r=0.3)
    made = simulate(model, STEPS, seed, x1=[1.0, 0.5, -0.5])
    estimator = FILTERS[name](model)
    for k in range(STEPS - 1):
        estimator.update(made.Y[k])
        estimator.predict(made.U[k])
    return estimator, made.X[STEPS - 1]


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.parametrize("seed", range(6))
def test_transfer_never_widens_the_bounds_by_a_single_bit(name: str, seed: int) -> None:
    estimator, x = prepared(name, seed)
    rng = np.random.default_rng(seed)
    for _ in range(3):
        lower, upper = estimator.bounds()
        T = rng.uniform(-0.4, 0.4, (3, 3))
        estimator.condition(Parallelotope(x + 0.99 * T @ rng.uniform(-1.0, 1.0, 3), T))
        assert (estimator.bounds()[0] >= lower).all()
        assert (estimator.bounds()[1] <= upper).all()


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


def test_a_parallelotope_whose_hull_a_strip_would_push_out_is_shortened_instead() -> None:
    """The free strip update of the square has less volume, but reaches up to 1.1."""
    model = LSUModel(np.eye(2), None, np.zeros((0, 2)), rho=0.1, r=[])
    square = Orthotope([-1.0, -1.0], [1.0, 1.0])
    other = Parallelotope([0.6, -0.6], [[0.6, 0.05], [-0.6, 0.05]])
    free, kept = LSUP(model, square), LSUP(model, square)
    CompiledFilter._condition(free, other)
    assert free.support.bounds()[1][0] == pytest.approx(1.1)
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
