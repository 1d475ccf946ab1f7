"""Problems for a filter: a model, a prior, and a true path in exact rationals, at the edges of what is allowed."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Vector
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.intersection import Intersection
from lsu_mesh.supports.orthotope import Orthotope
from lsu_mesh.supports.parallelotope import Parallelotope
from lsu_mesh.supports.support import Support
from lsu_mesh.supports.zonotope import Zonotope
from lsu_mesh.testing.exact_plant import (
    EXTREMES,
    KINDS,
    Case,
    Exact,
    draw_case,
    inside_box,
    measured,
    next_state,
    start,
    unit_noise,
)
from lsu_mesh.testing.membership import is_outside

OCCASIONS = ("missing rows", "input box", "domain", "bounds of a step", "model of a step")
"""What a filter may be told beside outputs and inputs."""
PROBLEMS = (*KINDS, *EXTREMES, *OCCASIONS)
SHARE = Fraction(999_999, 1_000_000)
"""Where on the way from the true state to a vertex a common point is looked for: vertices are rounded."""
MAX_CANDIDATES = 8
"""Vertices that are tried, for each exact decision takes milliseconds."""
SHAPES = ("box", "parallelotope", "zonotope", "intersection", "constrained zonotope", "own set")
"""Sets of another filter that a filter is conditioned on."""


class Moment(NamedTuple):
    """One step: the exact state, what the filter gets (``None``: nothing is said), and the true input that follows."""

    x: Exact
    y: Vector
    r: Vector | None
    u: Vector | Orthotope | None
    rho: Vector | None
    model: LSUModel | None


class Problem(NamedTuple):
    """``path`` has one moment more than there are time updates."""

    kind: str
    seed: int
    model: LSUModel
    prior: Orthotope
    path: tuple[Moment, ...]


def draw_problem(seed: int, steps: int) -> Problem:
    """The problem of a seed; seeds that follow each other go through all kinds of ``PROBLEMS``."""
    kind = PROBLEMS[seed % len(PROBLEMS)]
    rng = np.random.default_rng(seed)
    case = draw_case(rng, "stable" if kind in OCCASIONS else kind)
    while kind == "input box" and case.model.B is None:
        case = draw_case(rng, "stable")
    path, x = [], start(case, rng)
    for _ in range(steps):
        moment, x = _draw_moment(rng, kind, case, x)
        path.append(moment)
    model = case.model
    if kind == "domain":
        model = model.replace(domain=box_around([moment.x for moment in path]))
    return Problem(kind=kind, seed=seed, model=model, prior=case.prior, path=tuple(path))


def _draw_moment(rng: np.random.Generator, kind: str, case: Case, x: Exact) -> tuple[Moment, Exact]:
    """What happens at the state x, and the next state."""
    model, r, rho, other = case.model, None, None, None
    if kind == "bounds of a step":
        r = model.r * rng.choice([0.3, 1.0, 4.0], size=model.r.size)
        rho = model.rho * rng.choice([0.3, 1.0, 4.0], size=model.rho.size)
    if kind == "model of a step" and rng.random() < 0.6:
        other = model.replace(A=model.A + 0.3 * rng.normal(size=model.A.shape), rho=2.0 * model.rho)
    y = measured(model.C, model.r if r is None else r, x, unit_noise(rng, model.output_count, case.inside))
    if kind == "missing rows":
        y[rng.random(y.size) < 0.4] = np.nan
    u = rng.normal(size=model.input_count)
    told: Vector | Orthotope | None = None if model.B is None else u
    if kind == "input box" and rng.random() < 0.7:
        end = u + rng.normal(size=u.size)
        told = Orthotope(np.minimum(u, end), np.maximum(u, end))
    used = other or model
    noise = unit_noise(rng, model.rho.size, case.inside)
    return Moment(x=x, y=y, r=r, u=told, rho=rho, model=other), next_state(
        used, x, u, rho=used.rho if rho is None else rho, noise=noise
    )


def around(x: Exact, shape: str, widths: Vector, own: Support, rng: np.random.Generator) -> Support | None:
    """A set of this shape that holds the exact state x (n,), which lies at its edge, about ``widths`` (n,) wide.

    ``None`` where rounding has put the state outside.
    """
    n = len(x)
    half = np.where(widths > 0, widths, 1e-3 * np.array([abs(float(v)) for v in x]) + 1e-3) * rng.uniform(0.05, 0.5, n)
    if shape == "own set":
        return own
    corner, is_lower = box_around([x]), rng.random(n) < 0.5
    box = Orthotope(
        np.where(is_lower, corner.lower, corner.lower - half), np.where(is_lower, corner.upper + half, corner.upper)
    )
    if shape == "box":
        return box
    if shape in ("intersection", "constrained zonotope"):
        body = around(x, "parallelotope", widths, own=own, rng=rng)
        if body is None:
            return None
        return Intersection([body, box]) if shape == "intersection" else body.intersect(box)
    g = n if shape == "parallelotope" else n + 2
    G = half[:, None] * rng.normal(size=(n, g))
    center = np.array([float(v) for v in x]) - 0.9999 * (G @ rng.choice([-1.0, 1.0], size=g))
    made: Support = Parallelotope(center, G) if shape == "parallelotope" else Zonotope(center, G)
    return None if is_outside(made, x) else made


def common_points(
    x: Exact, own: Support, bounds: tuple[Vector, Vector], other: Support, rng: np.random.Generator
) -> list[Exact]:
    """Exact points at the edges of the intersection of two sets that both hold x: next to their vertices."""
    corners = [*own.vertices(), *other.vertices()]
    found = []
    for i in rng.permutation(len(corners))[:MAX_CANDIDATES].tolist():
        point = [v + SHARE * (Fraction(float(c)) - v) for v, c in zip(x, corners[i], strict=True)]
        if inside_box(*bounds, point) and not is_outside(own, point) and not is_outside(other, point):
            found.append(point)
    return found


def box_around(points: list[Exact]) -> Orthotope:
    """The smallest box of doubles that holds exact points (n,)."""
    columns = list(zip(*points, strict=True))
    return Orthotope(
        [rounded(min(column), -math.inf) for column in columns], [rounded(max(column), math.inf) for column in columns]
    )


def rounded(value: Fraction, toward: float) -> float:
    """The double nearest to a rational on the side of ``toward``, ±inf."""
    nearest = float(value)
    wrong = Fraction(nearest) < value if toward > 0 else Fraction(nearest) > value
    return math.nextafter(nearest, toward) if wrong else nearest
