"""What a step is charged with because something of it is not known: its matrices, or the moment of a measurement."""

from __future__ import annotations

import math

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.discretisation.interval_matrices import outward
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.runtime.rounding import down, gamma, size_of_product, up

MAX_PASSES = 100
GROWTH = 1.0 + 2.0**-20


@kernel
def charge(
    A_radius: Matrix, B_radius: Matrix, a_radius: Vector, lower: Vector, upper: Vector, u: Vector, u_widths: Vector,
    widths: Vector, first: int,
) -> None:  # fmt: skip
    """Add ``A_radius |x| + B_radius |u| + a_radius``, rounded up, to widths[first : first + n].

    The largest for x in [lower, upper] (n,) and u within u_widths (p,) of u (p,).
    """
    n, p = a_radius.size, u_widths.size
    for i in range(n):
        total = a_radius[i]
        for j in range(n):
            total += size_of_product(A_radius[i, j], max(abs(lower[j]), abs(upper[j])))
        for j in range(p):
            total += size_of_product(B_radius[i, j], abs(u[j]) + u_widths[j])
        if total > 0.0:
            widths[first + i] = outward(widths[first + i] + total, n + p + 2)


@kernel
def course(
    A: Matrix, B: Matrix, N: Matrix, rho: Vector, error: float, u: Vector, u_widths: Vector,
    lower: Vector, upper: Vector,
) -> bool:  # fmt: skip
    """Widen [lower, upper] (n,), in place, from a box of x(t) to one of x(s) for all ``|s − t| ≤ error`` seconds.

    Picard: a box T with ``X ⊕ [−e, e] (A T + B u + N box(rho)) ⊆ T`` holds x(s). A (n, n), B (n, p), N (n, q).
    ``False`` where none was found: the error is too long for A.
    """
    n = lower.size
    speed, reach, more = np.zeros(n), np.zeros(n), np.zeros(n)
    none = np.zeros(n)
    for i in range(n):
        speed[i] = _largest(A[i], none, B[i], N[i], rho, lower, upper, u, u_widths)
        reach[i] = error * speed[i]
    for _ in range(MAX_PASSES):
        fits = True
        for i in range(n):
            total = speed[i]
            for j in range(n):
                total += abs(A[i, j]) * reach[j]
            more[i] = 0.0 if total == 0.0 else outward(total * error, n + 2)
            fits = fits and more[i] <= reach[i]
        if fits:
            for i in range(n):
                if more[i] > 0.0:
                    lower[i], upper[i] = down(lower[i] - more[i]), up(upper[i] + more[i])
            return True
        for i in range(n):
            reach[i] = more[i] * GROWTH
            if not math.isfinite(reach[i]):
                return False
    return False


@kernel
def output_drift(
    C: Matrix, A: Matrix, B: Matrix, N: Matrix, rho: Vector, error: float, u: Vector, u_widths: Vector,
    lower: Vector, upper: Vector, drift: Vector,
) -> None:  # fmt: skip
    """Fills drift (m,): ``error`` times the largest ``|C_i (A x + B u + N w)|`` for x in [lower, upper], rounded up."""
    n, p, q = A.shape[0], B.shape[1], N.shape[1]
    a, lost, b, w = np.zeros(n), np.zeros(n), np.zeros(p), np.zeros(q)
    for i in range(C.shape[0]):
        rounding = 0.0
        for j in range(n):
            a[j], lost[j] = 0.0, 0.0
            for s in range(n):
                a[j] += C[i, s] * A[s, j]
                lost[j] += abs(C[i, s] * A[s, j])
            lost[j] *= gamma(n + 2)
        for j in range(p):
            b[j], mass = 0.0, 0.0
            for s in range(n):
                b[j] += C[i, s] * B[s, j]
                mass += abs(C[i, s] * B[s, j])
            rounding += gamma(n + 2) * mass * (abs(u[j]) + u_widths[j])
        for j in range(q):
            w[j], mass = 0.0, 0.0
            for s in range(n):
                w[j] += C[i, s] * N[s, j]
                mass += abs(C[i, s] * N[s, j])
            rounding += gamma(n + 2) * mass * rho[j]
        fastest = _largest(a, lost, b, w, rho, lower, upper, u, u_widths) + rounding
        drift[i] = 0.0 if fastest == 0.0 else outward(fastest * error, n + p + q + 4)


@inner
def _largest(
    a: Vector, lost: Vector, b: Vector, w: Vector, rho: Vector, lower: Vector, upper: Vector, u: Vector,
    u_widths: Vector,
) -> float:  # fmt: skip
    """At least ``|a'x + b'u + w'v|`` for x in [lower, upper], u within u_widths, ``|v| ≤ rho``; a to ``lost``."""
    centre, mass, reach = 0.0, 0.0, 0.0
    for j in range(a.size):
        middle = 0.5 * lower[j] + 0.5 * upper[j]
        centre += a[j] * middle
        mass += abs(a[j]) * abs(middle)
        reach += abs(a[j]) * max(upper[j] - middle, middle - lower[j])
        reach += lost[j] * max(abs(lower[j]), abs(upper[j]))
    for j in range(b.size):
        centre += b[j] * u[j]
        mass += abs(b[j] * u[j])
        reach += abs(b[j]) * u_widths[j]
    for j in range(w.size):
        reach += abs(w[j]) * rho[j]
    terms = a.size + b.size + w.size + 4
    total = abs(centre) + reach + gamma(terms) * mass
    return 0.0 if total == 0.0 else outward(total, 2 * terms)
