"""Outer approximation of a constrained zonotope by one of limited complexity (Scott et al. 2016, §4; P2023 §3.1).

1. The variables are rescaled to their ranges over the set, which linear programs have found: that changes
   nothing in the set, and a variable forgotten or a column boxed later then costs what it really spans.
2. Parallel generators of the lifted zonotope become one, now and after step 3: that costs nothing.
3. Constraints are eliminated, the least harmful first, each with one generator.
4. Generators of the lifted zonotope are reduced, and all rounding is enclosed.
"""

from __future__ import annotations

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.runtime.compile import kernel
from lsu_mesh.kernels.zonotopes.constrained_zonotope import absorb_rows
from lsu_mesh.kernels.zonotopes.constraint_elimination import drop_constraint
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


@kernel
def reduce_complexity(
    c: Array,
    G: Array,
    A: Array,
    b: Array,
    low: Array,
    high: Array,
    max_generators: int,
    max_constraints: int,
) -> tuple[Array, Array, Array, Array]:
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
    dropped = L.shape[0] - n > wanted
    while L.shape[0] - n > wanted:
        L, middle, slack = drop_constraint(n, L, middle, slack)
        scale_constraints(n, L, middle, slack)
    if dropped:
        L = merge_parallel(L, slack)
    if max_generators >= 0:
        return unlift(n, reduce_columns(L, slack, max_generators), middle)
    c, G, A, b = unlift(n, L, middle)
    G, A = absorb_rows(G, A, slack[n:].copy())
    G, A = absorb_box(G, A, slack[:n].copy())
    return c, G, A, b
