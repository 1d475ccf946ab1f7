"""Interval hulls of constrained zonotopes, beside other solvers; what their safe bounds cost and lose."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numba
import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.experiments.kernel_speed.other_libraries import (
    Body,
    installed,
    linprog_hull,
    warm_highs_hull,
    zonoopt_hull,
)
from lsu_mesh.experiments.kernel_speed.stopwatch import Candidate, compare
from lsu_mesh.kernels.linear_programs.dual_bound import absolute_row_sums, dual_bound_in
from lsu_mesh.kernels.linear_programs.safe_maxima import maxima, open_program
from lsu_mesh.supports.constrained_zonotope import ConstrainedZonotope

Hull = Callable[[], tuple[Vector, Vector]]

DIMENSION, GENERATORS, CONSTRAINTS = 3, 20, 8
REPEATED = 50
SOLVERS = {"linprog": "scipy", "highspy": "highspy", "zonoopt": "zonoopt"}
MAKERS: dict[str, Callable[..., Hull]] = {
    "linprog": linprog_hull,
    "highspy": warm_highs_hull,
    "zonoopt": zonoopt_hull,
}


class HullCost(NamedTuple):
    """Mean seconds per hull of each solver that is installed, and its largest difference from our bounds, relative to
    the widths of the hull; negative ``inside`` would be a bound of ours that a solver's point exceeds."""

    sets: int
    seconds: dict[str, float]
    difference: dict[str, float]


class SafeBounds(NamedTuple):
    """Share of a hull's time that goes into verified bounds, and the largest relative distance of a bound from an
    exact feasible value."""

    share: float
    loss: float


def random_set(seed: int, n: int = DIMENSION, g: int = GENERATORS, m: int = CONSTRAINTS) -> Body:
    """(c, G, A, b) with normal entries, centre 0, and a feasible point in [−½, ½]^g."""
    random = np.random.default_rng(seed)
    G, A = random.normal(size=(n, g)), random.normal(size=(m, g))
    return np.zeros(n), G, A, A @ random.uniform(-0.5, 0.5, g)


def own_hull(c: Vector, G: Matrix, A: Matrix, b: Vector) -> Hull:
    """:meth:`ConstrainedZonotope.bounds`, of a set that is made anew because a set remembers its hull."""
    return lambda: ConstrainedZonotope.of_arrays(c, G, A, b).bounds()


def hull_cost(sets: int, rounds: int, seconds: float) -> HullCost:
    """Hulls of so many random sets of 20 generators, 8 constraints, dimension 3."""
    bodies = [random_set(seed) for seed in range(sets)]
    makers = {"own": own_hull} | {name: MAKERS[name] for name, package in SOLVERS.items() if installed(package)}
    hulls = {name: [make(*body) for body in bodies] for name, make in makers.items()}
    difference = {name: _difference(hulls["own"], hulls[name]) for name in hulls if name != "own"}
    candidates = {name: Candidate(functools.partial(_all, of), sets) for name, of in hulls.items()}
    return HullCost(sets, compare(candidates, rounds, seconds), difference)


def _all(hulls: Sequence[Hull]) -> None:
    for hull in hulls:
        hull()


def _difference(own: Sequence[Hull], other: Sequence[Hull]) -> float:
    largest = 0.0
    for ours, theirs in zip(own, other, strict=True):
        (lower, upper), (low, high) = ours(), theirs()
        largest = max(largest, float(np.max(np.maximum(abs(lower - low), abs(upper - high)) / (upper - lower))))
    return largest


