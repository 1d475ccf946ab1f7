"""The promises of a mesh: the supports of real filters, in any order, with any copies, in any tree of fusions."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lsu_mesh import LSUCZ, LSUO, LSUP, LSUPB, InconsistentData, Orthotope, Support, ZonotopicKalman, fuse, simulate
from lsu_mesh import systems as papers

C = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [1.0, -1.0, 0.3], [0.5, 0.5, 1.0], [0.2, 1.0, -1.0]])
PRIOR = Orthotope([-5.0] * 3, [5.0] * 3)
KINDS = (LSUO, LSUP, LSUPB, LSUCZ, ZonotopicKalman)
STEPS = 9
SEEDS = st.integers(0, 30)


@cache
def sources(seed: int) -> tuple[tuple[Support, ...], np.ndarray]:
    """Posteriors of five filters of five kinds with one sensor each, and the true state."""
    model = papers.get("P3", rho=0.1, r=0.3).replace(C=C, r=0.3)
    made = simulate(model, STEPS, seed, x1=[1.0, 0.5, -0.5])
    filters = [kind(model.replace(C=C[i : i + 1], r=0.3), PRIOR) for i, kind in enumerate(KINDS)]
    for k in range(STEPS):
        for i, estimator in enumerate(filters):
            estimator.update(made.Y[k, i : i + 1])
            if k + 1 < STEPS:
                estimator.predict(made.U[k])
    return tuple(estimator.support for estimator in filters), made.X[-1]


def scale(supports: tuple[Support, ...]) -> float:
    return float(np.min([np.abs(support.bounds()).max() for support in supports]))


def distance(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> float:
    return float(np.abs(np.subtract(one, other)).max())


@st.composite
def trees(draw: st.DrawFn) -> list[list[int]]:
    """Groups of sources, with copies and in any order, that together name every source."""
    order = draw(st.permutations(range(len(KINDS))))
    copies = draw(st.lists(st.integers(0, len(KINDS) - 1), max_size=3))
    members = draw(st.permutations([*order, *copies]))
    cuts = sorted(draw(st.sets(st.integers(1, len(members) - 1), max_size=3)))
    return [list(members[a:b]) for a, b in zip([0, *cuts], [*cuts, len(members)], strict=True)]


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, groups=trees(), deeper=st.booleans())
def test_any_order_copies_and_tree_give_the_bounds_of_the_hub(seed: int, groups: list[list[int]], deeper: bool) -> None:
    supports, x = sources(seed)
    hub = fuse(supports)
    parts = [fuse([supports[i] for i in group]).support for group in groups]
    if deeper and len(parts) > 2:
        parts = [fuse(parts[:2]).support, *parts[2:]]
    tree = fuse(parts)
    assert distance(tree.bounds, hub.bounds) <= 1e-9 * scale(supports)
    for fused in (hub, tree):
        assert (fused.bounds[0] <= x).all()
        assert (x <= fused.bounds[1]).all()
        assert fused.support.contains(x)


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_the_fused_set_lies_inside_every_source(seed: int) -> None:
    supports, _ = sources(seed)
    fused = fuse(supports)
    vertices = fused.support.vertices()
    assert len(vertices) >= 4
    directions = np.random.default_rng(seed).normal(size=(10, 3))
    for source in supports:
        lower, upper = source.bounds()
        assert (fused.bounds[0] >= lower).all()
        assert (fused.bounds[1] <= upper).all()
        for d in directions:
            slack = 1e-9 * scale(supports) * np.abs(d).sum()
            assert fused.support.support(d) <= source.support(d) + slack
            assert (vertices @ d).max() <= source.support(d) + slack


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS)
def test_one_source_more_never_widens(seed: int) -> None:
    supports, _ = sources(seed)
    rounding = 1e-9 * scale(supports)
    for k in range(1, len(supports)):
        fewer, more = fuse(supports[:k]), fuse(supports[: k + 1])
        assert (more.bounds[0] >= fewer.bounds[0] - rounding).all()
        assert (more.bounds[1] <= fewer.bounds[1] + rounding).all()


@settings(max_examples=20, deadline=None)
@given(seed=SEEDS, order=st.permutations(range(len(KINDS))))
def test_relaxed_fusion_does_not_depend_on_the_order_and_holds_the_intersection(seed: int, order: list[int]) -> None:
    supports, x = sources(seed)
    strict, relaxed = fuse(supports), fuse(supports, "relaxed", 1)
    shuffled = fuse([supports[i] for i in order], "relaxed", 1)
    rounding = 1e-9 * scale(supports)
    assert distance(shuffled.bounds, relaxed.bounds) <= rounding
    assert (relaxed.bounds[0] <= strict.bounds[0] + rounding).all()
    assert (relaxed.bounds[1] >= strict.bounds[1] - rounding).all()
    assert relaxed.rejected == ()
    assert relaxed.support.contains(x)


def test_posteriors_of_different_truths_are_proved_disjoint() -> None:
    supports, x = sources(0)
    away = Orthotope(x + 7.0, x + 7.5)
    with pytest.raises(InconsistentData):
        fuse([*supports, away])
    assert fuse([*supports, away], "relaxed", 1).rejected == (len(supports),)
