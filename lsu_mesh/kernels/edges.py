"""Time updates that choose the edges of the enclosing parallelotope among those of ``A P`` and of the noise.

The candidates are the columns of ``[T  G diag(widths)]``. Which of them become edges is found in plain floating point; the
zonotope is then enclosed along these edges and verified as any other (``kernels/enclosure.py``).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.kernels.compile import kernel
from lsu_mesh.kernels.enclosure import enclose
from lsu_mesh.kernels.linear_algebra import invert, log_abs_determinant
from lsu_mesh.kernels.rounding import EPSILON, up
from lsu_mesh.kernels.scratch import BASIS, FACTOR, INVERSE, Scratch

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]
Indices = NDArray[np.int64]


@kernel
def enclose_by_swaps(T: Matrix, G: Matrix, widths: Vector, delta: Vector, work: Scratch) -> bool:
    """``T ← T'`` around ``T ⊕ G diag(widths) ⊕ box(delta)``: one noise generator at a time takes the place of an edge, or
    of none, whichever leaves the least volume. Source: Chisci, Garulli & Zappa 1996, theorem 1.
    """
    n = T.shape[0]
    edges, inverse = work.squares[BASIS], work.squares[INVERSE]
    _list_candidates(T, G, widths, work)
    for j in range(n):
        work.chosen[j] = j
        for i in range(n):
            edges[i, j] = T[i, j]
    for q in range(n, n + widths.size):
        if widths[q - n] > 0.0:
            if not invert(edges, inverse, work.squares[FACTOR]):
                return enclose(T, G, widths, delta, work)
            _swap(edges, inverse, work.candidates, q, work.vectors[0], work.chosen)
    return _enclose_chosen(T, widths.size, delta, work.chosen, work)


@kernel
def enclose_along_best_edges(T: Matrix, G: Matrix, widths: Vector, delta: Vector, work: Scratch) -> bool:
    """``T ← T'`` around ``T ⊕ G diag(widths) ⊕ box(delta)`` along those n of all candidates that leave the least volume."""
    n, count = T.shape[0], T.shape[0] + widths.size
    _list_candidates(T, G, widths, work)
    least = math.inf
    for j in range(n):
        work.chosen[j] = j
    while True:
        volume = _log_volume_along(work.chosen, count, work)
        if volume < least:
            least = volume
            for j in range(n):
                work.best[j] = work.chosen[j]
        if not _next_combination(work.chosen, count):
            break
    if least == math.inf:
        return enclose(T, G, widths, delta, work)
    return _enclose_chosen(T, widths.size, delta, work.best, work)


@kernel
def _list_candidates(T: Matrix, G: Matrix, widths: Vector, work: Scratch) -> None:
    n = T.shape[0]
    for i in range(n):
        for j in range(n):
            work.candidates[i, j] = T[i, j]
        for j in range(widths.size):
            work.candidates[i, n + j] = G[i, j] * widths[j]


@kernel
def _swap(edges: Matrix, inverse: Matrix, candidates: Matrix, q: int, alpha: Vector, chosen: Indices) -> None:
    """Enclose ``edges ⊕ candidate q``: all edges grow by ``1 + |α_j|``, ``α = edges⁻¹ g``, or g replaces edge k."""
    n = alpha.size
    keep = 0.0
    for j in range(n):
        entry = 0.0
        for i in range(n):
            entry += inverse[j, i] * candidates[i, q]
        alpha[j] = abs(entry)
        keep += math.log(1.0 + alpha[j])
    dropped, least = -1, keep
    for k in range(n):
        if alpha[k] > 0.0:
            volume = math.log(alpha[k] + 1.0) - (n - 1) * math.log(alpha[k])
            for j in range(n):
                if j != k:
                    volume += math.log(alpha[k] + alpha[j])
            if volume < least:
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


@kernel
def _log_volume_along(chosen: Indices, count: int, work: Scratch) -> float:
    """Logarithm of ``|det V| Π_j Σ_q |V⁻¹ g_q|_j`` for the chosen columns V; inf where they are dependent."""
    n = chosen.size
    edges, inverse = work.squares[BASIS], work.squares[INVERSE]
    for j in range(n):
        for i in range(n):
            edges[i, j] = work.candidates[i, chosen[j]]
    if not invert(edges, inverse, work.squares[FACTOR]):
        return math.inf
    volume = log_abs_determinant(edges, work.squares[FACTOR])
    for j in range(n):
        reach = 0.0
        for q in range(count):
            entry = 0.0
            for i in range(n):
                entry += inverse[j, i] * work.candidates[i, q]
            reach += abs(entry)
        volume += math.log(reach)
    return volume if math.isfinite(volume) else math.inf


@kernel
def _next_combination(chosen: Indices, count: int) -> bool:
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


@kernel
def _enclose_chosen(T: Matrix, noise_count: int, delta: Vector, chosen: Indices, work: Scratch) -> bool:
    """Enclose all candidates along the chosen ones; the rounding of ``G diag(widths)`` goes to delta."""
    n = T.shape[0]
    count = n + noise_count
    for i in range(n):
        rounded = 0.0
        for q in range(n, count):
            rounded += abs(work.candidates[i, q])
        delta[i] = up(delta[i] + EPSILON * rounded)
    for q in range(work.weights.size):
        work.weights[q] = 1.0 if q < count else 0.0
    for j in range(n):
        work.weights[chosen[j]] = 0.0
        for i in range(n):
            T[i, j] = work.candidates[i, chosen[j]]
    return enclose(T, work.candidates, work.weights, delta, work)
