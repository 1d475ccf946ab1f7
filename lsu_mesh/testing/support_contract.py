"""What every set promises: each operation gives a set that holds the exact result, rounding included."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from fractions import Fraction

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.errors import ModelError
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.support import Support
from lsu_mesh.testing.exact_plant import Exact, exact_product, inside_box
from lsu_mesh.testing.filter_cases import SHAPES, around
from lsu_mesh.testing.membership import exceeds, is_outside, numbers_of
from lsu_mesh.testing.support_samples import Draw, Sample, draw_for

SEEDS = 40
SCALES = (1.0, 1e-6, 1e6, 1.0, 1e100, 1e-100)
"""Sizes of the sets; a volume of them may be no double."""
DIMENSIONS = 4
DIRECTIONS = 4
FEW = 4
"""Members that are carried through an operation: each exact decision takes milliseconds."""
DRAWN = 1e-6
"""Share of a set's width that its vertices, which are computed in floating point for drawing, may be away."""
FLAT = 1e-9
"""A volume below this share of the hull's is that of a flat set."""


def check_support(cls: type[Support], draw: Draw | None = None, seeds: int | Iterable[int] = SEEDS) -> None:
    """Check every operation of the contract :class:`~lsu_mesh.supports.support.Support` on a class of your own.

    Parameters
    ----------
    cls:
        The class.
    draw:
        ``(rng, n, scale) → Sample(support, members)``: a set of the class in n dimensions, about ``scale`` wide, and
        exact points (lists of ``Fraction``) that lie in it by construction, at its edges where they can. Not needed for
        a subclass of a class of this library that keeps its constructor.
    seeds:
        Seeds of the sets, or how many.

    Raises
    ------
    AssertionError
        Names the class, the seed, the operation, what was found and what was expected.
    """
    chosen = draw or draw_for(cls)
    if chosen is None:
        raise AssertionError(
            f"check_support does not know how sets of {cls.__name__} are made; give draw(rng, n, scale)"
        )
    for seed in range(seeds) if isinstance(seeds, int) else seeds:
        rng = np.random.default_rng(seed)
        n, scale = 1 + seed % DIMENSIONS, SCALES[seed % len(SCALES)]
        sample = chosen(rng, n, scale)
        if not isinstance(sample.support, cls) or not sample.members:
            raise AssertionError(f"draw gives {sample}; expected a {cls.__name__} and points of it")
        _Check(sample, rng, scale, f"{cls.__name__} in {n} dimension(s), seed {seed}").all()


