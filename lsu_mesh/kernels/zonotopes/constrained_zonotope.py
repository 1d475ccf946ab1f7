"""Arithmetic of constrained zonotopes ``{c + G ξ : |ξ|∞ ≤ 1, A ξ = b}`` on plain arrays, rounded outward.

The arrays of a set are exact numbers: what is written in them *is* the set. Rounding is made while a new set is
computed, and goes into two places. Errors of the centre and the generators go into a box that
:func:`~lsu_mesh.kernels.zonotopes.zonotope.absorb_box` adds. Errors of a constraint row go into a slack: if the exact
row says ``a'ξ = β`` and the computed one differs by at most ``Σ_j |δ_j| + |δβ| ≤ ε`` for every ``|ξ|∞ ≤ 1``, then
the computed row holds with one more term ``ε s``, ``|s| ≤ 1``. A generator that appears in this row only and
nowhere in the state (a strip's own one) takes the slack by growing, ``|A_ij| + ε`` rounded up, so that
no column is added.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.runtime.rounding import UNDERFLOW, gamma, up
from lsu_mesh.kernels.zonotopes.zonotope import padded, subtraction_error


@kernel
def meet_strips(
    c: Array, G: Array, A: Array, b: Array, P: Array, middle: Array, radius: Array
) -> tuple[Array, Array, Array]:
    """Generalised intersection with strips ``|P_i x − middle_i| ≤ radius_i`` (Scott et al. 2016 (13); P2023 (15)).

    One generator and one constraint ``(P_i G) ξ − radius_i η_i = middle_i − P_i c`` per strip whose ``middle`` is a
    number (NaN: no strip). Returns G (n, g + k), A (m + k, g + k), b (m + k,).
    """
    n, g = G.shape
    m = A.shape[0]
    k = 0
    for i in range(P.shape[0]):
        if not np.isnan(middle[i]):
            k += 1
    generators = padded(G, n, g + k)
    rows = padded(A, m + k, g + k)
    sides = np.empty(m + k)
    for i in range(m):
        sides[i] = b[i]
    t = 0
    for i in range(P.shape[0]):
        if np.isnan(middle[i]):
            continue
        side = middle[i]
        mass = abs(side)
        for s in range(n):
            side -= P[i, s] * c[s]
            mass += abs(P[i, s] * c[s])
        for j in range(g):
            entry = 0.0
            for s in range(n):
                entry += P[i, s] * G[s, j]
                mass += abs(P[i, s] * G[s, j])
            rows[m + t, j] = entry
        sides[m + t] = side
        rows[m + t, g + t] = -up(radius[i] + up(gamma(n + g + 6) * mass + UNDERFLOW))
        t += 1
    return generators, rows, sides


@kernel
def meet_sets(
    c: Array, G: Array, A: Array, b: Array, c2: Array, G2: Array, A2: Array, b2: Array
) -> tuple[Array, Array, Array]:
    """``Z ∩ Y`` (Scott et al. 2016, eq. 13 with R = I): rows ``G ξ − G₂ η = c₂ − c``; returns G, A, b.

    ``G`` and ``G₂`` are copied, which is exact; only ``c₂ − c`` is rounded. Where Z has more rows than Y, Y tells of
    the first ones: R = [I 0].
    """
    n, g = c2.size, G.shape[1]
    g2 = G2.shape[1]
    m = A.shape[0]
    m2 = A2.shape[0]
    generators = padded(G, c.size, g + g2)
    rows = padded(A, m + m2 + n, g + g2)
    sides = np.empty(m + m2 + n)
    for i in range(m):
        sides[i] = b[i]
    for i in range(m2):
        sides[m + i] = b2[i]
        for j in range(g2):
            rows[m + i, g + j] = A2[i, j]
    slack = np.zeros(m + m2 + n)
    for i in range(n):
        t = m + m2 + i
        for j in range(g):
            rows[t, j] = G[i, j]
        for j in range(g2):
            rows[t, g + j] = -G2[i, j]
        sides[t] = c2[i] - c[i]
        lost = subtraction_error(c2[i], c[i])
        if lost != 0.0:
            slack[t] = up(abs(lost))
    generators, rows = absorb_rows(generators, rows, slack)
    return generators, rows, sides


@inner
def absorb_rows(G: Array, A: Array, slack: Array) -> tuple[Array, Array]:
    """Loosen row i of ``A ξ = b`` by ``slack_i``: grow a column private to that row, or append one (see the module)."""
    n, g = G.shape
    m = A.shape[0]
    host = np.empty(m, dtype=np.int64)
    missing = 0
    for i in range(m):
        host[i] = -1
        if slack[i] <= 0.0:
            continue
        for j in range(g - 1, -1, -1):
            if A[i, j] == 0.0:
                continue
            private = True
            for s in range(n):
                private = private and G[s, j] == 0.0
            for s in range(m):
                private = private and (s == i or A[s, j] == 0.0)
            if private:
                host[i] = j
                break
        if host[i] < 0:
            missing += 1
    generators = padded(G, n, g + missing)
    rows = padded(A, m, g + missing)
    place = g
    for i in range(m):
        if slack[i] <= 0.0:
            continue
        if host[i] >= 0:
            grown = up(abs(A[i, host[i]]) + slack[i])
            rows[i, host[i]] = grown if A[i, host[i]] > 0.0 else -grown
        else:
            rows[i, place] = slack[i]
            place += 1
    return generators, rows
