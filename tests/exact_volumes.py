"""Volumes of sets in one to three dimensions from vertices in exact rationals: an oracle for gains."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
from scipy.spatial import ConvexHull

from lsu_mesh import Intersection, Orthotope, Parallelotope, Support, Zonotope

Point = tuple[Fraction, ...]
Half = tuple[Point, Fraction]
"""a and b of ``a x <= b``."""


def exact_volume(support: Support) -> Fraction:
    """Volume of a set: of parts with faces from these, else from the vertices of its cube of generators."""
    parts = support.parts if isinstance(support, Intersection) else (support,)
    if all(isinstance(part, Orthotope | Parallelotope) for part in parts):
        return volume_of_hull(corners([half for part in parts for half in halves(part)], support.dim))
    if isinstance(support, Zonotope):
        G = [[Fraction(v) for v in row] for row in support.generators.tolist()]
        n, count = len(G), len(G[0])
        sums = (
            determinant([[row[j] for j in chosen] for row in G]) for chosen in itertools.combinations(range(count), n)
        )
        return 2**n * sum((abs(one) for one in sums), Fraction(0))
    return volume_of_hull(lifted(support))


def halves(part: Support) -> Iterator[Half]:
    """The faces of a box, or of a parallelotope ``|T⁻¹ (x − c)| <= 1``."""
    n = part.dim
    unit = [[Fraction(i == j) for j in range(n)] for i in range(n)]
    if isinstance(part, Orthotope):
        for i in range(n):
            yield tuple(unit[i]), Fraction(float(part.upper[i]))
            yield tuple(-v for v in unit[i]), -Fraction(float(part.lower[i]))
        return
    assert isinstance(part, Parallelotope)
    T = [[Fraction(v) for v in row] for row in part.generators.tolist()]
    c = [Fraction(v) for v in part.center.tolist()]
    columns = [solved(T, [row[j] for row in unit]) for j in range(n)]
    for i in range(n):
        row = [column[i] for column in columns if column is not None]
        middle = sum((a * v for a, v in zip(row, c, strict=True)), Fraction(0))
        yield tuple(row), middle + 1
        yield tuple(-a for a in row), 1 - middle


def corners(faces: list[Half], n: int) -> list[Point]:
    """All points in which n faces meet and that lie behind all others."""
    found = []
    for chosen in itertools.combinations(faces, n):
        x = solved([list(a) for a, _ in chosen], [b for _, b in chosen])
        if x is not None and all(sum(p * q for p, q in zip(a, x, strict=True)) <= b for a, b in faces):
            found.append(tuple(x))
    return found


def lifted(support: Support) -> list[Point]:
    """``c + G ξ`` at all vertices of ``A ξ = b, |ξ| <= 1``."""
    c, G, A, b = (array.tolist() for array in support.to_constrained_zonotope().arrays)
    g, m = len(G[0]), len(b)
    A, b = [[Fraction(v) for v in row] for row in A], [Fraction(v) for v in b]
    G, c = [[Fraction(v) for v in row] for row in G], [Fraction(v) for v in c]
    found = []
    for fixed in itertools.combinations(range(g), g - m):
        free = [j for j in range(g) if j not in fixed]
        for signs in itertools.product((-1, 1), repeat=len(fixed)):
            right = [
                side - sum(row[j] * s for j, s in zip(fixed, signs, strict=True))
                for row, side in zip(A, b, strict=True)
            ]
            values = solved([[row[j] for j in free] for row in A], right)
            if values is None or any(abs(v) > 1 for v in values):
                continue
            xi = dict(zip((*fixed, *free), (*map(Fraction, signs), *values), strict=True))
            found.append(tuple(c[i] + sum(G[i][j] * xi[j] for j in range(g)) for i in range(len(c))))
    return found


def volume_of_hull(points: list[Point]) -> Fraction:
    """Volume of the convex hull of exact points; which of them make a face is told by their nearest doubles."""
    points = sorted(set(points))
    n = len(points[0])
    if n == 1:
        return points[-1][0] - points[0][0]
    inside = tuple(sum(p[i] for p in points) / len(points) for i in range(n))
    faces = ConvexHull(np.array(points, dtype=float)).simplices
    edges = ([[v - w for v, w in zip(points[j], inside, strict=True)] for j in face] for face in faces.tolist())
    return sum((abs(determinant(face)) for face in edges), Fraction(0)) / (2 if n == 2 else 6)


def determinant(M: list[list[Fraction]]) -> Fraction:
    """By elimination."""
    rows, total = [list(row) for row in M], Fraction(1)
    for k in range(len(rows)):
        pivot = next((i for i in range(k, len(rows)) if rows[i][k]), None)
        if pivot is None:
            return Fraction(0)
        if pivot != k:
            rows[k], rows[pivot], total = rows[pivot], rows[k], -total
        total *= rows[k][k]
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / rows[k][k]
            rows[i] = [a - factor * d for a, d in zip(rows[i], rows[k], strict=True)]
    return total


def solved(M: list[list[Fraction]], right: list[Fraction]) -> list[Fraction] | None:
    """x of ``M x = right``; ``None`` where M is singular."""
    rows = [[*row, side] for row, side in zip(M, right, strict=True)]
    size = len(rows)
    for k in range(size):
        pivot = next((i for i in range(k, size) if rows[i][k]), None)
        if pivot is None:
            return None
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [v / rows[k][k] for v in rows[k]]
        for i in range(size):
            if i != k and rows[i][k]:
                rows[i] = [a - rows[i][k] * d for a, d in zip(rows[i], rows[k], strict=True)]
    return [row[size] for row in rows]
