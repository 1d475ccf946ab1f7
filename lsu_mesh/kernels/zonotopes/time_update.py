"""The time update of LSU-CZ on plain arrays: a constrained zonotope (c, G, A, b) and a box [lower, upper]."""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, down, gamma, size_of_product, up
from lsu_mesh.kernels.zonotopes.zonotope import absorb_box, padded

Body = tuple[Array, Array, Array, Array]


@kernel
def predict_constrained(
    body: Body, lower: Array, upper: Array, R: Array, B: Array, u: Array, N: Array, widths: Array
) -> tuple[bool, Body, Array, Array]:
    """Time update ``R X ⊕ B u ⊕ N box(widths)``; R (k, n), B (k, p), u (p,), N (k, q), widths (q,).

    The set gets a generator per noise of positive width; those along the axes take the rounding of centre and
    generators, else generators are added for it. The box is carried by interval arithmetic. A row that copies a
    coordinate and that nothing drives is exact. ``False`` where numbers overflow.
    """
    c, G, A, b = body
    n, g = G.shape
    rows = R.shape[0]
    q = 0
    for k in range(widths.size):
        if widths[k] > 0.0:
            q += 1
    centre = np.empty(rows)
    generators = np.zeros((rows, g + q))
    slack = np.empty(rows)
    low = np.empty(rows)
    high = np.empty(rows)
    finite = True
    for i in range(rows):
        shift = 0.0
        inputs = 0.0
        for k in range(u.size):
            shift += B[i, k] * u[k]
            inputs += size_of_product(B[i, k], u[k])
        spread = 0.0
        scaled = 0.0
        j = g
        for k in range(widths.size):
            if widths[k] > 0.0:
                generators[i, j] = N[i, k] * widths[k]
                size = size_of_product(N[i, k], widths[k])
                spread += size
                if abs(N[i, k]) != 1.0:
                    scaled += size
                j += 1
        total = shift
        mass = inputs + scaled
        for s in range(n):
            total += R[i, s] * c[s]
            mass += size_of_product(R[i, s], c[s])
        for j in range(g):
            entry = 0.0
            for s in range(n):
                entry += R[i, s] * G[s, j]
                mass += size_of_product(R[i, s], G[s, j])
            generators[i, j] = entry
        centre[i] = total
        copied = copied_coordinate(R[i]) if inputs == 0.0 and spread == 0.0 else -1
        slack[i] = 0.0 if mass == 0.0 or copied >= 0 else up(gamma(n + u.size + 4) * mass + UNDERFLOW)
        lost = up(gamma(u.size + widths.size + 4) * (inputs + spread) + UNDERFLOW)
        least, most = image_of_interval(R[i], lower, upper)
        low[i] = down(down(least + shift) - up(spread + lost))
        high[i] = up(up(most + shift) + up(spread + lost))
        if copied >= 0:
            low[i], high[i] = lower[copied], upper[copied]
        finite = finite and np.isfinite(total) and np.isfinite(slack[i])
        finite = finite and np.isfinite(low[i]) and np.isfinite(high[i])
    generators, columns = absorb_box(generators, padded(A, A.shape[0], g + q), slack)
    return finite, (centre, generators, columns, b), low, high


@inner
def copied_coordinate(row: Array) -> int:
    """The coordinate that a row of a map copies; −1 where it does anything else."""
    found = -1
    for s in range(row.size):
        if row[s] == 1.0 and found < 0:
            found = s
        elif row[s] != 0.0:
            return -1
    return found


@inner
def image_of_interval(row: Array, lower: Array, upper: Array) -> tuple[float, float]:
    """``row · [lower, upper]``, row, lower, upper (n,), rounded outward."""
    low = 0.0
    high = 0.0
    mass = 0.0
    for s in range(row.size):
        at_lower = row[s] * lower[s]
        at_upper = row[s] * upper[s]
        low += min(at_lower, at_upper)
        high += max(at_lower, at_upper)
        mass += max(abs(at_lower), abs(at_upper))
    lost = up(gamma(row.size) * mass + UNDERFLOW)
    return down(low - lost), up(high + lost)


@kernel
def image_of_box(P: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Interval hull of ``P [lower, upper]``, P (k, n): sides (k,), (k,), rounded outward."""
    k = P.shape[0]
    low = np.empty(k)
    high = np.empty(k)
    for i in range(k):
        low[i], high[i] = image_of_interval(P[i], lower, upper)
    return low, high
