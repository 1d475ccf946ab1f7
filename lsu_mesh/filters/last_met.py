"""Whether a transferred set says anything beyond the one that was met last.

A set that holds the last one met, with nothing brought in between, cuts nothing off: leaving it out is sound, and the
same set conditioned again and again changes no bit.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support


def holds(outer: Support, inner: Support) -> bool:
    """Whether ``outer ⊇ inner``, as far as double precision tells.

    ``False`` also where it would cost too much to find out: of zonotopes and constrained zonotopes the same one is
    recognised only.
    """
    if is_same(outer, inner):
        return True
    if isinstance(outer, Intersection):
        return all(holds(part, inner) for part in outer.parts)
    if isinstance(inner, Intersection):
        return any(holds(outer, part) for part in inner.parts)
    if isinstance(outer, Orthotope):
        lower, upper = inner.bounds()
        return bool((outer.lower <= lower).all() and (outer.upper >= upper).all())
    strips = outer.strips() if isinstance(outer, Parallelotope) else None
    if strips is None:
        return False
    return all(inner.support(row) <= y + r and -inner.support(-row) >= y - r for row, y, r in zip(*strips, strict=True))


def is_same(one: Support, other: Support) -> bool:
    """Whether two sets are of one class and have the same numbers, bit by bit."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, Intersection) and isinstance(other, Intersection):
        return len(one.parts) == len(other.parts) and all(map(is_same, one.parts, other.parts))
    arrays = numbers(one)
    return arrays is not None and all(
        a.shape == b.shape and a.tobytes() == b.tobytes() for a, b in zip(arrays, numbers(other) or (), strict=True)
    )


def numbers(support: Support) -> tuple[np.ndarray, ...] | None:
    """The arrays that make a set; ``None`` for a class that is not this library's."""
    if isinstance(support, ConstrainedZonotope):
        return support.arrays
    if isinstance(support, Orthotope):
        return support.bounds()
    generators = getattr(support, "generators", None)
    return None if generators is None else (support.center, generators)
