"""Every registered filter: the units of the states do not matter, and what is known of a constant is never lost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lsu_mesh import LSUModel, Orthotope, run_filter, simulate, systems
from lsu_mesh.filters.registry import filter_class, filter_kinds

OPTIONS: dict[str, tuple[dict[str, Any], ...]] = {
    "LSUO": ({}, {"meet": True}),
    "LSUP": ({}, {"time_update": "cgz"}, {"time_update": "edges"}, {"time_update": "strips"}, {"ties": "new"}),
    "ZonotopicKalman": ({}, {"form": "predictor"}, {"order": 4}),
    "LSUCZ": ({}, {"max_generators": 6, "max_constraints": 2}),
}
CASES = [(kind, options) for kind in filter_kinds() if kind != "WindowMAP" for options in OPTIONS.get(kind, ({},))]
"""WindowMAP promises no sets, and its objective ``Σ rho + Σ r`` adds numbers of different units."""
NAMES = [f"{kind} {' '.join(map(str, options.values()))}".strip() for kind, options in CASES]
BATTERY = LSUModel([[1.0, -0.1], [0.0, 1.0]], [[0.1], [0.0]], [[1.0, 0.0]], [0.05, 0.0], 0.3)
"""A charge, counted by a current whose bias is constant."""


def in_units(model: LSUModel, d: np.ndarray) -> LSUModel:
    """The model of ``diag(d) x``."""
    return LSUModel(
        d[:, None] * model.A / d,
        d[:, None] * np.array(model.B),
        np.array(model.C) / d,
        model.rho * d,
        model.r,
        domain=None if model.domain is None else Orthotope(d * model.domain.lower, d * model.domain.upper),
    )


@pytest.mark.parametrize(("kind", "options"), CASES, ids=NAMES)
@pytest.mark.parametrize("name", ["P3", "S3"])
@pytest.mark.parametrize("seed", range(3))
def test_widths_do_not_depend_on_the_units_of_the_states(
    kind: str, options: dict[str, Any], name: str, seed: int
) -> None:
    plain = systems.get(name)
    n = plain.state_count
    if kind == "TruncatedKalman":
        plain = plain.replace(domain=Orthotope([-1.0] * n, [1.0] * n))
    data = simulate(plain, 40, seed=seed)
    d = 10.0 ** np.random.default_rng(seed).uniform(-4.0, 4.0, n)
    make: Any = filter_class(kind)
    usual = run_filter(make(plain, Orthotope(-np.ones(n), np.ones(n)), **options), data.Y, data.U, volumes=False)
    other = run_filter(make(in_units(plain, d), Orthotope(-d, d), **options), data.Y, data.U, volumes=False)
    np.testing.assert_allclose((other.upper - other.lower) / d, usual.upper - usual.lower, rtol=0.03)


@pytest.mark.parametrize(("kind", "options"), CASES, ids=NAMES)
def test_bounds_of_a_constant_never_exceed_what_was_known(kind: str, options: dict[str, Any]) -> None:
    make: Any = filter_class(kind)
    if make.guarantee == "none":
        pytest.skip("it promises no sets")
    data = simulate(BATTERY, 100, seed=3)
    run = run_filter(make(BATTERY, Orthotope([-2.0, -1.0], [2.0, 1.0]), **options), data.Y, data.U, volumes=False)
    bias = [np.concatenate([[side], row[:, 1]]) for side, row in ((-1.0, run.lower), (1.0, run.upper))]
    assert (np.diff(bias[0]) >= 0.0).all()
    assert (np.diff(bias[1]) <= 0.0).all()
