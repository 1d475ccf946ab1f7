"""Time updates that choose the edges of the enclosing parallelotope among those of ``A P`` and of the noise.

The candidates are the columns of ``[T  G diag(widths)]`` without those of width 0. Which of them become edges is found
in plain floating point; the zonotope is then enclosed along these edges and verified as any other
(``kernels/parallelotopes/enclosure.py``).
"""

from __future__ import annotations

import math

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.linear_algebra import invert, log_abs_determinant
from lsu_mesh.kernels.runtime.rounding import EPSILON, up
from lsu_mesh.kernels.runtime.scratch import (
    BASIS,
    BEST,
    CHOSEN,
    ENCLOSE,
    FACTOR,
    INVERSE,
    Scratch,
    candidates_of,
    row,
    square,
    weights_of,
)

MAX_COMBINATIONS = 924.0
"""Combinations that an exhaustive search tries: those of 6 among 12 edges. More come of unknown inputs only."""
TIE = 1e-9
"""Edges are exchanged for more than so much of the logarithm of the volume: a tie is not decided by rounding, which
depends on the units of the states."""


@inner
def choose(T: Matrix, G: Matrix, widths: Vector, delta: Vector, exhaustive: bool, work: Scratch) -> None:
    """Edges that leave little volume: greedy swaps, or ``exhaustive`` the best n of all candidates.

    Greedy too where there are more than ``MAX_COMBINATIONS``. Afterwards T holds the chosen edges; ``candidates_of``
    and ``weights_of`` the scratch are the other generators of ``T ⊕ G diag(widths)``; the rounding of the products
    went to delta.
    Source: Chisci, Garulli & Zappa 1996, theorem 1.
    """
    n, count = T.shape[0], T.shape[0]
    candidates, weights = candidates_of(work, n, widths.size), weights_of(work, n, widths.size)
    chosen, best = row(work, n, CHOSEN), row(work, n, BEST)
    edges, inverse, factor = square(work, n, BASIS), square(work, n, INVERSE), square(work, n, FACTOR)
    for i in range(n):
        chosen[i] = i
        rounded = 0.0
        for j in range(n):
            candidates[i, j], edges[i, j] = T[i, j], T[i, j]
        count = n
        for j in range(widths.size):
            if widths[j] > 0.0:
                candidates[i, count] = G[i, j] * widths[j]
                rounded += abs(candidates[i, count])
                count += 1
        for q in range(count, n + widths.size):
            candidates[i, q] = 0.0
        delta[i] = up(delta[i] + EPSILON * rounded)
    if exhaustive and _combinations(n, count) <= MAX_COMBINATIONS:
        _find_best(candidates, count, chosen, best, edges, inverse, factor)
    else:
        for q in range(n, count):
            if invert(edges, inverse, factor):
                _swap(edges, inverse, candidates, q, row(work, n, ENCLOSE), chosen)
    for q in range(n + widths.size):
        weights[q] = 1.0 if q < count else 0.0
    for j in range(n):
        weights[int(chosen[j])] = 0.0
        for i in range(n):
            T[i, j] = candidates[i, int(chosen[j])]


@inner
def _swap(edges: Matrix, inverse: Matrix, candidates: Matrix, q: int, alpha: Vector, chosen: Vector) -> None:
    """Enclose ``edges ⊕ candidate q``: all edges grow by ``1 + |α_j|``, ``α = edges⁻¹ g``, or g replaces edge k."""
    n = alpha.size
    least = 0.0
    for j in range(n):
        entry = 0.0
        for i in range(n):
            entry += inverse[j, i] * candidates[i, q]
        alpha[j] = abs(entry)
        least += math.log(1.0 + alpha[j])
    dropped = -1
    for k in range(n):
        if alpha[k] > 0.0:
            volume = math.log(alpha[k] + 1.0) - (n - 1) * math.log(alpha[k])
            for j in range(n):
                if j != k:
                    volume += math.log(alpha[k] + alpha[j])
            if volume < least - TIE:
                dropped, least = k, volume
    for j in range(n):
        if j == dropped:
            chosen[j] = q
        growth = 1.0 + (alpha[j] if dropped < 0 else alpha[j] / alpha[dropped])
        for i in range(n):
            if j == dropped:
                edges[i, j] = candidates[i, q] * (1.0 + 1.0 / alpha[j])
            else:
                edges[i, j] *= growth


@inner
def _find_best(
    candidates: Matrix, count: int, chosen: Vector, best: Vector, edges: Matrix, inverse: Matrix, factor: Matrix
) -> None:
    """The combination ``chosen`` of the first ``count`` candidates that leaves the least volume; starts from itself."""
    n = chosen.size
    least = math.inf
    for j in range(n):
        best[j] = chosen[j]
    searching = True
    while searching:
        for j in range(n):
            for i in range(n):
                edges[i, j] = candidates[i, int(chosen[j])]
        volume = _log_volume_along(edges, candidates, count, inverse, factor)
        if volume < least - TIE:
            least = volume
            for j in range(n):
                best[j] = chosen[j]
        searching = _next_combination(chosen, count)
    for j in range(n):
        chosen[j] = best[j]


@inner
def _log_volume_along(edges: Matrix, candidates: Matrix, count: int, inverse: Matrix, factor: Matrix) -> float:
    """Logarithm of ``|det V| Π_j Σ_q |V⁻¹ g_q|_j`` for the edges V; inf where they are dependent."""
    n = edges.shape[0]
    if not invert(edges, inverse, factor):
        return math.inf
    volume = log_abs_determinant(edges, factor)
    for j in range(n):
        reach = 0.0
        for q in range(count):
            entry = 0.0
            for i in range(n):
                entry += inverse[j, i] * candidates[i, q]
            reach += abs(entry)
        volume += math.log(reach)
    return volume if math.isfinite(volume) else math.inf


@inner
def _combinations(n: int, count: int) -> float:
    """Combinations of n among count."""
    number = 1.0
    for j in range(n):
        number *= (count - j) / (j + 1.0)
    return number


@inner
def _next_combination(chosen: Vector, count: int) -> bool:
    """The next n of ``count`` indices in lexicographic order; ``False`` after the last."""
    n = chosen.size
    j = n - 1
    while j >= 0 and chosen[j] == count - n + j:
        j -= 1
    if j < 0:
        return False
    chosen[j] += 1
    for i in range(j + 1, n):
        chosen[i] = chosen[i - 1] + 1
    return True
