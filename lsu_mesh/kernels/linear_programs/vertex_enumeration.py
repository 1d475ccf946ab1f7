"""Vertices of a three-dimensional polytope by splitting the triangles of a growing inner hull.

Quickhull with linear programs for points: a triangle whose normal finds nothing beyond it is done; else the point that
is found replaces all triangles that it sees. For drawing: floating point, no proofs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Array, Indices
from lsu_mesh.kernels.linear_programs.safe_maxima import Program, vertex
from lsu_mesh.kernels.linear_programs.simplex import basic_levels, climb
from lsu_mesh.kernels.runtime.compile import inlined, inner, kernel

Triangles = Indices

CONFIRMED = 1e-9
"""A triangle is done when no point lies farther beyond it than this."""


@inner
def farthest(program: Program, d: Array, point: Array) -> None:
    """A vertex ξ (g,) that maximises ``d'ξ``, in floating point; the program is left there."""
    for j in range(d.size):
        program.objective[j] = d[j] / program.reach[j]
    basic_levels(program.tableau, program.sides, program.basis, program.at, program.level)
    climb(
        program.tableau, program.basis, program.reach, program.at, program.level,
        program.objective, program.costs, program.multipliers,
    )  # fmt: skip
    vertex(program, point)


@kernel
def split_triangles(program: Program, M: Array, origin: Array, corners: Array, most: int) -> Array:
    """Points ``M ξ − origin``, (k, 3): the four ``corners`` (4, 3) of an inscribed simplex and all that are found.

    M (3, g). Stops at ``most`` points.
    """
    g = M.shape[1]
    points = np.empty((most, 3))
    for k in range(4):
        for i in range(3):
            points[k, i] = corners[k, i]
    count = 4
    room = 8 * most + 64
    triangles = np.empty((room, 3), dtype=np.int64)
    planes = np.empty((room, 4))
    alive = np.zeros(room, dtype=np.bool_)
    used = 0
    for k in range(4):
        used = _add_triangle(points, triangles, planes, alive, used, (k + 1) % 4, (k + 2) % 4, (k + 3) % 4, points[k])
    inside = np.zeros(3)
    for i in range(3):
        inside[i] = 0.25 * (corners[0, i] + corners[1, i] + corners[2, i] + corners[3, i])
    d = np.empty(g)
    xi = np.empty(g)
    t = 0
    while t < used and count < most and used < room - 64:
        if alive[t]:
            for j in range(g):
                d[j] = planes[t, 0] * M[0, j] + planes[t, 1] * M[1, j] + planes[t, 2] * M[2, j]
            farthest(program, d, xi)
            for i in range(3):
                points[count, i] = -origin[i]
                for j in range(g):
                    points[count, i] += M[i, j] * xi[j]
            if _height(planes[t], points[count]) > CONFIRMED:
                used = _replace_visible(points, triangles, planes, alive, used, count, inside)
                count += 1
        t += 1
    found = np.empty((count, 3))
    for k in range(count):
        for i in range(3):
            found[k, i] = points[k, i]
    return found


@inlined
def _height(plane: Array, point: Array) -> float:
    return float(plane[0] * point[0] + plane[1] * point[1] + plane[2] * point[2] - plane[3])


@inner
def _add_triangle(
    points: Array, triangles: Triangles, planes: Array, alive: NDArray[np.bool_], used: int,
    a: int, b: int, c: int, inside: Array,
) -> int:  # fmt: skip
    """Append the triangle with its outward unit normal, its corners in the order that the normal sees anticlockwise."""
    p, q, r = points[a], points[b], points[c]
    nx = (q[1] - p[1]) * (r[2] - p[2]) - (q[2] - p[2]) * (r[1] - p[1])
    ny = (q[2] - p[2]) * (r[0] - p[0]) - (q[0] - p[0]) * (r[2] - p[2])
    nz = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    size = np.sqrt(nx * nx + ny * ny + nz * nz)
    alive[used] = size > 1e-15
    size = max(size, 1e-300)
    side = nx * (inside[0] - p[0]) + ny * (inside[1] - p[1]) + nz * (inside[2] - p[2])
    if side > 0.0:
        b, c = c, b
        size = -size
    triangles[used, 0], triangles[used, 1], triangles[used, 2] = a, b, c
    planes[used, 0], planes[used, 1], planes[used, 2] = nx / size, ny / size, nz / size
    planes[used, 3] = planes[used, 0] * p[0] + planes[used, 1] * p[1] + planes[used, 2] * p[2]
    return used + 1


@inner
def _replace_visible(
    points: Array, triangles: Triangles, planes: Array, alive: NDArray[np.bool_], used: int, new: int, inside: Array
) -> int:
    """Take out the triangles that see the new point and join it to the edges around them."""
    visible = np.empty(used, dtype=np.int64)
    k = 0
    for t in range(used):
        if alive[t] and _height(planes[t], points[new]) > 0.1 * CONFIRMED:
            visible[k] = t
            k += 1
            alive[t] = False
    for s in range(k):
        for e in range(3):
            a, b = triangles[visible[s], e], triangles[visible[s], (e + 1) % 3]
            shared = False
            for other in range(k):
                for f in range(3):
                    if triangles[visible[other], f] == b and triangles[visible[other], (f + 1) % 3] == a:
                        shared = True
            if not shared and used < alive.size:
                used = _add_triangle(points, triangles, planes, alive, used, a, b, new, inside)
    return used
