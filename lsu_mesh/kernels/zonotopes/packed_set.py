"""A constrained zonotope and a box beside it in one line of memory, as runs and banks keep them between steps.

The line holds g, m, whether the box is met with the set's hull, then c, lower, upper (n,), G (n, g), A (m, g), b (m,).
A zonotope has m = 0. What lies behind is not read.
"""

from __future__ import annotations

from lsu_mesh.array_types import Array, Vector
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.zonotopes.time_update import Body

HEAD = 3
"""Entries before the arrays."""


def packed_size(n: int, generators: int, constraints: int) -> int:
    """Entries of a line that holds a set of dimension n with so many generators and constraints."""
    return HEAD + 3 * n + (n + constraints) * generators + constraints


@inner
def pack(body: Body, lower: Array, upper: Array, is_hull: bool, line: Vector) -> bool:
    """Write a set and its box to a line; ``False``, and nothing is written, where it is too short."""
    c, G, A, b = body
    n, g = G.shape
    m = A.shape[0]
    if HEAD + 3 * n + (n + m) * g + m > line.size:
        return False
    line[0], line[1], line[2] = g, m, 1.0 if is_hull else 0.0
    for i in range(n):
        line[HEAD + i], line[HEAD + n + i], line[HEAD + 2 * n + i] = c[i], lower[i], upper[i]
    at = HEAD + 3 * n
    for i in range(n):
        for j in range(g):
            line[at] = G[i, j]
            at += 1
    for i in range(m):
        for j in range(g):
            line[at] = A[i, j]
            at += 1
    for i in range(m):
        line[at] = b[i]
        at += 1
    return True


@inner
def unpack(line: Vector, n: int) -> tuple[Body, Array, Array, bool]:
    """Copies of the set and the box of a line, and whether the box is met with the hull."""
    g, m = int(line[0]), int(line[1])
    at = HEAD + 3 * n
    c, lower, upper = line[HEAD : HEAD + n].copy(), line[HEAD + n : HEAD + 2 * n].copy(), line[HEAD + 2 * n : at].copy()
    G = line[at : at + n * g].copy().reshape((n, g))
    at += n * g
    A = line[at : at + m * g].copy().reshape((m, g))
    b = line[at + m * g : at + m * g + m].copy()
    return (c, G, A, b), lower, upper, line[2] != 0.0