class _Check:
    """One set and its members."""

    def __init__(self, sample: Sample, rng: np.random.Generator, scale: float, where: str) -> None:
        self._set, self._members = sample
        self._rng, self._scale, self._where = rng, scale, where

    def all(self) -> None:
        """Every operation; the set is the same after them."""
        before = numbers_of(self._set)
        self._holds("itself", self._set, self._members, decided=True)
        self._shape()
        self._arrays_are_its_own()
        self._hull()
        self._contains()
        self._conversion()
        self._linear_map()
        self._minkowski_sum()
        self._intersection()
        self._volume_and_vertices()
        self._mistakes()
        self._expect(numbers_of(self._set) == before, "immutability", "other numbers after the operations", "the same")

    def _failure(self, operation: str, found: str, expected: str) -> AssertionError:
        return AssertionError(f"{self._where}, {operation}: found {found}; expected {expected}")

    def _expect(self, holds: bool, operation: str, found: str, expected: str) -> None:
        if not holds:
            raise self._failure(operation, found, expected)

    def _holds(self, operation: str, support: Support, members: list[Exact], *, decided: bool = False) -> None:
        """Exact members lie in the set, in its bounds, and below its support function."""
        self._expect(not support.is_empty(), operation, "is_empty() is true", f"a set with {_shown(members[0])} in it")
        lower, upper = support.bounds()
        directions = self._rng.normal(size=(DIRECTIONS, support.dim)).tolist()
        for x in members:
            if not inside_box(lower, upper, x):
                raise self._failure(operation, f"bounds [{lower}, {upper}]", f"bounds that hold {_shown(x)}")
            if is_outside(support, x, decided=decided):
                raise self._failure(operation, f"a set without {_shown(x)}", "a set that holds it")
            for d in directions:
                if exceeds(support, d, x):
                    raise self._failure(
                        operation, f"support({d}) = {support.support(d)!r}", f"d'x of {_shown(x)} or more"
                    )

    def _shape(self) -> None:
        n, center = len(self._members[0]), self._set.center
        self._expect(self._set.dim == n, "dim", str(self._set.dim), str(n))
        self._expect(center.shape == (n,) and bool(np.isfinite(center).all()), "center", str(center), f"{n} numbers")

    def _arrays_are_its_own(self) -> None:
        """What is written into returned arrays does not change the set."""
        before = numbers_of(self._set)
        for array in (*self._set.bounds(), self._set.center):
            if array.flags.writeable:
                array += self._scale
        self._expect(numbers_of(self._set) == before, "bounds() or center", "the set's own arrays, writable", "copies")

    def _hull(self) -> None:
        """The bounds are the support function along the axes, and the interval hull is their box."""
        lower, upper = self._set.bounds()
        box = self._set.interval_hull()
        same = (box.lower == lower).all() and (box.upper == upper).all()
        self._expect(bool(same), "interval_hull", f"[{box.lower}, {box.upper}]", f"[{lower}, {upper}], the bounds")
        slack = DRAWN * float(np.max(upper - lower, initial=0.0)) + FLAT * float(np.abs([lower, upper]).max())
        for i, axis in enumerate(np.eye(self._set.dim)):
            high, low = self._set.support(axis), -self._set.support(-axis)
            self._expect(
                bool(upper[i] <= high + slack and lower[i] >= low - slack), "bounds",
                f"[{lower[i]}, {upper[i]}] in coordinate {i}", f"the hull, [{low}, {high}] by the support function",
            )  # fmt: skip

    def _contains(self) -> None:
        """Members that are doubles are never excluded."""
        for x in self._members:
            point = [float(v) for v in x]
            if point == x and not self._set.contains(point):
                raise self._failure("contains", f"False for {point}", "True, the point lies in the set")

    def _conversion(self) -> None:
        self._holds("to_constrained_zonotope", self._set.to_constrained_zonotope(), self._members[:FEW])

    def _linear_map(self) -> None:
        n = self._set.dim
        square = self._rng.normal(size=(n, n))
        singular = np.outer(square[0], square[-1])
        for name, R in (("square", square), ("singular", singular), ("to one coordinate", square[:1])):
            shift = self._scale * self._rng.normal(size=len(R))
            moved = [_moved(R, shift, x) for x in self._members[:FEW]]
            self._holds(f"linear_map, {name}", self._set.linear_map(R, shift), moved)
        self._holds("linear_map without a shift", self._set.linear_map(square), [
            exact_product(square, x) for x in self._members[:FEW]
        ])  # fmt: skip

    def _partners(self, x: Exact) -> list[Support]:
        """Sets of other classes, x at the edge of each."""
        lower, upper = self._set.bounds()
        made = [
            around(x, shape, np.maximum(upper - lower, 0.1 * self._scale), own=self._set, rng=self._rng)
            for shape in SHAPES
        ]
        return [one for one in made if one is not None]

    def _minkowski_sum(self) -> None:
        other = self._members[0]
        for partner in self._partners(other):
            sums = [[a + b for a, b in zip(x, other, strict=True)] for x in self._members[:FEW]]
            name = type(partner).__name__
            self._holds(f"minkowski_sum with {name}", self._set.minkowski_sum(partner), sums)
            self._holds(f"minkowski_sum of {name} with it", partner.minkowski_sum(self._set), sums[:1])

    def _intersection(self) -> None:
        x = self._members[-1]
        for partner in self._partners(x):
            common = [x, *(one for one in self._members[:FEW] if not is_outside(partner, one))]
            name = type(partner).__name__
            self._holds(f"intersect with {name}", self._set.intersect(partner), common)
            self._holds(f"intersect of {name} with it", partner.intersect(self._set), common[:1])

    def _volume_and_vertices(self) -> None:
        """The volume is not below that of the members' hull, the vertices span what the bounds say."""
        volume, logarithm, n = self._set.volume(), self._set.log_volume(), self._set.dim
        self._expect(volume >= 0.0, "volume", str(volume), "a number, not negative")
        self._expect(not math.isnan(logarithm), "log_volume", str(logarithm), "a number or -inf")
        vertices, (lower, upper) = self._set.vertices(), self._set.bounds()
        self._expect(vertices.ndim == 2 and vertices.shape[1] == n, "vertices", f"shape {vertices.shape}", f"(k, {n})")
        slack = DRAWN * float((upper - lower).max()) + FLAT * float(np.abs([lower, upper]).max())
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        for name, side, end in (("lower", lower, low), ("upper", upper, high)):
            if (np.abs(side - end) > slack).any():
                raise self._failure("vertices", f"vertices that end at {end}", f"{side}, the {name} bounds")
        inner = _hull_volume(self._members, self._scale)
        if 1e-30 < self._scale < 1e30 and volume < inner * self._scale**n * (1.0 - DRAWN) - FLAT * float(
            np.prod(upper - lower)
        ):
            raise self._failure("volume", str(volume), f"at least {inner * self._scale**n}, that of points in the set")

    def _mistakes(self) -> None:
        """Arguments of another dimension are refused, and numbers that are none."""
        n = self._set.dim
        wide = Orthotope(np.zeros(n + 1), np.ones(n + 1))
        acts: dict[str, Callable[[], object]] = {
            "contains a point of another dimension": lambda: self._set.contains(np.zeros(n + 1)),
            "contains NaN": lambda: self._set.contains(np.full(n, np.nan)),
            "support of another dimension": lambda: self._set.support(np.zeros(n + 1)),
            "linear_map of another dimension": lambda: self._set.linear_map(np.eye(n + 1)),
            "minkowski_sum of another dimension": lambda: self._set.minkowski_sum(wide),
            "intersect with another dimension": lambda: self._set.intersect(wide),
        }
        for name, act in acts.items():
            try:
                act()
            except ModelError:
                continue
            raise self._failure(name, "no error", "ModelError")


def _moved(R: Matrix, shift: Vector, x: Exact) -> Exact:
    """``R x + shift`` without rounding."""
    return [v + Fraction(s) for v, s in zip(exact_product(R, x), shift.tolist(), strict=True)]


def _hull_volume(members: list[Exact], scale: float) -> float:
    """Volume of the convex hull of points, in units of the scale; 0 for a flat one."""
    from scipy.spatial import ConvexHull, QhullError

    points = np.array([[float(v) for v in x] for x in members]) / scale
    if points.shape[1] == 1:
        return float(np.ptp(points))
    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0


def _shown(x: Exact) -> str:
    return str([float(v) for v in x])
