"""What every fusion policy promises: the state stays, whatever wrong sources say and in whatever order they come."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction

import numpy as np

from lsu_mesh.errors import InconsistentData, ModelError
from lsu_mesh.fusion.fuse import fuse
from lsu_mesh.fusion.intersection import Fusion
from lsu_mesh.fusion.policies import POLICIES
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support
from lsu_mesh.testing.exact_plant import Exact, inside_box
from lsu_mesh.testing.filter_cases import around, box_around
from lsu_mesh.testing.membership import is_outside

SEEDS = 40
MAX_SOURCES, DIMENSIONS = 6, 3
MAX_PLANTED = 24
"""Families of sources that get a common point of their own, where there are more."""
MANY = (13, 4)
"""Sources and faults of which there are too many families to form them all."""
ROUNDING = 1e-9
"""Share of the sources' size by which order and copies may move the bounds: rounding of linear programs."""


def fusion_policies() -> tuple[str, ...]:
    """Names of all policies."""
    return tuple(POLICIES)


def check_policy(name: str, faults: Iterable[int] | None = None, seeds: int | Iterable[int] = SEEDS) -> None:
    """Check the promises of a fusion policy, called as ``fuse(supports, name, faults)``.

    Parameters
    ----------
    name:
        The policy.
    faults:
        Numbers of wrong sources that it takes; by default 0, and 1 and 2 where it does not refuse them.
    seeds:
        Seeds of the sources, or how many.

    Raises
    ------
    AssertionError
        Names the policy, the seed, what was found and what was expected.

    The truth lies in all but ``faults`` of the sources, exactly and at their edges. Each family of sources that may be
    the right ones has a common point of its own, so that a family that is forgotten loses it.
    """
    taken = tuple(faults) if faults is not None else tuple(q for q in range(3) if q == 0 or _takes(name, q))
    for seed in range(seeds) if isinstance(seeds, int) else seeds:
        rng = np.random.default_rng(seed)
        for q in taken:
            m = int(rng.integers(q + 2, MAX_SOURCES + 1))
            check = _Check(name, q, f"policy {name!r}, {m} sources, {q} of them wrong, seed {seed}", rng)
            check.truth(m, 1 + seed % DIMENSIONS)
            check.families(m, 1 + seed % DIMENSIONS)
            check.far_sources(m, 1 + seed % DIMENSIONS)
    if any(taken):
        m, q = MANY
        check = _Check(name, q, f"policy {name!r}, {m} sources, {q} of them wrong", np.random.default_rng(0))
        check.families(m, 2)
        check.far_sources(m, 2)
    _check_no_sources(name)


def _takes(name: str, faults: int) -> bool:
    """Whether the policy allows wrong sources."""
    boxes = [Orthotope([0.0], [1.0])] * (faults + 2)
    try:
        fuse(boxes, name, faults)
    except ModelError:
        return False
    return True


