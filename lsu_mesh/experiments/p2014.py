"""Pavelková & Kárný 2014: states and parameters of a model with entry-wise correlated uniform noise, on a window."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh.experiments.comparison import NOT_REPRODUCED, Row, compared, table
from lsu_mesh.experiments.outcome import Cell, Check, Column, Outcome, Spread, Table
from lsu_mesh.experiments.workers import Watch, spread, unwatched
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.truncated_kalman import TruncatedKalman
from lsu_mesh.filters.window_map import WindowMAP
from lsu_mesh.model import LSUModel

Array = NDArray[np.float64]
A = ((1.0, -0.5, 0.2), (0.5, 0.1, 0.0), (0.3, 0.0, -0.1))
B = ((0.1,), (0.6,), (0.3,))
C = ((1.0, 0.0, 0.5), (0.0, 1.0, 0.5))
E = ((1.0, 0.5, 0.25), (0.0, 1.0, 0.3), (0.0, 0.0, 1.0))
F = ((1.0, 0.4), (0.0, 1.0))
RHO, R = 0.1, 0.3
LOWER, UPPER = (-0.8, -0.61, -0.4), (0.76, 0.66, 0.44)
UNKNOWN = tuple((matrix, i, j, -1.0, 1.0) for matrix, i, j in (("E", 1, 2), ("E", 1, 3), ("E", 2, 3), ("F", 1, 2)))
KAPPAS = (1.0, 1.5, 2.0)
STEPS, RUNS = 2500, 3
QUICK_STEPS, QUICK_RUNS = 300, 1
TITLE = (
    "Pavelková, Kárný (2014): State and parameter estimation of state-space model with entry-wise correlated uniform "
    "noise, Int. J. Adapt. Control Signal Process."
)
TABLE_I = {5: (17.0, 34, 12, 5), 10: (8.0, 46, 16, 7), 25: (5.0, 53, 17, 6)}
"""Of the paper: V · 1e3, and N in % for κ = 1, 1.5, 2, by Δ."""
TABLE_II = {
    "window 5": (0.15, 0.10, 0.06),
    "window 25": (0.09, 0.07, 0.05),
    "truncated Kalman": (0.07, 0.06, 0.05),
    "truncated Kalman, variances × 3": (0.10, 0.11, 0.08),
}
WELL, WRONG = "truncated Kalman", "truncated Kalman, variances × 3"
KALMAN = {WELL: 1.0, WRONG: 3.0}
"""By what the variances of the Kalman filters are multiplied."""
NOT_COUNTED = f"{NOT_REPRODUCED}: here any coordinate outside counts; the paper does not say how it counts"
CONTRADICTORY = f"{NOT_REPRODUCED}: three times the variances cost little; the paper's row contradicts itself"
ERRATA = (
    "Appendix A.1: the right sides of the output rows are ±F y (one is printed as −B y).",
    "Appendix A.2: the second row holds 𝒜24 (printed 𝒜14), the sign of 𝒜23 is that of F y on the left side.",
    "Appendix A: rows are ordered 1_{Δ+1} ⊗ [−I 0] ⊗ 1_2, unlike the printed Kronecker products.",
    "(15): the sum over F starts at j = i + 1.",
    "(34): |P| is the determinant of a covariance, no volume; N_KF (36) needs κ², not κ³.",
    "(35): counts x_{τ−Δ}, the state that the interval is of.",
    "Table II: the prediction errors are in-sample fits; the wrong filter's output errors contradict its state errors.",
)


class Job(NamedTuple):
    """One filter on one simulated record."""

    name: str
    correlated: bool
    window: int
    point: str
    factor: float
    seed: int
    steps: int


class Figures(NamedTuple):
    """Mean absolute errors of states (3,) and fits of outputs (2,); V · 1e3; N (3,) in %, nan without intervals."""

    states: Array
    outputs: Array
    volume: float
    outside: Array


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """Tables I–III beside ours, and what a centred point changes."""
    steps, runs = (QUICK_STEPS, QUICK_RUNS) if quick else (STEPS, RUNS)
    jobs = _jobs(quick, range(seed, seed + runs), steps)
    found: dict[tuple[str, bool], list[Figures]] = {}
    for job, figures in zip(jobs, spread(figures_of, jobs, watch), strict=True):
        found.setdefault((job.name, job.correlated), []).append(figures)
    tables = [_volumes(found), _errors(found), _points(found)]
    notes = (
        f"The paper's system, T = {steps}, {runs} run(s), u ~ U(−1, 1), states clipped at the paper's box, κ = 1 for "
        "the state that leaves the window; E and F unknown in [−1, 1] in the correlated case."
    )
    return Outcome(tables, [] if quick else checks(found), {}, TITLE, notes, errata=ERRATA)


def _jobs(quick: bool, seeds: range, steps: int) -> list[Job]:
    windows = [(window, point) for window in (5, 25) for point in ("vertex", "centre")]
    windows += [] if quick else [(10, "centre")]
    jobs = [
        Job(f"window {window}, {point}", correlated, window, point, 1.0, seed, steps)
        for window, point in windows
        for correlated in (True, False)
        for seed in seeds
    ]
    kalman = [Job(name, False, 0, "", factor, seed, steps) for name, factor in KALMAN.items() for seed in seeds]
    return sorted([*jobs, *kalman], key=lambda job: (-job.window, job.point))  # the longest first


def simulate(correlated: bool, seed: int, steps: int) -> tuple[Array, Array, Array]:
    """States x_0 … x_T (T + 1, 3), outputs (T + 1, 2) without y_0, inputs (T, 1); states are clipped at the box."""
    random = np.random.default_rng(seed)
    X, Y, U = np.zeros((steps + 1, 3)), np.full((steps + 1, 2), np.nan), random.uniform(-1.0, 1.0, (steps, 1))
    left = np.linalg.inv(E if correlated else np.eye(3))
    output = np.linalg.inv(F if correlated else np.eye(2))
    for t in range(1, steps + 1):
        x = left @ (np.array(A) @ X[t - 1] + np.array(B) @ U[t - 1] + random.uniform(-RHO, RHO, 3))
        X[t] = np.clip(x, LOWER, UPPER)
        Y[t] = output @ (np.array(C) @ X[t] + random.uniform(-R, R, 2))
    return X, Y, U


def figures_of(job: Job) -> Figures:
    """Run one filter; the first Δ + 1 steps do not count (26 for the Kalman filters)."""
    X, Y, U = simulate(job.correlated, job.seed, job.steps)
    size = np.sqrt(job.factor)
    model = LSUModel(A, B, C, size * RHO, size * R, domain=(LOWER, UPPER))
    filter = _filter(job, model)
    first = (job.window or 25) + 1
    errors, fits, halves, outside = [], [], [], []
    for t in range(job.steps + 1):
        filter.update(Y[t])
        if t >= first:
            errors.append(np.abs(X[t] - filter.point))
            fits.append(np.abs(Y[t] - np.array(C) @ filter.point))
            if isinstance(filter, WindowMAP):
                lower, upper = filter.interval_estimates(1.0, met=False)
                halves.append(0.5 * (upper[1] - lower[1]))
                outside.append([_is_outside(lower[1], upper[1], kappa, X[t - job.window]) for kappa in KAPPAS])
        if t < job.steps:
            filter.predict(U[t])
    volume = 8e3 * float(np.mean(np.prod(halves, axis=1))) if halves else np.nan
    N = 100.0 * np.mean(outside, axis=0) if outside else np.full(3, np.nan)
    return Figures(np.mean(errors, axis=0), np.mean(fits, axis=0), volume, N)


def _filter(job: Job, model: LSUModel) -> Filter:
    box = (LOWER, UPPER)
    if not job.window:
        return TruncatedKalman(model, box)
    return WindowMAP(
        model, box, window=job.window, unknown=UNKNOWN if job.correlated else (), point=job.point, handover=1.0
    )


def _is_outside(lower: Array, upper: Array, kappa: float, x: Array) -> bool:
    middle, half = 0.5 * (lower + upper), 0.5 * kappa * (upper - lower)
    return bool((np.abs(x - middle) > half).any())


Found = dict[tuple[str, bool], list[Figures]]


def _volumes(found: Found) -> Table:
    rows: list[Row] = []
    for window, (volume, *outside) in TABLE_I.items():
        for point in ("vertex", "centre"):
            figures = found.get((f"window {window}, {point}", True))
            if figures is None:
                continue
            labels = (str(window), point)
            rows.append(compared((*labels, "V · 1e3"), volume, Spread.of([f.volume for f in figures]), trend=True))
            for i, kappa in enumerate(KAPPAS):
                here = Spread.of([f.outside[i] for f in figures])
                rows.append(Row((*labels, f"N, κ = {kappa:g}, %"), outside[i], here, NOT_COUNTED))
    return table("p2014-table-1", "Table I, correlated noise with unknown E and F", ["Δ", "point", "figure"], rows)


def _errors(found: Found) -> Table:
    rows = []
    for name, paper in TABLE_II.items():
        for (key, correlated), figures in found.items():
            if key.split(", c")[0].split(", vertex")[0] != name:
                continue
            rows += [_error(key, correlated, i, paper[i], figures) for i in range(3)]
    return table("p2014-table-2", "Table II: mean absolute errors of the states", ["estimator", "noise", "state"], rows)


def _error(name: str, correlated: bool, state: int, paper: float, figures: list[Figures]) -> Row:
    here = Spread.of([f.states[state] for f in figures])
    labels = (name, "correlated" if correlated else "E = F = I", f"x{state + 1}")
    return Row(labels, paper, here, CONTRADICTORY) if name == WRONG else compared(labels, paper, here, trend=True)


def _points(found: Found) -> Table:
    """Centred point, vertex and truncated Kalman filter side by side, E = F = I."""
    rows: list[tuple[Cell, ...]] = []
    for (name, correlated), figures in sorted(found.items()):
        if not correlated:
            states = [Spread.of([f.states[i] for f in figures]) for i in range(3)]
            outputs = [Spread.of([f.outputs[i] for f in figures]) for i in range(2)]
            rows.append((name, *states, *outputs))
    columns = (Column("estimator"), *(Column(f"{x} (mean ± sd)", ".3g") for x in ("x1", "x2", "x3", "y1", "y2")))
    title = (
        "Centred point, vertex and truncated Kalman filter, E = F = I: mean absolute errors of states, fits of outputs"
    )
    return Table("p2014-points", title, columns, rows)


def checks(found: Found) -> list[Check]:
    """The numbers to reach at full size."""

    def mean(name: str, correlated: bool, what: str) -> Array:
        return np.asarray(np.mean([getattr(f, what) for f in found[name, correlated]], axis=0))

    def far(name: str, correlated: bool, what: str, target: tuple[float, ...]) -> float:
        return float(np.abs(mean(name, correlated, what) - target).max())

    centre, vertex = (mean(f"window 25, {point}", False, "states") for point in ("centre", "vertex"))
    five, twenty_five = "window 5, vertex", "window 25, vertex"
    return [
        Check("p2014: V · 1e3 at Δ = 5, distance from 15.5", far(five, True, "volume", (15.5,)), 3.3),
        Check("p2014: V · 1e3 at Δ = 25, distance from 5.84", far(twenty_five, True, "volume", (5.84,)), 1.0),
        Check("p2014: states, Δ = 5, from .136 .094 .063", far(five, True, "states", (0.136, 0.094, 0.063)), 0.012),
        Check(
            "p2014: states, Δ = 25, from .107 .088 .060", far(twenty_five, True, "states", (0.107, 0.088, 0.06)), 0.012
        ),
        Check(
            "p2014: truncated Kalman, from .0694 .0511 .0500", far(WELL, False, "states", (0.0694, 0.0511, 0.05)), 0.004
        ),
        Check("p2014: truncated Kalman, fits, from .125 .134", far(WELL, False, "outputs", (0.125, 0.134)), 0.008),
        Check("p2014: centred point, Δ = 25, over .080 .065 .053", float((centre - (0.08, 0.065, 0.053)).max()), 0.0),
        Check("p2014: error of the centred point ÷ of the vertex, Δ = 25", float(centre.sum() / vertex.sum()), 0.85),
    ]
