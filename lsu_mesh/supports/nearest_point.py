"""The point of a set that is nearest to a target, and never proved to lie outside of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lsu_mesh.array_types import Vector
from lsu_mesh.kernels.points import nearest as kernels
from lsu_mesh.kernels.points.room import room
from lsu_mesh.kernels.zonotopes.zonotope import zonotope_radius
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.linear_programs import safe_maxima
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support

INSIDE = 1e-9
"""Share by which the generators are shortened, so that rounding cannot move the point out of the set."""
SUM_WEIGHT = 2.0**-20
"""Weight of the sum of the distances beside the largest one: it only chooses among the points that are nearest."""
STEPS = (1e-9, 1e-6, 1e-3, 0.03, 0.5, 1.0)
"""Shares of the way to a point deep inside that are tried where the nearest point is proved to lie outside."""


def nearest_point(support: Support, target: ArrayLike, lower: Vector, upper: Vector) -> Vector:
    """``argmin max_i |x_i − m_i|/q_i`` over the x (n,) in the set and in the box [lower, upper], with the least sum.

    target m (n,), moved into the box first; q (n,) are the box's half-widths, and coordinates without width are fixed.
    A box, a parallelotope and a bundle of the two are done in compiled code; other sets by one linear program over
    their constrained zonotope, where the target does not lie in the set already. The point lies in the box, and the
    set's ``contains`` does not exclude it, but where a set is so thin that it may hold no vector of doubles.
    """
    low, high = np.array(lower), np.array(upper)
    point: Vector = np.clip(np.asarray(target, dtype=np.float64), low, high)
    body = _parallelotope_of(support)
    if isinstance(support, Orthotope) or body is not None:
        for box in (support, *getattr(support, "parts", ())):
            if isinstance(box, Orthotope):
                low, high = np.maximum(low, box.lower), np.minimum(high, box.upper)
        if body is None:
            return np.asarray(np.clip(point, low, high))
        kernels.nearest_point(np.array(body.center), np.array(body.generators), low, high, point, room(low.size))
        return point
    inset = INSIDE * (0.5 * high - 0.5 * low)  # the hull is rounded outward: its faces are just outside of the set
    point = np.clip(point, np.minimum(low + inset, high), np.maximum(high - inset, low))
    if support.contains(point):
        return point
    return settled(support, _by_program(support.to_constrained_zonotope(), point, low, high), low, high)


def nearest_to_center(support: ConstrainedZonotope, lower: Vector, upper: Vector) -> Vector:
    """The point (n,) of the set with the least ``max_i |x_i − c_i| / Σ_j |G_ij|`` (P2023, Method 2), in the box."""
    c, G = support.arrays[:2]
    radius = zonotope_radius(G)
    return settled(support, _by_program(support, c, c - radius, c + radius), lower, upper)


def settled(support: Support, point: Vector, lower: Vector, upper: Vector) -> Vector:
    """The point (n,), moved into the box, and as far into the set as is needed for it not to be proved outside."""
    point = np.clip(point, lower, upper)
    if support.contains(point):
        return point
    c, G, A, b = support.to_constrained_zonotope().arrays
    deep = np.clip(c + G @ safe_maxima(np.vstack([G, -G]), A, b).points.mean(axis=0), lower, upper)
    for share in STEPS:
        nearer: Vector = np.clip(point + share * (deep - point), lower, upper)
        if support.contains(nearer):
            return nearer
    return point


def _parallelotope_of(support: Support) -> Parallelotope | None:
    """The parallelotope of a set that is one, alone or met with boxes; ``None`` for other sets."""
    if isinstance(support, Parallelotope):
        return support
    if not isinstance(support, Intersection):
        return None
    bodies = [part for part in support.parts if isinstance(part, Parallelotope)]
    boxes = [part for part in support.parts if isinstance(part, Orthotope)]
    return bodies[0] if len(bodies) == 1 and len(boxes) + 1 == len(support.parts) else None


def _by_program(body: ConstrainedZonotope, target: Vector, lower: Vector, upper: Vector) -> Vector:
    """The nearest point; with shortened generators where that leaves a set.

    Variables are ξ, the distances ``p_i, n_i ≥ 0`` upwards and downwards in units of q_i, the largest of them t, and
    its slacks: ``(c + G ξ − m)_i / q_i = p_i − n_i``, ``p_i + n_i + s_i = t``, all scaled to [−1, 1]. A coordinate
    whose box has no width is ``c_i + G_i ξ = m_i``.
    """
    c, G, A, b = body.arrays
    q = 0.5 * upper - 0.5 * lower
    radius = zonotope_radius(G)
    wide, fixed = np.flatnonzero(q > 0.0), np.flatnonzero((q == 0.0) & (radius > 0.0))
    up, down = (upper - target)[wide] / q[wide], (target - lower)[wide] / q[wide]
    g, k = A.shape[1], wide.size
    own = np.vstack([A, G[fixed] / radius[fixed, None], G[wide] / q[wide, None]])
    m = len(own) - k
    rows = np.zeros((m + 2 * k, g + 3 * k + 1))
    rows[: m + k, :g] = own
    one = np.arange(k)
    p, n, t, s = g + one, g + k + one, g + 2 * k, g + 2 * k + 1 + one
    rows[m + one, p], rows[m + one, n] = -0.5 * up, 0.5 * down
    rows[m + k + one, p], rows[m + k + one, n], rows[m + k + one, s] = 0.5 * up, 0.5 * down, 1.0
    rows[m + k :, t] = -1.0
    distance = (target - c)[wide] / q[wide] + 0.5 * up - 0.5 * down
    sides = np.concatenate([b, (target - c)[fixed] / radius[fixed], distance, -0.5 * (up + down)])
    objective = np.zeros((1, rows.shape[1]))
    objective[0, t], objective[0, p], objective[0, n] = -1.0, -SUM_WEIGHT * up, -SUM_WEIGHT * down
    for share in (1.0 - INSIDE, 1.0):
        shortened = rows.copy()
        shortened[: m + k, :g] *= share
        found = safe_maxima(objective, shortened, sides)
        if not found.empty:
            return np.asarray(c + G @ (share * found.points[0, :g]))
    return target
