"""A constrained zonotope met with another set, by as few constraints as the other set needs.

A box, a parallelotope and a bundle are strips ``|y − P x| ≤ r``, and only those that cut cost a generator and a
constraint each. A strip is also the better form of a long, thin parallelotope: its edges, written as generators, may be
a million times as long as the set that they meet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.filters.lagged_states import rows_of
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_sets, meet_strips
from lsu_mesh.kernels.zonotopes.time_update import image_of_box
from lsu_mesh.supports.arrays import are_finite
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.reduction import Body
from lsu_mesh.supports.support import Support


def joined(body: Body, bounds: tuple[Vector, Vector], other: Support, most_generators: int | None) -> Body:
    """``X ∩ other`` with X = (c, G, A, b); the same arrays where nothing of ``other`` cuts X.

    Parameters
    ----------
    body, bounds:
        X, and a box (lower, upper), (n,) each, that holds all of it that matters: strips that hold the box are left
        out, which is exact for ``X ∩ box``. X may have more rows than n, of other states: ``other`` tells of the first.
    other:
        Any set of dimension n.
    most_generators:
        A constrained zonotope with more generators than that is taken by its box; ``None`` is no limit.
    """
    if isinstance(other, Intersection):
        for part in other.parts:
            body = joined(body, bounds, part, most_generators)
        return body
    strips = strips_of(other)
    if strips is not None:
        P, y, r = strips
        does_cut = cuts(bounds, other, P, y=y, r=r)
        rows = rows_of(P, 0, body[0].size // other.dim)
        return with_strips(body, rows, np.where(does_cut, y, np.nan), r) if does_cut.any() else body
    met = other.to_constrained_zonotope()
    if most_generators is not None and met.generator_count > most_generators:
        return joined(body, bounds, other.interval_hull(), most_generators)
    return finite_body((body[0], *meet_sets(*body, *met.arrays)), body)


def with_strips(body: Body, P: Matrix, middle: Vector, radius: Vector) -> Body:
    """X cut by ``|middle − P x| ≤ radius``, P (k, n), NaN for no strip."""
    return finite_body((body[0], *meet_strips(*body, P, middle, radius)), body)


def finite_body(met: Body, body: Body) -> Body:
    """The intersection, or X itself, which holds it, where its numbers have outgrown double precision."""
    return met if are_finite(*met) else body


def strips_of(support: Support) -> tuple[Matrix, Vector, Vector] | None:
    """P (n, n), y, r (n,) with ``{|y − P x| ≤ r} ⊇ support``, tight to rounding; ``None`` for sets of other kinds.

    Also for a parallelotope whose edges depend on one another: it has no such faces.
    """
    if isinstance(support, Orthotope):
        return np.eye(support.dim), support.center, support.half_widths
    return support.strips() if isinstance(support, Parallelotope) else None


def cuts(bounds: tuple[Vector, Vector], other: Support, P: Matrix, y: Vector, r: Vector) -> NDArray[np.bool_]:
    """Which strips do not hold the whole box; those of a box are compared without rounding."""
    if isinstance(other, Orthotope):
        return (bounds[0] < other.lower) | (bounds[1] > other.upper)
    low, high = image_of_box(P, *bounds)
    return ~((low >= y - r) & (high <= y + r))
