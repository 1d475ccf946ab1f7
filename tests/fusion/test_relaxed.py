"""Relaxed fusion holds the state whatever at most q sources say, and names those that are proved wrong."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import InconsistentData, ModelError, Orthotope, Parallelotope, Support, fuse
from lsu_mesh.fusion import relaxed
from lsu_mesh.fusion.relaxed import fuse_relaxed


def _intervals(*ends: tuple[float, float]) -> list[Support]:
    return [Orthotope([low], [high]) for low, high in ends]


def test_a_liar_far_away_is_named_and_costs_nothing() -> None:
    sources = _intervals((0.0, 1.0), (0.2, 1.2), (0.1, 0.9), (5.0, 6.0))
    fused = fuse(sources, policy="relaxed", faults=1)
    assert fused.rejected == (3,)
    assert [side[0] for side in fused.bounds] == [0.2, 0.9]
    assert fused.support.contains([0.5])


def test_a_liar_that_overlaps_cannot_cut_off_the_truth() -> None:
    """The largest consistent family is {0, 2}, in [1.6, 1.8], while the truth is 1.2 and source 2 lies."""
    sources = _intervals((1.0, 1.8), (1.0, 1.5), (1.6, 2.5))
    fused = fuse(sources, policy="relaxed", faults=1)
    assert fused.rejected == ()
    assert [side[0] for side in fused.bounds] == [1.0, 1.8]
    assert fused.support.contains([1.2])


def test_with_one_consistent_family_the_fused_set_keeps_its_shape() -> None:
    slanted = Parallelotope([0.0, 0.0], [[1.0, 0.1], [1.0, -0.1]])
    fused = fuse([slanted, Orthotope([-0.5] * 2, [0.5] * 2), Orthotope([3.0] * 2, [4.0] * 2)], "relaxed", 1)
    assert fused.rejected == (2,)
    assert fused.support.support([1.0, -1.0]) == pytest.approx(0.2, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_truth_is_held_whatever_the_liars_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(3, 7)), int(rng.integers(1, 3))
    faults = int(rng.integers(1, (m + 1) // 2 + 1))
    x = rng.normal(size=n)
    liars = set(rng.choice(m, size=faults, replace=False).tolist())
    sources: list[Support] = []
    for i in range(m):
        middle = x + (rng.normal(size=n) if i in liars else rng.uniform(-0.4, 0.4, n))
        around: Support = Orthotope(middle - 0.5, middle + 0.5)
        if i % 2:
            around = Parallelotope(middle, 0.5 * np.eye(n) + 0.05)
        sources.append(around)
    wrong = [i for i in range(m) if not sources[i].contains(x)]
    if len(wrong) > faults:
        return
    fused = fuse(sources, "relaxed", faults)
    assert (fused.bounds[0] <= x).all()
    assert (x <= fused.bounds[1]).all()
    assert fused.support.contains(x)
    assert set(fused.rejected) <= set(wrong)
    by_coordinate = relaxed._fuse_coordinates([s.bounds() for s in sources], faults)
    assert (by_coordinate.bounds[0] <= fused.bounds[0]).all()
    assert (by_coordinate.bounds[1] >= fused.bounds[1]).all()
    assert set(by_coordinate.rejected) <= set(wrong)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 4)), min_size=2, max_size=7), st.integers(0, 3))
def test_coordinates_equal_a_count_at_every_point(intervals: list[tuple[int, int]], faults: int) -> None:
    ends = [(float(low), float(low + width)) for low, width in intervals]
    if faults >= len(ends):
        return
    grid = [k / 2 for k in range(30)]
    enough = [x for x in grid if sum(low <= x <= high for low, high in ends) >= len(ends) - faults]
    bounds = [s.bounds() for s in _intervals(*ends)]
    if not enough:
        with pytest.raises(InconsistentData, match=f"more than {faults} are wrong"):
            relaxed._fuse_coordinates(bounds, faults)
        return
    fused = relaxed._fuse_coordinates(bounds, faults)
    assert [side[0] for side in fused.bounds] == [enough[0], enough[-1]]
    alone = {i for i, (low, high) in enumerate(ends) if not any(low <= x <= high for x in enough)}
    assert set(fused.rejected) == alone


def test_many_sources_are_fused_by_coordinates() -> None:
    sources = [Orthotope([0.0, i / 100], [1.0, 1.0 + i / 100]) for i in range(18)] + [
        Orthotope([7.0] * 2, [8.0] * 2)
    ] * 4
    fused = fuse(sources, "relaxed", 6)
    assert fused.rejected == (18, 19, 20, 21)
    # all but two of the 18 honest ones must agree: up to two may be left out on each side
    assert fused.bounds[1] == pytest.approx([1.0, 1.02])
    assert fused.bounds[0] == pytest.approx([0.0, 0.15])


def test_too_many_wrong_sources_are_reported() -> None:
    sources = _intervals((0.0, 1.0), (2.0, 3.0), (4.0, 5.0))
    with pytest.raises(InconsistentData, match="more than 1 are wrong"):
        fuse(sources, "relaxed", 1)
    assert fuse(sources, "relaxed", 2).bounds[1] == pytest.approx([5.0])


def test_no_faults_is_the_intersection() -> None:
    sources = _intervals((0.0, 1.0), (0.5, 2.0))
    for fused in (fuse(sources, "relaxed", 0), fuse_relaxed(sources, 0)):
        assert [side[0] for side in fused.bounds] == [0.5, 1.0]


@pytest.mark.parametrize("faults", [-1, 3])
def test_impossible_numbers_of_faults_are_refused(faults: int) -> None:
    with pytest.raises(ModelError, match="faults must be"):
        fuse(_intervals((0.0, 1.0), (0.5, 2.0), (0.0, 2.0)), "relaxed", faults)


def test_the_result_does_not_depend_on_the_order() -> None:
    sources = _intervals((0.0, 1.0), (0.4, 1.2), (0.9, 2.0), (1.1, 1.3))
    bounds = {
        tuple(float(side[0]) for side in fuse(list(order), "relaxed", 1).bounds)
        for order in itertools.permutations(sources)
    }
    assert len(bounds) == 1
