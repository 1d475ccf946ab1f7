"""The steps of LSU-CZ in compiled code: a constrained zonotope X = (c, G, A, b), and a box [lower, upper] beside it.

Each function returns what became of it. ``TROUBLED``: the simplex was stopped by rounding, and the caller has to do
the step with another solver; nothing is lost then but time.
"""

from __future__ import annotations

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.kernels.linear_programs.safe_maxima import EMPTY as PROVED_EMPTY
from lsu_mesh.kernels.linear_programs.safe_maxima import TIGHT, maxima, open_program, variable_ranges
from lsu_mesh.kernels.parallelotopes.box import keep_constants
from lsu_mesh.kernels.runtime.compile import inner
from lsu_mesh.kernels.runtime.splicing import spliced
from lsu_mesh.kernels.zonotopes.complexity_reduction import reduce_complexity
from lsu_mesh.kernels.zonotopes.constrained_zonotope import meet_strips
from lsu_mesh.kernels.zonotopes.time_update import Body, predict_constrained
from lsu_mesh.kernels.zonotopes.zonotope import zonotope_map

DONE = 0
EMPTY = 1
"""The set is proved to be empty."""
TROUBLED = 2
UNBOUNDED = 3
"""Numbers have outgrown double precision."""


@spliced
def allows(max_generators: int, max_constraints: int, A: Array) -> bool:
    """Whether the set with these constraints is within the limits; −1 is no limit."""
    m, g = A.shape
    return (max_generators < 0 or g <= max_generators) and (max_constraints < 0 or m <= max_constraints)


@spliced
def settle(
    body: Body, lower: Array, upper: Array, max_generators: int, max_constraints: int
) -> tuple[int, Body]:  # fmt: skip
    """Meet the box, in place, with the interval hull of X; then X reduced to the limits.

    The reduced set contains the given one, so the box is also its hull met with the given box.
    """
    c, G, A, b = body
    status, program = open_program(A, b)
    if status != TIGHT:
        return (EMPTY if status == PROVED_EMPTY else TROUBLED), body
    solved, values, points = maxima(program, both_signs(G))
    if solved != TIGHT:
        return TROUBLED, body
    if meet_values(c, values, lower, upper):
        return EMPTY, body
    if not allows(max_generators, max_constraints, A):
        low, high = variable_ranges(program, points)
        body = reduce_complexity(c, G, A, b, low, high, max_generators, max_constraints)
    return DONE, body


@inner
def extremes(D: Array, A: Array, b: Array) -> tuple[bool, Array]:
    """Safe maxima (2k,) of D ξ, then of −D ξ, D (k, g), over the variables of X; ``False`` where they are loose."""
    status, program = open_program(A, b)
    if status != TIGHT:
        return False, program.sides
    solved, values, _ = maxima(program, both_signs(D))
    return solved == TIGHT, values


@spliced
def meet_hull(body: Body, lower: Array, upper: Array) -> int:
    """Meet the box, in place, with the interval hull of X."""
    c, G, A, b = body
    tight, values = extremes(G, A, b)
    return TROUBLED if not tight or meet_values(c, values, lower, upper) else DONE


@spliced
def image(body: Body, P: Array, low: Array, high: Array) -> int:
    """Fills low, high (k,): bounds of ``P x`` over X, P (k, n), rounded outward."""
    c, G, A, b = body
    k = P.shape[0]
    middle, objectives, slack = zonotope_map(P, c, G, np.zeros(k))
    tight, values = extremes(objectives, A, b)
    for i in range(k):
        if tight:
            high[i] = np.nextafter(np.nextafter(middle[i] + values[i], np.inf) + slack[i], np.inf)
            low[i] = np.nextafter(np.nextafter(middle[i] - values[k + i], -np.inf) - slack[i], -np.inf)
    return DONE if tight else TROUBLED


