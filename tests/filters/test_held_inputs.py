"""Inputs between their switches, some of which take place nobody knows when: every input that can act is told."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lsu_mesh import ModelError, Orthotope
from lsu_mesh.filters.held_inputs import HeldInputs, Input

TIMES, VALUES, DELAYS = (10, 20, 35), (1.0, -2.0, 5.0), (4, 0, 7)
BEFORE = 3.0
HELD = HeldInputs(TIMES, [np.array([v]) for v in VALUES], before=np.array([BEFORE]), delay_ns=DELAYS)


def acting(late: tuple[int, ...], t: int) -> float:
    """What acts from t on, where the switches come so late."""
    value = BEFORE
    for time, after, following in zip(TIMES, late, VALUES, strict=True):
        value = following if t >= time + after else value
    return value


COURSES = list(itertools.product(*(range(delay + 1) for delay in DELAYS)))
"""Every way in which the switches may come."""


def ends(u: Input) -> tuple[float, float]:
    assert u is not None
    low, high = u.bounds() if isinstance(u, Orthotope) else (u, u)
    return float(low[0]), float(high[0])


@pytest.mark.parametrize("start", range(0, 46, 3))
def test_the_hull_is_that_of_all_inputs_that_can_act(start: int) -> None:
    for end in range(start, 50, 4):
        possible = [acting(late, t) for late in COURSES for t in range(start, end + 1)]
        low, high = ends(HELD.hull(start, end))
        assert low <= min(possible)
        assert high >= max(possible)
        if start == end and all(not time < start < time + delay for time, delay in zip(TIMES, DELAYS, strict=True)):
            assert (low, high) == (min(possible), max(possible))


def test_pieces_are_of_one_input_or_say_that_it_varies() -> None:
    for start in range(45):
        now = start
        for piece in HELD.pieces(start, 50):
            moments = range(now, now + piece.length_ns)
            possible = {acting(late, t) for late in COURSES for t in moments}
            low, high = ends(piece.u)
            assert low <= min(possible) <= max(possible) <= high
            assert piece.varies or possible == {low}
            now += piece.length_ns
        assert now == 50


@pytest.mark.parametrize("delays", [(11, 0, 0), (0, -1, 0), (0, 0)])
def test_delays_that_cannot_be_are_refused(delays: tuple[int, ...]) -> None:
    with pytest.raises(ModelError):
        HeldInputs(TIMES, [np.array([v]) for v in VALUES], delay_ns=delays)