def safe_bounds(sets: int, rounds: int, seconds: float) -> SafeBounds:
    """What the safe bounds cost, in compiled loops over the same sets, and what they lose."""
    problems = [(A, b, np.concatenate((G, -G))) for _, G, A, b in map(random_set, range(sets))]
    times = []
    for A, b, D in problems[: max(3, sets // 5)]:
        multipliers = np.array([_multipliers(A, b, d) for d in D])
        candidates = {
            "hull": Candidate(functools.partial(repeated_hulls(), A, b, D, REPEATED), REPEATED),
            "bounds": Candidate(functools.partial(repeated_bounds(), A, b, D, multipliers, REPEATED), REPEATED),
        }
        times.append(compare(candidates, rounds, seconds))
    share = sum(one["bounds"] for one in times) / sum(one["hull"] for one in times)
    return SafeBounds(share, max(relative_loss(A, b, D) for A, b, D in problems))


@functools.cache
def repeated_hulls() -> Any:
    """``maxima`` of all rows of D, opened anew ``count`` times, in a compiled loop."""

    @numba.njit(error_model="numpy")
    def loop(A: Matrix, b: Vector, D: Matrix, count: int) -> float:
        total = 0.0
        for _ in range(count):
            _, program = open_program(A, b)
            _, values, _ = maxima(program, D)
            total += values[0]
        return total

    return loop


@functools.cache
def repeated_bounds() -> Any:
    """The safe bounds of such a hull alone: sums of the rows once, then one bound per row of D."""

    @numba.njit(error_model="numpy")
    def loop(A: Matrix, b: Vector, D: Matrix, multipliers: Matrix, count: int) -> float:
        total = 0.0
        reach, room = np.ones(D.shape[1]), np.empty(D.shape[1])
        for _ in range(count):
            sums = absolute_row_sums(A, reach)
            for k in range(D.shape[0]):
                total += dual_bound_in(D[k], A, b, reach, sums, multipliers[k], room)
        return total

    return loop


def _multipliers(A: Matrix, b: Vector, d: Vector) -> Vector:
    from scipy.optimize import linprog

    return np.array(-linprog(-d, A_eq=A, b_eq=b, bounds=(-1, 1), method="highs").eqlin.marginals)


def relative_loss(A: Matrix, b: Vector, D: Matrix) -> float:
    """``max (bound − exact)/|exact|`` over the rows of D, ``exact`` the rational value of a feasible vertex.

    Such a value is no greater than the maximum, so that the loss is never understated. A bound below it, which would
    be a broken guarantee, raises.
    """
    _, values, points = maxima(open_program(A, b)[1], D)
    worst = 0.0
    for d, value, point in zip(D, values, points, strict=True):
        exact = sum((Fraction(a) * x for a, x in zip(d, exact_vertex(A, b, point), strict=True)), Fraction(0))
        loss = float((Fraction(float(value)) - exact) / abs(exact))
        assert loss >= 0.0, "a safe bound lies below the value of a feasible point"
        worst = max(worst, loss)
    return worst


def exact_vertex(A: Matrix, b: Vector, point: Vector) -> list[Fraction]:
    """The vertex at ``point`` in exact arithmetic: entries at ±1 stay, the others solve ``A ξ = b``.

    Raises ``ValueError`` where that is no feasible vertex with m basic entries.
    """
    m = A.shape[0]
    basic = [j for j, x in enumerate(point) if abs(x) != 1.0]
    if len(basic) != m:
        raise ValueError(f"a vertex with {m} basic entries is expected, it has {len(basic)}")
    xi = [Fraction(float(x)) for x in point]
    rows = [
        [Fraction(float(row[j])) for j in basic]
        + [Fraction(float(side)) - sum(Fraction(float(a)) * x for a, x in zip(row, xi, strict=True) if abs(x) == 1)]
        for row, side in zip(A, b, strict=True)
    ]
    for k in range(m):
        pivot = next(i for i in range(k, m) if rows[i][k] != 0)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(m):
            if i != k and rows[i][k] != 0:
                factor = rows[i][k] / rows[k][k]
                rows[i] = [a - factor * e for a, e in zip(rows[i], rows[k], strict=True)]
    for k, j in enumerate(basic):
        xi[j] = rows[k][m] / rows[k][k]
    if any(abs(x) > 1 for x in xi):
        raise ValueError("the vertex is not feasible")
    return xi
