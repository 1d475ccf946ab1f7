"""Every class of sets keeps the contract; sets that do not fail."""

from __future__ import annotations

import importlib
import pkgutil
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from lsu_mesh import ConstrainedZonotope, Intersection, Orthotope, Parallelotope, Support, Zonotope, supports
from lsu_mesh.testing import Sample, check_support


def classes_of_sets() -> list[type[Support]]:
    """All that the package holds, found in its modules: a new one is checked without being listed."""
    for module in pkgutil.iter_modules(supports.__path__):
        importlib.import_module(f"{supports.__name__}.{module.name}")
    found = [cls for cls in Support.__subclasses__() if cls.__module__.startswith(f"{supports.__name__}.")]
    return sorted(found, key=lambda cls: cls.__name__)


def test_all_classes_are_found() -> None:
    assert classes_of_sets() == [ConstrainedZonotope, Intersection, Orthotope, Parallelotope, Zonotope]


@pytest.mark.parametrize("cls", classes_of_sets())
def test_every_set_keeps_the_contract(cls: type[Support]) -> None:
    check_support(cls, seeds=16)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("cls", classes_of_sets())
def test_every_set_keeps_the_contract_in_many_cases(cls: type[Support]) -> None:
    check_support(cls, seeds=range(100, 3000))


class SmallHull(Zonotope):
    """Forgets the last generator."""

    def bounds(self) -> Any:
        return Zonotope(self.center, self.generators[:, :-1]).bounds()


class RoundedInward(Orthotope):
    """Nearly right: one unit in the last place."""

    def bounds(self) -> Any:
        return np.nextafter(self.lower, np.inf), self.upper


class WideHull(Parallelotope):
    def bounds(self) -> Any:
        lower, upper = super().bounds()
        return lower - 0.01 * (upper - lower), upper


class SmallSupport(Orthotope):
    def support(self, d: Any) -> float:
        return float(np.asarray(d) @ self.center + (1 - 1e-9) * np.abs(d) @ (0.5 * (self.upper - self.lower)))


class Excluding(Zonotope):
    def contains(self, x: Any) -> bool:
        return bool((np.asarray(x) == self.center).all())


class WrongMap(Zonotope):
    """Forgets the shift."""

    def linear_map(self, R: Any, shift: Any = None) -> Zonotope:
        return super().linear_map(R)


class WrongSum(Parallelotope):
    """Adds the centres only."""

    def minkowski_sum(self, other: Support) -> Support:
        return Parallelotope(self.center + other.center, self.generators)


class SmallIntersection(Orthotope):
    """Takes the other set by the points between its centre and its hull."""

    def intersect(self, other: Support) -> Support:
        lower, upper = other.bounds()
        middle = 0.5 * (lower + upper)
        return super().intersect(Orthotope(middle + 0.99 * (lower - middle), middle + 0.99 * (upper - middle)))


class AlwaysEmpty(ConstrainedZonotope):
    def is_empty(self) -> bool:
        return True


class SmallVolume(Orthotope):
    def volume(self) -> float:
        return 0.4 * super().volume()


class Writable(Orthotope):
    def __init__(self, lower: Any, upper: Any) -> None:
        super().__init__(lower, upper)
        self.lower = np.array(lower)


BROKEN: list[tuple[type[Support], str]] = [
    (SmallHull, "itself: found bounds"),
    (RoundedInward, "itself: found bounds"),
    (WideHull, "bounds: found .* expected the hull"),
    (SmallSupport, "itself: found support"),
    (Excluding, "contains: found False"),
    (WrongMap, "linear_map, square: found bounds"),
    (WrongSum, "minkowski_sum with"),
    (SmallIntersection, "intersect with"),
    (AlwaysEmpty, "is_empty"),
    (SmallVolume, "volume: found"),
    (Writable, "writable"),
]


@pytest.mark.parametrize(("cls", "message"), BROKEN, ids=[cls.__name__ for cls, _ in BROKEN])
def test_a_set_that_breaks_a_promise_is_caught(cls: type[Support], message: str) -> None:
    with pytest.raises(AssertionError, match=message) as caught:
        check_support(cls, seeds=16)
    assert str(caught.value).startswith(f"{cls.__name__} in ")


def test_a_class_of_its_own_says_how_its_sets_are_made() -> None:
    class Ball(Orthotope):
        """A constructor of its own."""

        def __init__(self, radius: float, n: int) -> None:
            super().__init__([-radius] * n, [radius] * n)

    check_support(Ball, lambda rng, n, scale: Sample(Ball(scale, n), corners(scale, n)), 6)
    with pytest.raises(AssertionError, match="expected a Ball"):
        check_support(Ball, lambda rng, n, scale: Sample(Orthotope([0.0], [1.0]), corners(1.0, 1)), 1)
    with pytest.raises(AssertionError, match="does not know how sets of Support are made"):
        check_support(Support)


def corners(scale: float, n: int) -> list[list[Fraction]]:
    return [[Fraction(scale)] * n, [Fraction(-scale)] * n]
