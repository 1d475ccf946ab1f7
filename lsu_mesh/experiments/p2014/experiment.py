"""Pavelková & Kárný 2014: states and parameters of a model with entry-wise correlated uniform noise, on a window."""

from __future__ import annotations

from functools import partial

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.experiments.outcome import Check, Outcome
from lsu_mesh.experiments.p2014.figures import (
    INTERVAL_WINDOW,
    draw_intervals,
    draw_parameter,
    draw_times,
    interval_table,
    parameter_table,
    times_table,
    timings,
    traces,
)
from lsu_mesh.experiments.p2014.runs import CORRELATED, KNOWN, UNCORRELATED, Case, Job, Result, result
from lsu_mesh.experiments.p2014.tables import (
    KALMAN,
    TABLE_I,
    WELL,
    Found,
    confidence,
    errors,
    performance,
    points,
    statements,
    times,
    window,
)
from lsu_mesh.experiments.workers import Watch, spread, unwatched

STEPS, RUNS = 2500, 3
QUICK_STEPS, QUICK_RUNS = 300, 1
OTHER_RUNS = 1
"""Of windows that only Table I has, and of the vertices of Tables II and III, which take the longest."""
TITLE = (
    "Pavelková, Kárný (2014): State and parameter estimation of state-space model with entry-wise correlated uniform "
    "noise, Int. J. Adapt. Control Signal Process."
)
ERRATA = (
    "Appendix A.1: the right sides of the output rows are ±F y (one is printed as −B y).",
    "Appendix A.2: the second row holds 𝒜24 (printed 𝒜14), the sign of 𝒜23 is that of F y on the left side.",
    "Appendix A: rows are ordered 1_{Δ+1} ⊗ [−I 0] ⊗ 1_2, unlike the printed Kronecker products.",
    "(15): the sum over F starts at j = i + 1.",
    "(34): |P| is the determinant of a covariance, no volume; N_KF (36) needs κ², not κ³.",
    "(35): counts x_{τ−Δ}, the state that the interval is of.",
    (
        "Tables II and III: the window's rows are reached with E and F estimated from data with E = F = I, which the "
        "text leaves open; *prediction errors* are in-sample fits (predictions: see *Mean absolute errors* above)."
    ),
    "Table II: the incorrect filter's output errors are five times its state errors, which no reading here has.",
)


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """Tables I–III beside ours, Figures 1–3, and what a centred point changes."""
    steps, runs = (QUICK_STEPS, QUICK_RUNS) if quick else (STEPS, RUNS)
    work = jobs(range(seed, seed + runs), steps)
    found: dict[tuple[str, Case], list[Result]] = {}
    for job, one in zip(work, spread(result, work, watch), strict=True):
        found.setdefault((job.name, job.case), []).append(one)
    lines, measured = traces(seed), timings(seed)
    tables = [performance(found), errors(found), confidence(found), statements(found), points(found), times(found)]
    tables += [parameter_table(lines), interval_table(lines), times_table(measured)]
    return Outcome(
        tables=tables,
        checks=[] if quick else checks(found),
        figures={
            "p2014-figure-1": partial(draw_parameter, lines),
            "p2014-figure-2": partial(draw_intervals, lines),
            "p2014-figure-3-times": partial(draw_times, measured),
        },
        title=TITLE,
        notes=_notes(steps, runs),
        captions={
            "p2014-figure-1": "Figure 1. Point estimates of F₁₂ over time (a part of the run), and its true value",
            "p2014-figure-2": f"Figure 2. Interval estimates (29) of the third state, Δ = {INTERVAL_WINDOW} (a part of "
            "the run), and its true values",
            "p2014-figure-3-times": "Figure 3. Processing time of a step against the number of states, one output, one "
            "input, known matrices",
        },
        errata=ERRATA,
    )


