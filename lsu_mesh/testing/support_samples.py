"""Sets of every class, with exact points that lie in them by construction, most of them at their edges."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope
from lsu_mesh.testing.exact_plant import Exact
from lsu_mesh.testing.filter_cases import box_around
from lsu_mesh.testing.membership import is_outside


class Sample(NamedTuple):
    """A set and exact points (n,) of it."""

    support: Support
    members: list[Exact]


Draw = Callable[[np.random.Generator, int, float], Sample]
"""``(rng, n, scale) → sample`` of a set in n dimensions, about ``scale`` wide."""

MEMBERS = 12
FLAT = 0.2
"""Share of the sets that lose a direction."""


def draw_for(cls: type[Support]) -> Draw | None:
    """How sets of a class of this library, or of a subclass with the same constructor, are drawn."""
    for base, draw in _DRAWS.items():
        if issubclass(cls, base):
            return lambda rng, n, scale: draw(cls, rng, n, scale)
    return None


def _orthotope(cls: Any, rng: np.random.Generator, n: int, scale: float) -> Sample:
    center, half = scale * rng.normal(size=n), scale * rng.random(n)
    half[rng.random(n) < FLAT] = 0.0
    box = Orthotope(center - half, center + half)
    is_upper = rng.random((MEMBERS, n)) < 0.5
    return Sample(cls(box.lower, box.upper), [_exact(np.where(row, box.upper, box.lower)) for row in is_upper])


def _parallelotope(cls: Any, rng: np.random.Generator, n: int, scale: float) -> Sample:
    center, T = scale * rng.normal(size=n), _generators(rng, n, n, scale)
    return Sample(cls(center, T), _images(center, T, rng.choice([-1.0, 1.0], size=(MEMBERS, n))))


def _zonotope(cls: Any, rng: np.random.Generator, n: int, scale: float) -> Sample:
    g = n + int(rng.integers(0, 3))
    center, G = scale * rng.normal(size=n), _generators(rng, n, g, scale)
    return Sample(cls(center, G), _images(center, G, rng.choice([-1.0, 1.0], size=(MEMBERS, g))))


def _constrained_zonotope(cls: Any, rng: np.random.Generator, n: int, scale: float) -> Sample:
    """Constraints with small integers, so that halves solve them exactly."""
    g, m = n + int(rng.integers(1, 4)), int(rng.integers(0, 3))
    center, G = scale * rng.normal(size=n), _generators(rng, n, g, scale)
    A = rng.integers(-1, 2, size=(m, g)).astype(np.float64)
    grid = rng.choice([-1.0, -0.5, 0.5, 1.0], size=(1000, g))
    b = A @ grid[0]
    solving = grid[(grid @ A.T == b).all(axis=1)][:MEMBERS]
    return Sample(cls(center, G, A, b), _images(center, G, solving))


def _intersection(cls: Any, rng: np.random.Generator, n: int, scale: float) -> Sample:
    """A box that touches a corner of a parallelotope from inside, and that parallelotope."""
    body, corners = _parallelotope(Parallelotope, rng, n, scale)
    chosen = [corners[0], corners[-1]]
    parts = [body, box_around(chosen)]
    members = [point for point in corners if not any(is_outside(part, point) for part in parts)]
    middle = [(a + b) / 2 for a, b in zip(*chosen, strict=True)]
    return Sample(cls(parts), [*members, middle])


_DRAWS: dict[type[Support], Callable[[Any, np.random.Generator, int, float], Sample]] = {
    Orthotope: _orthotope,
    Parallelotope: _parallelotope,
    Zonotope: _zonotope,
    ConstrainedZonotope: _constrained_zonotope,
    Intersection: _intersection,
}


def _generators(rng: np.random.Generator, n: int, g: int, scale: float) -> Matrix:
    G = scale * rng.normal(size=(n, g))
    if rng.random() < FLAT:
        G[:, -1] = 0.0
    if rng.random() < FLAT:
        G[-1] = G[0]
    return G


def _images(center: Vector, G: Matrix, xi: Matrix) -> list[Exact]:
    """``c + G ξ`` without rounding, for each row ξ."""
    rows = [[Fraction(v) for v in row] for row in G.tolist()]
    start = _exact(center)
    return [
        [
            c + sum((a * Fraction(s) for a, s in zip(row, signs, strict=True)), Fraction(0))
            for c, row in zip(start, rows, strict=True)
        ]
        for signs in xi.tolist()
    ]


def _exact(values: Vector) -> Exact:
    return [Fraction(v) for v in values.tolist()]
