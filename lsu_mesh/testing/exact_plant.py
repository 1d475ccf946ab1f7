"""A plant in exact rationals: the truth against which a guarantee is tested, noise at the corners included."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.model import LSUModel
from lsu_mesh.supports.orthotope import Orthotope

Exact = list[Fraction]

KINDS = ("stable", "unstable", "singular", "rank one", "degenerate", "dyadic", "flat prior", "mixed scales")
"""Ordinary and degenerate models, whose numbers are far from the limits of double precision."""
EXTREMES = ("one state", "no noise", "huge prior", "no output", "large numbers", "small numbers")
"""Models at the limits: nothing known before, nothing measured, numbers of 1e150 and of 1e-150."""
LARGEST, SMALLEST, HUGE = 1e150, 1e-150, 1e9


class Case(NamedTuple):
    """A model, a prior, and whether the noise is drawn inside its bounds or at their corners."""

    model: LSUModel
    prior: Orthotope
    inside: bool


class Step(NamedTuple):
    """State of the step (exact), the outputs as the filter gets them, the input that drives it on."""

    x: Exact
    y: Vector
    u: Vector


def draw_case(rng: np.random.Generator, kind: str) -> Case:
    """A random model of this kind: n 1–6, m 1–4, scale 1e-6 … 1e6, an input in half of the cases.

    With mixed scales each state and each output has a unit of its own, 1e-6 … 1e6 of the others'.
    """
    n, m = 1 if kind == "one state" else int(rng.integers(1, 7)), int(rng.integers(1, 5))
    scale = {"large numbers": LARGEST, "small numbers": SMALLEST}.get(kind) or 10.0 ** int(rng.integers(-6, 7))
    if kind == "dyadic":  # everything is representable for some steps, so that r = 0 and rho = 0 can be true
        A = rng.integers(-2, 3, size=(n, n)) / 2.0
        C = rng.integers(-2, 3, size=(m, n)) / 2.0
        rho, r = rng.choice([0.0, 0.5, 1.0], size=n), rng.choice([0.0, 0.25], size=m)
        return Case(LSUModel(A=A, B=None, C=C, rho=rho, r=r), Orthotope(-np.ones(n), np.ones(n)), False)
    A = rng.normal(size=(n, n))
    A *= {"unstable": 1.3}.get(kind, 0.9) / max(1e-9, np.abs(np.linalg.eigvals(A)).max())
    if kind == "singular":
        A[:, 0] = A[:, -1] if n > 1 else 0.0
    B = rng.normal(size=(n, 1)) if rng.random() < 0.5 else None
    noise_map = rng.normal(size=(n, 1)) if kind == "rank one" else None
    rho = scale * rng.random(n if noise_map is None else 1)
    r = scale * (0.05 + rng.random(m))
    if kind == "degenerate":
        rho, r = rho * rng.choice([0.0, 1e-9, 1.0], size=n), r * 1e-7
    if kind == "no noise":
        rho = 0.0 * rho
    center, widths = scale * rng.normal(size=n), scale * (0.1 + rng.random(n))
    if kind == "flat prior":
        widths *= rng.choice([0.0, 1.0], size=n)
    if kind == "huge prior":
        widths *= HUGE
    C = rng.normal(size=(m, n))
    if kind == "no output":
        C, r = C[:0], r[:0]
    if kind == "mixed scales":
        units, output_units = 10.0 ** rng.uniform(-6, 6, n), 10.0 ** rng.uniform(-6, 6, m)
        A, C = A * units[:, None] / units, C * output_units[:, None] / units
        B = None if B is None else B * units[:, None]
        rho, r, center, widths = rho * units, r * output_units, center * units, widths * units
    model = LSUModel(A=A, B=B, C=C, rho=rho, r=r, noise_map=noise_map)
    return Case(model, Orthotope(center - widths, center + widths), bool(rng.random() < 0.3))


def exact_steps(case: Case, rng: np.random.Generator, steps: int) -> Iterator[Step]:
    """Simulate in rationals from a corner (or the inside) of the prior; outputs end the sequence where none is true."""
    model = case.model
    x = start(case, rng)
    for _ in range(steps):
        y = measured(model.C, model.r, x, unit_noise(rng, model.output_count, case.inside))
        u = rng.normal(size=model.input_count)
        yield Step(x, y, u)
        x = next_state(model, x, u, rho=model.rho, noise=unit_noise(rng, model.rho.size, case.inside))


def start(case: Case, rng: np.random.Generator) -> Exact:
    """x_1 at a corner of the prior, or inside it."""
    lower, upper = case.prior.bounds()
    share = unit_noise(rng, lower.size, case.inside)
    return [
        (Fraction(a) + Fraction(z)) / 2 + (Fraction(z) - Fraction(a)) / 2 * s
        for a, z, s in zip(lower.tolist(), upper.tolist(), share, strict=True)
    ]


def next_state(model: LSUModel, x: Exact, u: Vector, rho: Vector, noise: Exact) -> Exact:
    """``A x + B u + N diag(rho) noise``, noise (q,) in [−1, 1], without rounding."""
    N = np.eye(model.state_count) if model.noise_map is None else model.noise_map
    w = [Fraction(a) * s for a, s in zip(rho.tolist(), noise, strict=True)]
    parts = [exact_product(model.A, x), exact_product(N, w)]
    if model.B is not None:
        parts.append(exact_product(model.B, [Fraction(v) for v in u.tolist()]))
    return [sum(entries, Fraction(0)) for entries in zip(*parts, strict=True)]


def unit_noise(rng: np.random.Generator, size: int, inside: bool) -> Exact:
    """Noise in [−1, 1], at its ends unless ``inside``."""
    if inside:
        return [Fraction(v) for v in rng.uniform(-1, 1, size).tolist()]
    return [Fraction(int(v)) for v in rng.choice([-1, 1], size)]


def exact_product(M: Matrix, x: Exact) -> Exact:
    """``M x`` without rounding."""
    return [sum((Fraction(a) * v for a, v in zip(row, x, strict=True)), Fraction(0)) for row in M.tolist()]


def measured(C: Matrix, r: Vector, x: Exact, noise: Exact) -> Vector:
    """Outputs as doubles that keep ``|y − C x| ≤ r`` exactly; NaN (missing) where r is too small for any double."""
    y = np.empty(len(r))
    for i, (output, width, unit) in enumerate(zip(exact_product(C, x), r.tolist(), noise, strict=True)):
        y[i] = float(output + Fraction(width) * unit)
        for _ in range(3):
            if abs(Fraction(float(y[i])) - output) > Fraction(width):
                y[i] = np.nextafter(y[i], float(output))
        if abs(Fraction(float(y[i])) - output) > Fraction(width):
            y[i] = np.nan
    return y


def inside_box(lower: Vector, upper: Vector, x: Exact) -> bool:
    """Whether the exact point lies in the box; no tolerance."""
    return all(Fraction(a) <= v <= Fraction(z) for a, v, z in zip(lower.tolist(), x, upper.tolist(), strict=True))
