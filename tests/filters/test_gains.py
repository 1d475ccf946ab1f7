"""The gain of a transfer by exact volumes, by hulls, and as each class measures it at no cost."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from lsu_mesh import LSUCZ, LSUO, LSUP, LSUPB, LSUModel, ModelError, Orthotope, Parallelotope, ZonotopicKalman
from lsu_mesh.filters.filter import Filter

MODEL = LSUModel(np.eye(2), None, [[1.0, 1.0]], 0.1, 0.1)
SQUARE = Orthotope([-1.0, -1.0], [1.0, 1.0])
BAND = Parallelotope([0.0, 0.0], [[1.0, 0.1], [-1.0, 0.1]])
"""|x₁ + x₂| ≤ .2, |x₁ − x₂| ≤ 2: it touches every side of the square and leaves .76 of the area of 4."""


def test_a_strip_that_leaves_the_hull_gains_by_the_volume_of_the_set() -> None:
    assert LSUCZ(MODEL, SQUARE).condition(BAND, "hull") == pytest.approx(0.0, abs=1e-9)
    found = LSUCZ(MODEL, SQUARE).condition(BAND, "support")
    assert found == pytest.approx(math.log(4.0 / 0.76), abs=1e-9)  # 5.3-fold
    assert LSUCZ(MODEL, SQUARE).condition(BAND) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("kind", [LSUO, LSUP, LSUPB, LSUCZ, ZonotopicKalman])
def test_gains_are_those_of_the_sets_before_and_after(kind: Callable[..., Filter]) -> None:
    for gain in ("support", "hull"):
        filter, other = kind(MODEL, SQUARE), kind(MODEL, SQUARE)
        found = filter.condition(BAND, gain)
        other.condition(BAND)
        np.testing.assert_array_equal(filter.bounds(), other.bounds())
        sides = [np.subtract(*one.bounds()[::-1]) for one in (kind(MODEL, SQUARE), filter)]
        volumes = [one.support.volume() for one in (kind(MODEL, SQUARE), filter)]
        expected = volumes if gain == "support" else [np.prod(side) for side in sides]
        assert found == pytest.approx(max(0.0, math.log(expected[0] / expected[1])), abs=1e-9)


def test_another_word_is_refused() -> None:
    with pytest.raises(ModelError, match='gain must be "support", "hull" or None'):
        LSUCZ(MODEL, SQUARE).condition(BAND, "volume")  # type: ignore[arg-type]
