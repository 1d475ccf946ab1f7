"""Decimals are known to their last bits: nobody is refused for an ulp, and a gap is always a number."""

from __future__ import annotations

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUO, LSUP, LSUPB, InconsistentData, LSUModel, Orthotope, ZonotopicKalman, run_filter
from lsu_mesh.filters.compiled import CompiledFilter

CORNER = LSUModel([[0.75]], None, [[1.0]], 53.5, 0.0)


@pytest.mark.parametrize("kind", [LSUO, LSUP, LSUPB])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_truth_some_ulps_outside_its_corner_is_no_contradiction(kind: type[CompiledFilter], side: int) -> None:
    filter = kind(CORNER, Orthotope([-1.0], [1.0]))  # type: ignore[call-arg]
    filter.predict()
    edge = float(filter.bounds()[(side + 1) // 2][0])
    outside = edge + side * 1.4e-13  # two ulps of each number that was added up on the way
    run = run_filter(filter, [[outside], [np.nan]])
    np.testing.assert_allclose([run.lower[0, 0], run.upper[0, 0]], edge, atol=2e-13, rtol=0.0)
    other = kind(CORNER, Orthotope([-1.0], [1.0]))  # type: ignore[call-arg]
    other.predict()
    before = other.bounds()
    with pytest.raises(InconsistentData) as caught:
        other.update([edge + side * 1e-11])
    assert caught.value.gap == pytest.approx(1e-11, rel=0.1)
    np.testing.assert_array_equal(other.bounds(), before)


@pytest.mark.parametrize("kind", [LSUPB, LSUP, LSUCZ, ZonotopicKalman])
def test_a_gap_is_always_a_number(kind: type[LSUPB]) -> None:
    """Each strip meets the square, both together do not: the corner that they share lies outside."""
    model = LSUModel(np.eye(2), None, [[1.0, 1.0], [1.0, -1.0]], 0.1, 0.1)
    with pytest.raises(InconsistentData, match="no point in common") as caught:
        kind(model, Orthotope([-1.0, -1.0], [1.0, 1.0])).update([1.5, 1.5])
    assert caught.value.gap == 0.0
    assert InconsistentData("without a strip").gap == 0.0
