"""LSUO, LSUP and LSUPB never lose a state that is simulated in exact rationals, in their set and in their bounds."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import LSUO, LSUP, LSUPB, Intersection, LSUModel, Orthotope, Parallelotope, systems
from lsu_mesh.filters.filter import Filter
from lsu_mesh.supports.exact import Membership, parallelotope_membership
from lsu_mesh.supports.support import Support
from lsu_mesh.testing.exact_plant import Case, Exact, exact_product, exact_steps, inside_box

Maker = Callable[[LSUModel, Orthotope], Filter]
MAKERS: dict[str, Maker] = {
    "LSUO": LSUO,
    "LSUO lp": lambda model, prior: LSUO(model, prior, hull="lp"),
    "LSUO without meet": lambda model, prior: LSUO(model, prior, meet=False),
    "LSUP image": LSUP,
    "LSUP cgz": lambda model, prior: LSUP(model, prior, time_update="cgz"),
    "LSUP edges": lambda model, prior: LSUP(model, prior, time_update="edges"),
    "LSUP strips": lambda model, prior: LSUP(model, prior, time_update="strips"),
    "LSUPB": LSUPB,
}


def surely_holds(support: Support, x: Exact) -> bool:
    """Membership of an exact point in a box, a parallelotope or an intersection of these, decided in rationals."""
    if isinstance(support, Intersection):
        return all(surely_holds(part, x) for part in support.parts)
    if isinstance(support, Orthotope):
        return inside_box(*support.bounds(), x)
    assert isinstance(support, Parallelotope)
    return parallelotope_membership(support.center, support.generators, x) is Membership.INSIDE


def check(filter: Filter, x: Exact, y_exact: Exact) -> None:
    assert inside_box(*filter.bounds(), x)
    assert surely_holds(filter.support, x)
    interval = filter.predict_output()
    assert inside_box(interval.lower, interval.upper, y_exact)


def run_exactly(make: Maker, case: Case, seed: int, steps: int) -> int:
    """Run a filter against the exact plant; the number of steps whose set was checked."""
    filter, done = make(case.model, case.prior), 0
    for step in exact_steps(case, np.random.default_rng(seed), steps):
        outputs = exact_product(case.model.C, step.x)
        check(filter, step.x, outputs)
        filter.update(step.y)
        check(filter, step.x, outputs)
        filter.predict(step.u if case.model.B is not None else None)
        done += 1
    return done


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
@pytest.mark.parametrize("name", systems.SYSTEMS)
def test_exact_states_stay_inside_on_the_papers_systems(make: Maker, name: str) -> None:
    model = systems.get(name)
    case = Case(model, Orthotope(-np.ones(model.state_count), np.ones(model.state_count)), inside=False)
    assert run_exactly(make, case, seed=1, steps=25) == 25


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 6))
def test_a_prediction_reaches_every_extreme_of_every_state(make: Maker, seed: int, n: int) -> None:
    """The states that are extreme in coordinate i, with a centre that cancels: not an ulp of room is left to chance."""
    rng = np.random.default_rng(seed)
    center, widths = rng.normal(size=n) * 1e3, rng.random(n)
    model = LSUModel(rng.normal(size=(n, n)), rng.normal(size=(n, 1)), np.zeros((0, n)), rng.random(n), 1.0)
    prior = Orthotope(center - widths, center + widths)
    assert model.B is not None
    u = np.array([-(model.A[0] @ center) / model.B[0, 0]])
    filter = make(model, prior)
    filter.predict(u)
    lower, upper = prior.bounds()
    for i in range(n):
        for sign in (-1, 1):
            up = model.A[i] * sign > 0
            x = [Fraction(v) for v in np.where(up, upper, lower).tolist()]
            driven = exact_product(model.B, [Fraction(v) for v in u.tolist()])
            extreme = [
                a + b + sign * Fraction(w)
                for a, b, w in zip(exact_product(model.A, x), driven, model.rho.tolist(), strict=True)
            ]
            assert inside_box(*filter.bounds(), extreme)
            assert surely_holds(filter.support, extreme)


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
def test_a_bound_that_is_too_small_by_1e_9_loses_the_corner(make: Maker) -> None:
    """The test above can fail: the same truth, but the filter is told an rho that is shrunk by a billionth."""
    model = LSUModel(np.eye(2), None, np.eye(2), 1.0, 50.0)
    case = Case(model, Orthotope([-1.0, -1.0], [1.0, 1.0]), inside=False)
    told = model.replace(rho=model.rho * (1 - 1e-9))
    filter = make(told, case.prior)
    x = [Fraction(1), Fraction(1)]
    filter.predict()
    x = [v + 1 for v in x]
    assert not inside_box(*filter.bounds(), x)
    assert not surely_holds(filter.support, x)


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
@pytest.mark.parametrize("power", [-20, -1, 1, 20])
def test_a_scaled_model_gives_the_scaled_sets(make: Maker, power: int) -> None:
    model, scale = systems.get("P3"), 2.0**power
    scaled = LSUModel(model.A, model.B, model.C, model.rho * scale, model.r * scale)
    one, other = make(model, Orthotope([-1.0] * 3, [1.0] * 3)), make(scaled, Orthotope([-scale] * 3, [scale] * 3))
    rng = np.random.default_rng(3)
    case = Case(model, Orthotope([-1.0] * 3, [1.0] * 3), inside=True)
    for step in exact_steps(case, rng, 15):
        one.update(step.y)
        other.update(step.y * scale)
        np.testing.assert_array_equal(np.array(one.bounds()) * scale, np.array(other.bounds()))
        one.predict(step.u)
        other.predict(step.u * scale)