class _Check:
    """One policy with one number of wrong sources."""

    def __init__(self, name: str, faults: int, where: str, rng: np.random.Generator) -> None:
        self._name, self._faults, self._where, self._rng = name, faults, where, rng

    def truth(self, m: int, n: int) -> None:
        """Sources of several classes around a truth, wrong ones anywhere: it stays, in any order and with copies."""
        x, sources = self._sources(m, n)
        wrong = [i for i, source in enumerate(sources) if is_outside(source, x)]
        if len(wrong) > self._faults:
            return
        fused = self._fuse(sources, "sources around a truth")
        self._holds(fused, [x], "sources around a truth")
        accused = sorted(set(fused.rejected) - set(wrong))
        self._expect(not accused, "sources around a truth", f"the right sources {accused} rejected", f"some of {wrong}")
        self._order(sources, fused)
        self._copies(sources, fused, x)

    def families(self, m: int, n: int) -> None:
        """Boxes such that every family of m − faults of them has a common point of its own: all of them stay."""
        size = m - self._faults
        every = list(itertools.combinations(range(m), size))
        chosen = [every[i] for i in self._rng.permutation(len(every))[:MAX_PLANTED].tolist()]
        points = [[Fraction(v) for v in self._rng.normal(size=n).tolist()] for _ in chosen]
        sources: list[Support] = []
        for i in range(m):
            own = [point for family, point in zip(chosen, points, strict=True) if i in family]
            sources.append(box_around(own or points))
        fused = self._fuse(sources, "families with a common point each")
        self._holds(fused, points, "families with a common point each")

    def far_sources(self, m: int, n: int) -> None:
        """Wrong sources far from all others are named; one more of them than is allowed is told."""
        right = m - self._faults
        if right < 2:
            return
        near: list[Support] = [Orthotope(-np.ones(n) - self._rng.random(n), np.ones(n)) for _ in range(right)]
        far: list[Support] = [
            Orthotope(np.full(n, 10.0 * k), np.full(n, 10.0 * k + 1.0)) for k in range(1, self._faults + 2)
        ]
        order = self._rng.permutation(m).tolist()
        sources = [[*near, *far[:-1]][i] for i in order]
        expected = tuple(sorted(order.index(right + k) for k in range(self._faults)))
        fused = self._fuse(sources, "wrong sources far away")
        self._holds(fused, [[Fraction(0)] * n], "wrong sources far away")
        self._expect(
            tuple(fused.rejected) == expected, "wrong sources far away", f"{fused.rejected} rejected", f"{expected}"
        )
        try:
            fused = fuse([*near[1:], *far], self._name, self._faults)
        except InconsistentData:
            return
        if right > 2:
            raise self._failure("one wrong source too many", f"the bounds {fused.bounds}", "InconsistentData")

    def _sources(self, m: int, n: int) -> tuple[Exact, list[Support]]:
        x = [Fraction(v) for v in self._rng.normal(size=n).tolist()]
        widths, whole = np.ones(n), Orthotope(np.full(n, -9.0), np.full(n, 9.0))
        sources: list[Support] = []
        while len(sources) < m:
            center = x
            if len(sources) < self._faults:
                center = [v + Fraction(s) for v, s in zip(x, self._rng.normal(size=n).tolist(), strict=True)]
            shape = str(self._rng.choice(("box", "parallelotope", "zonotope")))
            made = around(center, shape, widths, own=whole, rng=self._rng)
            if made is not None:
                sources.append(made)
        order = self._rng.permutation(m).tolist()
        return x, [sources[i] for i in order]

    def _fuse(self, sources: Sequence[Support], what: str) -> Fusion:
        try:
            return fuse(sources, self._name, self._faults)
        except InconsistentData as error:
            text = "a set, enough of the sources have a common point"
            raise self._failure(what, f"InconsistentData: {error}", text) from error

    def _holds(self, fused: Fusion, points: Sequence[Exact], what: str) -> None:
        """Exact points lie in the fused set and in its bounds, which fit together."""
        lower, upper = fused.bounds
        for x in points:
            shown = [float(v) for v in x]
            self._expect(inside_box(lower, upper, x), what, f"bounds [{lower}, {upper}]", f"bounds that hold {shown}")
            self._expect(not is_outside(fused.support, x), what, f"{fused.support!r}", f"a set that holds {shown}")
        is_within = (lower <= fused.point).all() and (fused.point <= upper).all()
        self._expect(bool(is_within), what, f"the point {fused.point}", f"a point of the bounds [{lower}, {upper}]")

    def _order(self, sources: Sequence[Support], fused: Fusion) -> None:
        order = self._rng.permutation(len(sources)).tolist()
        other = self._fuse([sources[i] for i in order], "another order")
        self._same(other, fused, sources, "another order")
        named = tuple(sorted(order[i] for i in other.rejected))
        self._expect(named == tuple(sorted(fused.rejected)), "another order", f"{named} rejected", f"{fused.rejected}")

    def _copies(self, sources: Sequence[Support], fused: Fusion, x: Exact) -> None:
        """A copy says nothing new where all sources are right; where some may be wrong it is one source more."""
        if self._faults == 0:
            self._same(
                self._fuse([*sources, *sources], "copies of all sources"), fused, sources, "copies of all sources"
            )
            return
        right = next(source for source in sources if not is_outside(source, x))
        self._holds(self._fuse([*sources, right], "a copy of a right source"), [x], "a copy of a right source")

    def _same(self, one: Fusion, other: Fusion, sources: Sequence[Support], what: str) -> None:
        slack = ROUNDING * max(float(np.abs(source.bounds()).max()) for source in sources)
        distance = float(np.abs(np.subtract(one.bounds, other.bounds)).max())
        self._expect(distance <= slack, what, f"bounds {one.bounds}", f"those before, {other.bounds}")

    def _failure(self, what: str, found: str, expected: str) -> AssertionError:
        return AssertionError(f"{self._where}, {what}: found {found}; expected {expected}")

    def _expect(self, holds: bool, what: str, found: str, expected: str) -> None:
        if not holds:
            raise self._failure(what, found, expected)


def _check_no_sources(name: str) -> None:
    """No source, and sources of different dimensions, are refused."""
    box, square = Orthotope([0.0], [1.0]), Orthotope([0.0, 0.0], [1.0, 1.0])
    acts: dict[str, Callable[[], Fusion]] = {
        "no source": lambda: fuse([], name),
        "sources of different dimensions": lambda: fuse([box, square], name),
    }
    for what, act in acts.items():
        try:
            act()
        except ModelError:
            continue
        raise AssertionError(f"policy {name!r}, {what}: found no error; expected ModelError")
