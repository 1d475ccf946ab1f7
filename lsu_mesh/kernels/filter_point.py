"""The point estimate of a state of ``kernels/filter_step.py``, by each rule."""

from __future__ import annotations

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.filter_step import BOX, describe
from lsu_mesh.kernels.points.density import truncated_mean
from lsu_mesh.kernels.points.nearest import nearest_point
from lsu_mesh.kernels.points.room import LOWER, Room, row_of
from lsu_mesh.kernels.runtime.compile import kernel
from lsu_mesh.kernels.runtime.scratch import Scratch

CENTRE = 0
NEAREST = 1
MEAN = 2
"""Rules: the centre of the set, raw; the point of the set nearest to it; that nearest to the truncated mean."""


@kernel
def locate(
    family: int, rule: int, S: Matrix, mean: Vector, P: Matrix, lower: Vector, upper: Vector, point: Vector, work: Room
) -> None:  # fmt: skip
    """``point`` (n,) ← that of S by the rule; it holds the centre, and [lower, upper] is the hull, by ``describe``."""
    n = S.shape[1]
    if rule == MEAN:
        truncated_mean(mean, P, lower, upper, point, work)
    if rule != CENTRE and family != BOX:
        nearest_point(S[0], S[1 : n + 1], lower, upper, point, work)


@kernel
def locate_output(
    family: int, rule: int, S: Matrix, mean: Vector, P: Matrix, C: Matrix, point: Vector, y: Vector,
    scratch: Scratch, work: Room,
) -> None:  # fmt: skip
    """``y`` (m,) ← ``C x`` of the point x of S, which ``point`` (n,) then holds; the rule is not ``CENTRE``."""
    n = S.shape[1]
    lower, upper = row_of(work, n, LOWER), row_of(work, n, LOWER + 1)
    describe(family, S, point, lower, upper, scratch)
    locate(family, rule, S, mean, P, lower, upper, point, work)
    for k in range(y.size):
        y[k] = 0.0
        for i in range(n):
            y[k] += C[k, i] * point[i]