def _notes(steps: int, runs: int) -> str:
    return (
        f"The paper's system, T = {steps}, {runs} run(s) with Δ = 5 and 25, {OTHER_RUNS} with the other windows and "
        "with the vertices of Tables II and III, u ~ U(−1, 1), states clipped at the paper's box, κ = 1 for the state "
        "that leaves the window, E and F unknown "
        "in [−1, 1]. N counts a state when any of its three coordinates is outside (the paper does not say how it "
        "counts); N_KF has κ³, as printed. With three runs a deviation, and so z, is rough.\n\n"
        "A uniform noise of half-width h has the variance h²/3. The *well set* filter has these variances. *Incorrect* "
        "covariances, three times higher, are read literally in two ways: variances × 3 and half-widths × 3. The rows "
        "named *fitted* were found by fitting. Without truncation det P does not depend on data, and it goes with the "
        "cube of the variances. So the paper's two values of V_KF fix two factors: 2 h²/3 for the well set filter and "
        "20 h²/3 for the incorrect one. Its other numbers were not used. They agree for the states and in part for "
        "N_KF, not for the outputs. We do not know that the authors used these variances.\n\n"
        "The optimum of the linear program is a face: *vertex* and *centre* are points of it as a simplex and an "
        "interior-point method find them."
    )


def jobs(seeds: range, steps: int) -> list[Job]:
    """Everything that has to run, the longest first."""
    plans = [(5, CORRELATED), (25, CORRELATED), (5, UNCORRELATED), (25, UNCORRELATED), (25, KNOWN)]
    every = [
        Job(name=window(length, point), case=case, window=length, point=point, factor=1.0, seed=seed, steps=steps)
        for length, case in plans
        for point in ("vertex", "centre")
        for seed in (seeds[:OTHER_RUNS] if (point, case) == ("vertex", UNCORRELATED) else seeds)
    ]
    every += [
        Job(
            name=window(length, "centre"),
            case=CORRELATED,
            window=length,
            point="centre",
            factor=1.0,
            seed=seed,
            steps=steps,
        )
        for length in TABLE_I
        if length not in (5, 25)
        for seed in seeds[:OTHER_RUNS]
    ]
    every += [
        Job(name=name, case=KNOWN, window=0, point="centre", factor=factor, seed=seed, steps=steps)
        for name, factor in KALMAN.items()
        for seed in seeds
    ]
    return sorted(every, key=lambda job: (job.point != "vertex", -job.window))


def checks(found: Found) -> list[Check]:
    """The numbers to reach at full size."""

    def mean(name: str, case: Case, what: str) -> Array:
        return np.asarray(np.mean([getattr(one, what) for one in found[name, case]], axis=0))

    def far(name: str, case: Case, what: str, target: tuple[float, ...], factor: float = 1.0) -> float:
        return float(np.abs(factor * mean(name, case, what) - target).max())

    centre, vertex = (mean(window(25, point), KNOWN, "states") for point in ("centre", "vertex"))
    states = {5: (0.136, 0.094, 0.063), 25: (0.107, 0.088, 0.06)}
    made = []
    for length, volume, room in ((5, 15.5, 3.3), (25, 5.84, 1.0)):
        name = window(length, "vertex")
        measured = far(name, CORRELATED, "volume", (volume,), factor=1e3)
        made.append(Check(f"p2014: V · 1e3 at Δ = {length}, distance from {volume:g}", measured, room))
    for length, target in states.items():
        measured = far(window(length, "vertex"), CORRELATED, "states", target)
        made.append(Check(f"p2014: states, Δ = {length}, from {_listed(target)}", measured, 0.012))
    kalman, known = (0.0694, 0.0511, 0.05), (0.08, 0.065, 0.053)
    return [
        *made,
        Check(f"p2014: truncated Kalman, from {_listed(kalman)}", far(WELL, KNOWN, "states", kalman), 0.004),
        Check("p2014: truncated Kalman, fits, from 0.125 0.134", far(WELL, KNOWN, "fits", (0.125, 0.134)), 0.008),
        Check(f"p2014: centred point, Δ = 25, over {_listed(known)}", float((centre - known).max()), 0.0),
        Check("p2014: error of the centred point ÷ of the vertex, Δ = 25", float(centre.sum() / vertex.sum()), 0.85),
    ]


def _listed(numbers: tuple[float, ...]) -> str:
    return " ".join(f"{number:g}" for number in numbers)
