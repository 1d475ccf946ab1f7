"""Whether an exact point lies in a set, decided in rational arithmetic; and all numbers of a set, for comparison."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.supports.exact import Membership, parallelotope_membership
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support
from lsu_mesh.testing.exact_plant import Exact, inside_box


def is_outside(support: Support, x: Exact, *, decided: bool = True) -> bool:
    """Whether the exact point x (n,) is surely outside of the set; no tolerance.

    A set of a class that is not known here is asked for its constrained zonotope. That takes long where it has many
    generators: unless it has to be ``decided``, the set's own ``contains`` is believed where it does not exclude the
    nearest doubles.
    """
    if isinstance(support, Intersection):
        return any(is_outside(part, x, decided=decided) for part in support.parts)
    if type(support) is Orthotope:
        return not inside_box(*support.bounds(), x)
    if type(support) is Parallelotope:
        verdict = parallelotope_membership(support.center, support.generators, x)
        if verdict is not Membership.UNDECIDED:
            return verdict is Membership.OUTSIDE
    if not decided and support.contains([float(v) for v in x]):
        return False
    return support.to_constrained_zonotope().membership(x) is Membership.OUTSIDE


def hull_of_parts(support: Support) -> tuple[Vector, Vector]:
    """Interval hull of the set; of an intersection the meet of its parts' hulls, which costs no linear program."""
    if not isinstance(support, Intersection):
        return support.bounds()
    hulls = [hull_of_parts(part) for part in support.parts]
    return np.max([lower for lower, _ in hulls], axis=0), np.min([upper for _, upper in hulls], axis=0)


def exceeds(support: Support, direction: list[float], x: Exact) -> bool:
    """Whether ``d'x`` is above the support function of the set in the direction d (n,)."""
    reach = sum((Fraction(d) * v for d, v in zip(direction, x, strict=True)), Fraction(0))
    found = support.support(direction)
    return not np.isfinite(found) or reach > Fraction(found)


def numbers_of(support: Support) -> tuple[object, ...]:
    """Class, bounds and all arrays of a set, bit by bit."""
    parts = tuple(numbers_of(part) for part in support.parts) if isinstance(support, Intersection) else ()
    arrays = (*support.bounds(), *(() if parts else support.to_constrained_zonotope().arrays))
    return type(support).__name__, *parts, *((array.shape, array.tobytes()) for array in arrays)
