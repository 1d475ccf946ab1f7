"""Fusion by intersection: mixed kinds, any order, never wider than a source, empty only with a proof."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import (
    ConstrainedZonotope,
    InconsistentData,
    ModelError,
    Orthotope,
    Parallelotope,
    Support,
    Zonotope,
    fuse,
)


def _sources(seed: int, n: int = 2) -> tuple[list[Support], np.ndarray]:
    """One set of each kind around a common point."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=n)
    sets: list[Support] = [
        Orthotope(x - rng.random(n), x + rng.random(n)),
        Parallelotope(x + rng.uniform(-0.2, 0.2, n), np.eye(n) + 0.3 * rng.normal(size=(n, n))),
    ]
    G, xi = rng.normal(size=(n, n + 3)), rng.uniform(-0.5, 0.5, n + 3)
    A = rng.normal(size=(1, n + 3))
    sets.append(ConstrainedZonotope(x - G @ xi, G, A, A @ xi))
    sets.append(Zonotope(x - 0.1, rng.normal(size=(n, n + 1)) + np.eye(n, n + 1)))
    return [s for s in sets if s.contains(x)], x


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_order_copies_and_grouping_do_not_matter(seed: int) -> None:
    sources, x = _sources(seed)
    reference = fuse(sources)
    scale = max(np.abs(s.bounds()).max() for s in sources)
    groupings = [
        sources[::-1],
        [*sources, sources[0], sources[-1]],
        [fuse(sources[:2]).support, *sources[2:]],
        [fuse(sources[:2]).support, fuse(sources[1:]).support],
    ]
    for grouping in groupings:
        fused = fuse(grouping)
        assert np.abs(np.subtract(fused.bounds, reference.bounds)).max() <= 1e-9 * scale
        assert fused.support.contains(x)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_the_fused_set_lies_inside_every_source(seed: int, n: int) -> None:
    sources, x = _sources(seed, n)
    fused = fuse(sources)
    lower, upper = fused.bounds
    assert (lower <= x).all()
    assert (x <= upper).all()
    assert fused.rejected == ()
    assert fused.support.contains(fused.point)
    assert ((lower <= fused.point) & (fused.point <= upper)).all()
    directions = np.random.default_rng(seed).normal(size=(6, n))
    for source in sources:
        assert (lower >= source.bounds()[0]).all()
        assert (upper <= source.bounds()[1]).all()
        for d in directions:
            assert (
                fused.support.support(d) <= source.support(d) + 1e-9 * np.abs(d).sum() * np.abs(source.bounds()).max()
            )


def test_different_parallelotopes_fuse_to_less_than_either() -> None:
    one = Parallelotope([0.0, 0.0], [[1.0, 0.0], [0.0, 0.1]])
    other = Parallelotope([0.0, 0.0], [[0.1, 0.0], [0.0, 1.0]])
    assert fuse([one, other]).support.volume() == pytest.approx(0.04, rel=1e-9)


def test_a_single_source_is_itself() -> None:
    box = Orthotope([0.0], [1.0])
    fused = fuse([box])
    assert fused.support is box
    assert fused.bounds[0] == pytest.approx([0.0])


def test_contradicting_sources_are_proved_so() -> None:
    with pytest.raises(InconsistentData, match="no common point"):
        fuse([Orthotope([0.0], [1.0]), Orthotope([1.1], [2.0])])
    touching = fuse([Orthotope([0.0], [1.0]), Orthotope([1.0], [2.0])])
    assert touching.bounds == (np.array([1.0]), np.array([1.0]))


def test_pairs_may_agree_where_all_do_not() -> None:
    """Three strips of a triangle: every two cross, all three do not."""
    bars = [
        Parallelotope([0.0, 0.0], [[2.0, 0.0], [0.0, 0.05]]),
        Parallelotope([0.0, 1.0], [[1.5, -0.05], [1.5, 0.05]]),
        Parallelotope([0.0, 1.0], [[1.5, 0.05], [-1.5, 0.05]]),
    ]
    for pair in itertools.combinations(bars, 2):
        fuse(pair)
    with pytest.raises(InconsistentData):
        fuse(bars)


def test_wrong_arguments_are_named() -> None:
    box = Orthotope([0.0], [1.0])
    with pytest.raises(ModelError, match="at least one support"):
        fuse([])
    with pytest.raises(ModelError, match="policy"):
        fuse([box], policy="vote")
    with pytest.raises(ModelError, match="relaxed"):
        fuse([box, box], faults=1)
    with pytest.raises(ModelError, match="same dimension"):
        fuse([box, Orthotope([0.0, 0.0], [1.0, 1.0])])
