"""Interval hull and reduction of a constrained zonotope in one go: both need the same linear programs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.linear_programs.safe_maxima import open_program, variable_ranges
from lsu_mesh.kernels.zonotopes.complexity_reduction import reduce_complexity
from lsu_mesh.supports.linear_programs import program_maxima

Body = tuple[Vector, Matrix, Matrix, Vector]


class Limits(NamedTuple):
    """Largest numbers of generators and constraints; ``None`` is no limit."""

    generators: int | None
    constraints: int | None

    def allow(self, body: Body) -> bool:
        """Whether the set (c, G, A, b) is within the limits."""
        constraints, generators = body[2].shape
        return (self.generators is None or generators <= self.generators) and (
            self.constraints is None or constraints <= self.constraints
        )


class Settled(NamedTuple):
    """A set within limits and the box [lower, upper] of the set *before* its reduction; ``empty`` only if proved."""

    body: Body
    lower: Vector
    upper: Vector
    empty: bool


def settle(body: Body, lower: Vector, upper: Vector, limits: Limits) -> Settled:
    """Meet the box with the interval hull of the set, then reduce the set to the limits.

    The reduced set contains the given one, so the box is also its hull met with the given box.
    """
    c, G, A, b = body
    n = c.size
    status, program = open_program(A, b)
    found = program_maxima(status, program, np.concatenate((G, -G)), A=A, b=b)
    if found.empty:
        return Settled(body, lower, upper, True)
    upper = np.minimum(upper, np.nextafter(c + found.values[:n], np.inf))
    lower = np.maximum(lower, np.nextafter(c - found.values[n:], -np.inf))
    if (lower > upper).any():
        return Settled(body, lower, upper, True)
    if not limits.allow(body):
        low, high = variable_ranges(program, found.points)
        body = reduce_complexity(c, G, A, b, low, high, *(-1 if limit is None else limit for limit in limits))
    return Settled(body, lower, upper, False)
