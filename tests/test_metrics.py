"""Metrics against numbers worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lsu_mesh import Orthotope, metrics

TRUTH = np.array([[0.0, 0.0], [1.0, 2.0]])
ESTIMATE = np.array([[3.0, 4.0], [1.0, 2.0]])


def test_errors() -> None:
    assert metrics.tnse(ESTIMATE, TRUTH) == 25.0
    assert metrics.rmse(ESTIMATE, TRUTH) == pytest.approx(math.sqrt(12.5))
    np.testing.assert_array_equal(metrics.mae(ESTIMATE, TRUTH), [1.5, 2.0])


def test_containment_has_no_tolerance() -> None:
    lower, upper = TRUTH - 1.0, TRUTH + 1.0
    assert metrics.containment(lower, upper, TRUTH) == 1.0
    upper[1, 0] = np.nextafter(1.0, 0.0)
    np.testing.assert_array_equal(metrics.inside(lower, upper, TRUTH), [True, False])
    assert metrics.containment(lower, upper, TRUTH) == 0.5
    boxes = [Orthotope(a, z) for a, z in zip(lower, upper, strict=True)]
    assert metrics.support_containment(boxes, TRUTH) == 0.5


def test_widths_and_tightness() -> None:
    exact, wide = Orthotope([0.0, 0.0, 5.0], [1.0, 1.0, 5.0]), Orthotope([0.0, 0.0, 4.0], [1.0, 3.0, 6.0])
    np.testing.assert_array_equal(metrics.mean_width([[0.0], [0.0]], [[1.0], [3.0]]), [2.0])
    assert metrics.hull_tightness(wide, exact) == 2.0
    assert metrics.volume_tightness(wide, wide) == 1.0
    assert metrics.volume_tightness(exact, exact) == 1.0
    assert metrics.volume_tightness(wide, exact) == math.inf