@inner
def both_signs(D: Array) -> Array:
    """``[D; −D]``"""
    k, g = D.shape
    both = np.empty((2 * k, g))
    for i in range(k):
        for j in range(g):
            both[i, j], both[k + i, j] = D[i, j], -D[i, j]
    return both


@inner
def meet_values(c: Array, values: Array, lower: Array, upper: Array) -> bool:
    """Meet the box with ``[c − values_{n…}, c + values_{…n}]``, rounded outward; whether nothing is left."""
    n = c.size
    empty = False
    for i in range(n):
        upper[i] = min(upper[i], np.nextafter(c[i] + values[i], np.inf))
        lower[i] = max(lower[i], np.nextafter(c[i] - values[n + i], -np.inf))
        empty = empty or lower[i] > upper[i]
    return empty


@spliced
def change(
    predicts: bool, body: Body, lower: Array, upper: Array, is_hull: bool, P: Array, y: Array, r: Array,
    A: Array, B: Array, u: Array, N: Array, widths: Array, domain: Array, max_generators: int, max_constraints: int,
) -> tuple[int, Body, Array, Array, bool]:  # fmt: skip
    """The data update with ``|y − P x| ≤ r``, NaN for none, or the time update ``A X ⊕ B u ⊕ N box(widths)``.

    P (m, n); domain (0, n), or its lower, upper, centre and half-widths (4, n). Where the status is not ``DONE`` the
    set is the one that was given; the last entry tells whether the box is met with the hull.
    """
    given = body
    low, high = lower.copy(), upper.copy()
    if predicts:
        settles = not allows(max_generators, max_constraints, body[2])
    else:
        settles = False
        for i in range(y.size):
            settles = settles or not np.isnan(y[i])
        if not settles:
            return DONE, body, lower, upper, is_hull
        c, G, rows, sides = body
        G, rows, sides = meet_strips(c, G, rows, sides, P, y, r)
        body = (c, G, rows, sides)
    if settles:
        status, body = settle(body, low, high, max_generators, max_constraints)
        if status != DONE:
            return status, given, lower, upper, is_hull
    if not predicts:
        return DONE, body, low, high, True
    if not settles and not is_hull and meet_hull(body, low, high) != DONE:
        return TROUBLED, given, lower, upper, is_hull
    finite, body, new_low, new_high = predict_constrained(body, low, high, A, B, u, N, widths)
    keep_constants(low, high, A, B, u, N, widths, new_low, new_high)
    if not finite:
        return UNBOUNDED, given, lower, upper, is_hull
    if domain.shape[0] > 0:
        status, body = _within(body, new_low, new_high, domain)
        if status != DONE:
            return status, given, lower, upper, is_hull
    return DONE, body, new_low, new_high, False


@spliced
def _within(body: Body, lower: Array, upper: Array, domain: Array) -> tuple[int, Body]:
    """Meet with the domain; only coordinates in which the set exceeds it cost a generator and a constraint."""
    c, G, A, b = body
    n = lower.size
    middle = np.full(n, np.nan)
    exceeds = False
    for i in range(n):
        exceeds = exceeds or lower[i] < domain[0, i] or upper[i] > domain[1, i]
    if exceeds:
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        if meet_hull(body, low, high) != DONE:
            return TROUBLED, body
        for i in range(n):
            is_outside = lower[i] < domain[0, i] or upper[i] > domain[1, i]
            if is_outside and (low[i] < domain[0, i] or high[i] > domain[1, i]):
                middle[i] = domain[2, i]
        G, A, b = meet_strips(c, G, A, b, np.eye(n), middle, domain[3])
    for i in range(n):
        lower[i], upper[i] = max(lower[i], domain[0, i]), min(upper[i], domain[1, i])
        if lower[i] > upper[i]:
            return EMPTY, body
    if A.shape[0] > 0:
        status, _ = open_program(A, b)
        if status != TIGHT:
            return (EMPTY if status == PROVED_EMPTY else TROUBLED), body
    return DONE, (c, G, A, b)
