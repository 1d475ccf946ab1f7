"""What a guaranteed filter does at its limits: numbers that overflow, and a domain that is missed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lsu_mesh.errors import InconsistentData, UnboundedSupport
from lsu_mesh.filters.filter import Filter
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.testing.filter_state import Witness, state_of

Make = Callable[[LSUModel, Orthotope], Filter]
GROWTH = 1e60
STEPS_TO_OVERFLOW = 8
"""Steps after which ``GROWTH`` has outgrown double precision for certain."""


def check_limits(make: Make) -> None:
    """Overflow ends in ``UnboundedSupport``, a missed domain in ``InconsistentData``; the state is kept either way."""
    for n in (1, 2, 4):
        rotation = np.roll(np.eye(n), 1, axis=0)
        _check_overflow(make, LSUModel(A=GROWTH * rotation, B=None, C=np.eye(n), rho=0.1, r=0.1), "a growing state")
        _check_overflow(make, LSUModel(A=rotation, B=None, C=np.eye(n), rho=1.7e308, r=0.1), "growing noise")
        _check_missed_domain(make, LSUModel(A=0.5 * rotation, B=None, C=np.eye(n), rho=0.1, r=0.1))


def _check_overflow(make: Make, model: LSUModel, kind: str) -> None:
    n = model.state_count
    filter = make(model, Orthotope(-np.ones(n), np.ones(n)))
    witness = Witness(filter, f"{type(filter).__name__}, case {kind!r} with {n} states")
    witness.action = "predict"
    with np.errstate(over="ignore", invalid="ignore"):
        for witness.step in range(1, STEPS_TO_OVERFLOW + 1):
            before = state_of(filter)
            try:
                filter.predict()
            except UnboundedSupport:
                witness.check_same(before, "UnboundedSupport")
                return
            lower, upper = filter.bounds()
            is_finite = bool(np.isfinite(lower).all() and np.isfinite(upper).all())
            witness.expect(is_finite, f"the bounds [{lower}, {upper}]", "finite bounds, or UnboundedSupport")
    raise witness.failure("no error", "UnboundedSupport, the numbers have outgrown double precision")


def _check_missed_domain(make: Make, model: LSUModel) -> None:
    n = model.state_count
    filter = make(model, Orthotope(-np.ones(n), np.ones(n)))
    witness = Witness(filter, f"{type(filter).__name__}, case 'missed domain' with {n} states")
    witness.action, before = "predict", state_of(filter)
    away = model.replace(domain=(np.full(n, 50.0), np.full(n, 60.0)))
    try:
        filter.predict(model=away)
    except InconsistentData:
        witness.check_same(before, "a prediction that misses the domain")
        return
    raise witness.failure("no error where the prediction misses the domain", "InconsistentData")
