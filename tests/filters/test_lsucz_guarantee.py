"""LSU-CZ and the zonotopic Kalman filter never lose a state that is simulated in exact rationals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lsu_mesh import LSUCZ, InconsistentData, LSUModel, Orthotope, ZonotopicKalman, systems
from lsu_mesh.filters.filter import Filter
from lsu_mesh.kernels.set_run import UPDATE
from lsu_mesh.supports.exact import Membership
from lsu_mesh.testing.exact_plant import Case, Exact, exact_product, exact_steps, inside_box

Maker = Callable[[LSUModel, Orthotope], Filter]
MAKERS: dict[str, Maker] = {
    "LSUCZ(20, 8)": LSUCZ,
    "LSUCZ(12, 4)": lambda model, prior: LSUCZ(model, prior, 12, 4, point="nearest"),
    "LSUCZ(n + 2, 2)": lambda model, prior: LSUCZ(model, prior, model.state_count + 2, 2),
    "LSUCZ(n, 0)": lambda model, prior: LSUCZ(model, prior, model.state_count, 0),
    "LSUCZ unreduced": lambda model, prior: LSUCZ(model, prior, reduce=False),
    "ZonotopicKalman": ZonotopicKalman,
    "ZonotopicKalman, order n": lambda model, prior: ZonotopicKalman(model, prior, model.state_count),
    "ZonotopicKalman, predictor": lambda model, prior: ZonotopicKalman(model, prior, 9, "predictor"),
    "ZonotopicKalman unreduced": lambda model, prior: ZonotopicKalman(model, prior, reduce=False),
}
every_filter = pytest.mark.parametrize("name", MAKERS)
MAX_EXACT = 24
"""Generators up to which membership is decided exactly at the steps that ask for it: its cost grows with the cube."""
MAX_UNREDUCED_STEPS = 7
"""Steps after which a set without limits is given up: its programs grow with every step."""


def holds(estimator: Filter, x: Exact, exactly: bool) -> None:
    """The exact state lies in the bounds and in the support; ``exactly``: proved by rational numbers."""
    assert inside_box(*estimator.bounds(), x)
    body = estimator.support.to_constrained_zonotope()
    if exactly and body.generator_count <= MAX_EXACT:
        assert body.membership(x) is Membership.INSIDE
    assert body.contains([float(v) for v in x]) or body.membership(x) is Membership.INSIDE


def follow(name: str, case: Case, seed: int, steps: int) -> int:
    """Run a filter against the exact plant, some outputs missing; the number of steps whose sets were checked."""
    estimator, rng, done = MAKERS[name](case.model, case.prior), np.random.default_rng(seed), 0
    for step in exact_steps(case, rng, min(steps, MAX_UNREDUCED_STEPS) if "unreduced" in name else steps):
        outputs = exact_product(case.model.C, step.x)
        interval = estimator.predict_output()
        assert inside_box(interval.lower, interval.upper, outputs)
        estimator.update(np.where(rng.random(step.y.size) < 0.15, np.nan, step.y))
        holds(estimator, step.x, exactly=done % 5 == 4)
        estimator.predict(step.u if case.model.B is not None else None)
        done += 1
    return done


@every_filter
@pytest.mark.parametrize("system", systems.SYSTEMS)
def test_exact_states_stay_inside_on_the_papers_systems(name: str, system: str) -> None:
    model = systems.get(system)
    case = Case(model, Orthotope(-np.ones(model.state_count), np.ones(model.state_count)), inside=False)
    assert follow(name, case, seed=1, steps=10) >= MAX_UNREDUCED_STEPS


@every_filter
@pytest.mark.parametrize("exponent", [-20, 20])
def test_a_scaled_copy_gives_the_scaled_sets_bit_by_bit(name: str, exponent: int) -> None:
    rng = np.random.default_rng(7)
    model, scale = systems.get("P3"), 2.0**exponent
    scaled = model.replace(rho=model.rho * scale, r=model.r * scale)
    one = MAKERS[name](model, Orthotope([-1.0] * 3, [1.0] * 3))
    other = MAKERS[name](scaled, Orthotope([-scale] * 3, [scale] * 3))
    for step in exact_steps(Case(model, Orthotope([-1.0] * 3, [1.0] * 3), inside=True), rng, MAX_UNREDUCED_STEPS):
        one.update(step.y)
        other.update(step.y * scale)
        for plain, larger in zip(one.bounds(), other.bounds(), strict=True):
            assert (plain * scale == larger).all()
        G = one.support.to_constrained_zonotope().generators
        assert (G * scale == other.support.to_constrained_zonotope().generators).all()
        one.predict(step.u)
        other.predict(step.u * scale)


def test_the_check_notices_a_bound_that_is_a_billionth_too_small(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = LSUCZ._stepped

    def shrunk(self: LSUCZ, action: int, *given: Any, **options: Any) -> Any:
        held = honest(self, action, *given, **options)
        assert held is not None
        lower, upper = held.lower + 1e-9 * np.abs(held.lower), held.upper - 1e-9 * np.abs(held.upper)
        return held._replace(lower=lower, upper=upper) if action == UPDATE else held

    monkeypatch.setattr(LSUCZ, "_stepped", shrunk)
    monkeypatch.setitem(MAKERS, "shrunk", LSUCZ)
    case = Case(LSUModel([[0.9]], None, [[1.0]], 0.1, 10.0), Orthotope([-1.0], [1.0]), inside=False)
    with pytest.raises((AssertionError, InconsistentData)):
        follow("shrunk", case, seed=0, steps=5)
