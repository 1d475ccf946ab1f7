"""The tie rule of the strip update: which of two parallelotopes of equal volume stays."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUO, LSUP, LSUModel, ModelError, Orthotope, run_filter, systems
from lsu_mesh.experiments.monte_carlo import draw, simulate_all
from lsu_mesh.filters.compiled import Ties

SQUARE = Orthotope([-1.0, -1.0], [1.0, 1.0])


def test_a_strip_that_cuts_one_face_only_is_taken_or_left() -> None:
    """``x₁ ≤ 0`` as the strip [−4, 0]: old and new strip have width 1 after both are tightened."""
    model = LSUModel(np.eye(2), None, [[1.0, 0.25]], 0.1, 1.0)
    old, new = LSUP(model, SQUARE), LSUP(model, SQUARE, ties="new")
    for filter in (old, new):
        filter.update([-1.25])
    # the strip −2.25 ≤ x₁ + x₂/4 ≤ −.25 leaves x₁ ≤ 0 of the old one: width 1, and [−1.25, −.25], width 1, of itself
    assert old.volume() == pytest.approx(2.0)
    assert new.volume() == pytest.approx(2.0)
    assert np.count_nonzero(np.abs(old.support.generators) > 1e-9) == 2
    assert np.count_nonzero(np.abs(new.support.generators) > 1e-9) == 3
    for x in ([-1.0, 1.0], [-1.0, -1.0], [-0.5, 1.0], [0.0, -1.0]):
        assert old.support.contains(x)
        assert new.support.contains(x)


def errors(ties: Ties) -> tuple[float, float]:
    """Σ (x̂₂ − x₂)² over 100 steps of P3, and the standard deviation of the outputs' errors, means of 20 runs."""
    model = systems.get("P3", rho=0.1, r=0.3)
    prior = Orthotope([-1.0] * 3, [1.0] * 3)
    data = simulate_all([model], draw(model, 100, 1, 20), 1.0)
    squares, spreads = [], []
    for X, Y, U in zip(data.X, data.Y, data.U, strict=True):
        run = run_filter(LSUO(model, prior, meet=False, ties=ties, point="centre"), Y, U)
        squares.append(np.square(run.points[:, 1] - X[:, 1]).sum())
        spreads.append(np.std((run.points @ model.C.T - Y)[:, 1], ddof=1))
        assert ((run.lower <= X) & (run.upper >= X)).all()
    return float(np.mean(squares)), float(np.mean(spreads))


def test_the_paper_lies_between_both_rules() -> None:
    """P2018, Table 1: Σe² 1.77, std of ŷ₂ .054; keeping the old edges has a third less error."""
    old, new = errors("old"), errors("new")
    assert old[0] == pytest.approx(1.18, abs=0.25)
    assert new[0] == pytest.approx(2.18, abs=0.35)
    assert old[0] < 1.77 < new[0]
    assert new[1] == pytest.approx(0.05, abs=0.02)
    assert old[1] == pytest.approx(0.129, abs=0.04)


def test_another_word_is_refused() -> None:
    for kind in (LSUO, LSUP):
        with pytest.raises(ModelError, match='ties must be "old" or "new", not \'both\''):
            kind(systems.get("P3"), Orthotope([-1.0] * 3, [1.0] * 3), ties="both")  # type: ignore[arg-type]
