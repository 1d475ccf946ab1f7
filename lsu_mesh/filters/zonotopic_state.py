"""What the zonotopic Kalman filter knows, and what a correction makes of it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.filters.compiled_sets import PackedSet
from lsu_mesh.filters.density import Density
from lsu_mesh.kernels.zonotopes.zonotope import absorb_box
from lsu_mesh.kernels.zonotopes.zonotopic_kalman import corrected, kalman_gain
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope


class Strips(NamedTuple):
    """``|y − C x| ≤ r``: C (k, n), y (k,), r (k,)."""

    C: Matrix
    y: Vector
    r: Vector


class Held(NamedTuple):
    """What the filter knows: the state lies in ``c + H ξ`` and in [lower, upper]; ``pending`` data are not used yet."""

    c: Vector
    H: Matrix
    lower: Vector
    upper: Vector
    pending: Strips
    density: Density | None = None
    """Beside the set, for the point estimate."""
    met: Support | None = None
    """The set that was met last, where nothing has been brought to the zonotope since."""


def held_of(packed: PackedSet, density: Density | None) -> Held:
    """What compiled code has left."""
    (c, H, _, _), lower, upper, _ = packed
    return Held(c, H, lower, upper, pending=no_strips(c.size), density=density)


def corrected_by(held: Held, strips: Strips) -> Held:
    """The data update; the box stays, and no data wait any more."""
    if strips.y.size == 0:
        return held
    K = kalman_gain(held.H, strips.C, strips.r)
    c, H, slack = corrected(held.c, held.H, strips.C, strips.y, strips.r, K)
    H, _ = absorb_box(H, np.zeros((0, H.shape[1])), slack)
    return held._replace(c=c, H=H, pending=no_strips(c.size), met=None)


def zonotope_hull(held: Held) -> tuple[Vector, Vector]:
    """The hull of the zonotope alone."""
    return Zonotope(held.c, held.H).bounds()


def bounds_of(held: Held) -> tuple[Vector, Vector]:
    """The hull of the zonotope, met with the box."""
    lower, upper = zonotope_hull(held)
    return np.maximum(lower, held.lower), np.minimum(upper, held.upper)


def is_contradictory(held: Held) -> bool:
    lower, upper = bounds_of(held)
    return bool((lower > upper).any())


def size_of(held: Held) -> float:
    """Sum of the half-widths of the hull relative to the box, a scale-free measure of what a correction has gained."""
    lower, upper = zonotope_hull(held)
    widths = np.where(held.upper > held.lower, held.upper - held.lower, 1.0)
    return float(((upper - lower) / widths).sum())


def no_strips(n: int) -> Strips:
    return Strips(np.zeros((0, n)), np.zeros(0), np.zeros(0))


def everything(n: int) -> tuple[Vector, Vector]:
    return np.full(n, -np.inf), np.full(n, np.inf)


def stacked(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([one, other])
