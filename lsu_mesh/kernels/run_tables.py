"""What a compiled run over a bank of filters takes and stores, and how the densities beside the sets go along."""

from __future__ import annotations

from typing import NamedTuple

from lsu_mesh.array_types import Matrix, Stack, Vector
from lsu_mesh.kernels.points import density
from lsu_mesh.kernels.points.room import Room
from lsu_mesh.kernels.runtime.compile import inlined
from lsu_mesh.kernels.runtime.unowned_views import borrowed

DONE = 0
IN_UPDATE = 1
IN_PREDICT = 2
IN_OUTPUT = 3
"""Where a run has stopped, at a contradiction, or where compiled code cannot tell: the row is then done in Python."""


class Models(NamedTuple):
    """Models of a bank: A (M, n, n), B (M, n, p), C (M, m, n), G (M, n, q), widths (M, q), r (M, m), domains (M, 2, n).

    M = N, or M = 1 for all instances alike; domains (M, 0, n) where there is none. Q (M, n, n) is the covariance of the
    noise of a step.
    """

    A: Stack
    B: Stack
    C: Stack
    G: Stack
    widths: Matrix
    r: Matrix
    domains: Stack
    Q: Stack


class Estimates(NamedTuple):
    """The rule of the points, and densities means (N, n), covariances (N, n, n) beside the sets, for ``MEAN``."""

    rule: int
    means: Matrix
    covariances: Stack


class Record(NamedTuple):
    """What a run stores: points, lower, upper (N, T, n), volumes (N, T), y_lower, y_upper, y_points (N, T, m)."""

    points: Stack
    lower: Stack
    upper: Stack
    volumes: Matrix
    y_lower: Stack
    y_upper: Stack
    y_points: Stack


@inlined
def follow(
    updates: bool, mean: Vector, P: Matrix, A: Matrix, B: Matrix, C: Matrix, y: Vector, r: Vector, u: Vector,
    Q: Matrix, G: Matrix, widths: Vector, room: Room,
) -> None:  # fmt: skip
    """The density, after a data update or a time update that has succeeded."""
    if updates:
        density.update(mean, P, C, y, r, r, room)
    else:
        density.predict(mean, P, A, B, u, Q, G, widths, widths.size, room)


@inlined
def borrowed_models(m: Models) -> Models:
    return Models(
        borrowed(m.A),
        borrowed(m.B),
        borrowed(m.C),
        borrowed(m.G),
        borrowed(m.widths),
        borrowed(m.r),
        borrowed(m.domains),
        borrowed(m.Q),
    )


@inlined
def borrowed_record(r: Record) -> Record:
    return Record(
        borrowed(r.points),
        borrowed(r.lower),
        borrowed(r.upper),
        borrowed(r.volumes),
        borrowed(r.y_lower),
        borrowed(r.y_upper),
        borrowed(r.y_points),
    )
