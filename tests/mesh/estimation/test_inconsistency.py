"""Widening: the smallest factor of r that explains contradictory data, against a linear program."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from lsu_mesh import LSUCZ, LSUO, LSUPB, InconsistentData, LSUModel, Orthotope
from lsu_mesh.filters.filter import Filter
from lsu_mesh.mesh.estimation.inconsistency import PRECISION, widen

FILTERS = (LSUO, LSUPB, LSUCZ)


def case(seed: int) -> tuple[LSUModel, Orthotope, np.ndarray]:
    """A box of two or three states, and outputs of which the first lies far outside."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 4)), int(rng.integers(1, 4))
    C, r = rng.normal(size=(m, n)), rng.uniform(0.1, 0.5, m)
    center, widths = rng.normal(size=n), rng.uniform(0.1, 1.0, n)
    y = C @ center
    y[0] += (1.0 + rng.uniform(0.2, 20.0)) * (np.abs(C[0]) @ widths + r[0])
    return LSUModel(np.eye(n), None, C, np.zeros(n), r), Orthotope(center - widths, center + widths), y


def smallest_factor(model: LSUModel, box: Orthotope, y: np.ndarray) -> float:
    """min t over x in the box with |y − C x| <= t r, by HiGHS."""
    C, r = model.C, model.r[:, None]
    rows, sides = np.vstack([np.hstack([C, -r]), np.hstack([-C, -r])]), np.concatenate([y, -y])
    limits = [*zip(box.lower, box.upper, strict=True), (0.0, None)]
    answer = linprog([*np.zeros(box.dim), 1.0], A_ub=rows, b_ub=sides, bounds=limits)
    return float(answer.fun)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("kind", FILTERS, ids=lambda kind: kind.kind)
def test_r_is_widened_by_the_smallest_factor_that_explains_the_data(kind: type[Filter], seed: int) -> None:
    model, box, y = case(seed)
    engine = kind(model, box)  # type: ignore[call-arg]
    before = engine.snapshot()
    factor = widen(engine, lambda factor: engine.update(y, factor * model.r))
    assert factor is not None
    smallest = smallest_factor(model, box, y)
    assert factor <= smallest * (1 + PRECISION) + 1e-9, "an emptiness that is proved late only asks for less"
    engine.restore(before)
    with pytest.raises(InconsistentData):
        engine.update(y, factor / (1 + PRECISION) ** 2 * model.r)
    if kind is LSUCZ:
        assert factor >= smallest * (1 - 1e-9)


def test_where_no_factor_explains_the_data_nothing_is_widened() -> None:
    model = LSUModel(np.eye(1), None, [[1.0]], [0.0], [0.0])
    engine = LSUO(model, Orthotope([0.0], [1.0]))
    before = engine.support
    assert widen(engine, lambda factor: engine.update([5.0], factor * model.r)) is None
    assert np.array_equal(engine.support.bounds(), before.bounds())
