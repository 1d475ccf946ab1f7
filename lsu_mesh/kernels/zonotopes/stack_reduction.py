"""Hull and reduction of a constrained zonotope of many constraints, all in one: of several sets that were intersected.

As :mod:`~lsu_mesh.kernels.zonotopes.complexity_reduction`, with two approximations that cost next to no tightness and
grow slower with the size. Ranges of the variables come from the rows of the last tableau, not from two programs
each; and how far each variable can move is computed once, before the first constraint is dropped, not before each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.linear_programs.implied_ranges import implied_ranges
from lsu_mesh.kernels.linear_programs.safe_maxima import EMPTY, LOOSE, maxima, open_program
from lsu_mesh.kernels.runtime.compile import inner, kernel
from lsu_mesh.kernels.zonotopes.constrained_zonotope import absorb_rows
from lsu_mesh.kernels.zonotopes.constraint_elimination import eliminate, movability, overruns
from lsu_mesh.kernels.zonotopes.generator_reduction import reduce_columns
from lsu_mesh.kernels.zonotopes.lifted_zonotope import (
    lift,
    rescale_variables,
    scale_constraints,
    unlift,
    without_zero_columns,
)
from lsu_mesh.kernels.zonotopes.parallel_generators import merge_parallel
from lsu_mesh.kernels.zonotopes.zonotope import absorb_box

Body = tuple[Array, Array, Array, Array]


@kernel
def settle_stack(
    c: Array, G: Array, A: Array, b: Array, max_generators: int, max_constraints: int
) -> tuple[int, Array, Body]:
    """Safe maxima (2n,) of ``± G ξ``, and a set within the limits that contains ``(c, G, A, b)``; −1 is no limit.

    The status is that of :func:`~lsu_mesh.kernels.linear_programs.safe_maxima.maxima`: ``EMPTY`` is proved, and then
    the set is the given one; ``LOOSE`` maxima are true and not reached.
    """
    n, g = G.shape
    status, program = open_program(A, b)
    if status == EMPTY:
        return status, np.full(2 * n, -np.inf), (c, G, A, b)
    D = np.empty((2 * n, g))
    for i in range(n):
        for j in range(g):
            D[i, j], D[n + i, j] = G[i, j], -G[i, j]
    solved, values, _ = maxima(program, D)
    if solved == LOOSE:
        status = LOOSE
    if (max_generators < 0 or g <= max_generators) and (max_constraints < 0 or b.size <= max_constraints):
        return status, values, (c, G, A, b)
    low, high = implied_ranges(program)
    return status, values, reduce_stack(c, G, A, b, low, high, max_generators, max_constraints)


@kernel
def reduce_stack(
    c: Array, G: Array, A: Array, b: Array, low: Array, high: Array, max_generators: int, max_constraints: int
) -> Body:
    """A set with at most so many generators and constraints that contains ``(c, G, A, b)``; −1 is no limit.

    ``low``, ``high`` (g,): ranges of the ξ_j over the set. ``max_generators ≥ n``; constraints are given up where n + m
    would exceed it. Without a limit of generators the rounding may add some.
    """
    n = c.size
    L, middle, slack = lift(c, G, A, b)
    rescale_variables(L, middle, slack, low, high)
    L = without_zero_columns(L)
    wanted = A.shape[0]
    if max_constraints >= 0:
        wanted = min(wanted, max_constraints)
    if max_generators >= 0:
        wanted = min(wanted, max_generators - n)
    scale_constraints(n, L, middle, slack)
    L = merge_parallel(L, slack)
    if L.shape[0] - n > wanted:
        L, middle, slack = drop_constraints(n, L, middle, slack, wanted)
        L = merge_parallel(L, slack)
    if max_generators >= 0:
        return unlift(n, reduce_columns(L, slack, max_generators), middle)
    c, G, A, b = unlift(n, L, middle)
    G, A = absorb_rows(G, A, slack[n:].copy())
    G, A = absorb_box(G, A, slack[:n].copy())
    return c, G, A, b


@inner
def drop_constraints(n: int, L: Array, middle: Array, slack: Array, wanted: int) -> tuple[Array, Array, Array]:
    """Remove constraints and as many generators, the least harmful first, until ``wanted`` constraints are left.

    The harm is estimated as in :func:`~lsu_mesh.kernels.zonotopes.constraint_elimination.drop_constraint`. Constraint
    rows must be scaled; L is spoilt. A row that was used is set to zero and taken out in the end.
    """
    N, g = L.shape
    row_of = np.empty(g, dtype=np.int64)
    beyond = np.empty(g)
    freedom = movability(n, L)
    used = np.zeros(N, dtype=np.bool_)
    left = N - n
    while left > wanted:
        overruns(n, L, middle, row_of, beyond)
        best, j_best = np.inf, -1
        for j in range(g):
            if row_of[j] < 0:
                continue
            harm = 0.0 if beyond[j] == 0.0 else beyond[j] * beyond[j] / max(freedom[j], 1e-14)
            if harm < best:
                best, j_best = harm, j
        if j_best < 0:  # rows of zeros: forgetting a constraint is an outer approximation too
            i_best = N - 1
            while used[i_best]:
                i_best -= 1
        else:
            i_best = row_of[j_best]
            eliminate(L, middle, slack, i_best, j_best)
        used[i_best] = True
        left -= 1
        for j in range(g):
            L[i_best, j] = 0.0
        middle[i_best] = 0.0
        slack[i_best] = 0.0
        scale_constraints(n, L, middle, slack)
    return _without_rows(L, middle, slack, used, n + left)


@inner
def _without_rows(
    L: Array, middle: Array, slack: Array, used: NDArray[np.bool_], left: int
) -> tuple[Array, Array, Array]:
    """The ``left`` rows that were not used, and the columns in which they are not zero."""
    rows = np.empty((left, L.shape[1]))
    middles = np.empty(left)
    slacks = np.empty(left)
    s = 0
    for i in range(L.shape[0]):
        if not used[i]:
            for j in range(L.shape[1]):
                rows[s, j] = L[i, j]
            middles[s], slacks[s] = middle[i], slack[i]
            s += 1
    return without_zero_columns(rows), middles, slacks
