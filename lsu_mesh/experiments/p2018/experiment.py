"""Pavelková, Jirsa 2018: recursive estimation of the state on a box, beside a window and a zonotopic Kalman filter."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import get_args

from lsu_mesh.experiments.comparison import ours, stated, table
from lsu_mesh.experiments.outcome import SPREAD, Cell, Check, Column, Outcome, Spread, Table, between
from lsu_mesh.experiments.p2018 import noise
from lsu_mesh.experiments.p2018.figures import (
    Timing,
    draw_states,
    draw_times,
    exponent,
    states,
    states_table,
    times_table,
    timings,
)
from lsu_mesh.experiments.p2018.noise import LEVELS, LOW_LEVELS
from lsu_mesh.experiments.p2018.runs import (
    ESTIMATORS,
    KAPPA,
    NEW_STRIP,
    OLD_EDGE,
    START,
    STATISTICS,
    STEPS,
    WINDOW,
    Job,
    Result,
    result,
)
from lsu_mesh.experiments.p2018.statements import statements
from lsu_mesh.experiments.p2018.table_1 import comparison, spread_of, ties
from lsu_mesh.experiments.workers import Watch, part, spread, unwatched
from lsu_mesh.filters.compiled import Ties

RUNS, QUICK_RUNS = 100, 8
NOISE_RUNS, QUICK_NOISE_RUNS = 20, 3
GRIDS = (LEVELS, LOW_LEVELS)
TITLE = (
    "Pavelková, Jirsa (2018): Approximate recursive Bayesian estimation of state space model with uniform noise, ICINCO"
)
PAPER_SECONDS = {"LSU": 0.13, "WIN": 14.41, "ZKF q=15": 0.11, "ZKF q=3": 0.11}
LIMITS = {
    OLD_EDGE: (0.9, 1.5),
    NEW_STRIP: (1.9, 2.5),
    "LSUO, met with the prediction": (0.55, 0.95),
    "ZKF q=15, predictor": (0.55, 1.05),
    "ZKF q=15, filter": (0.35, 0.65),
}
"""Of the sum of squares."""
ERRATA = (
    (
        "(7): brackets are missing, and x̃_{t−1} should be x̃_t. A product of trapezoids is the exact density only for a "
        "diagonal A (the exact support is a zonotope), and 1/|det A| fails for a singular one."
    ),
    "(12), (13): one symbol for the bounds of the parallelotope and for those of its hull.",
    (
        "Table 1 compares LSU's residual *after* the data with one-step predictions of the others, which are not the "
        "same quantity. Here each row follows the paper."
    ),
    "Section 3.2: the hull of the parallelotope can exceed the prediction; LSUO met with the prediction avoids that.",
)


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """Table 1 and Figures 1–3."""
    seeds = range(seed, seed + (QUICK_RUNS if quick else RUNS))
    found = results(seeds, part(watch, 0.0, 0.9))
    runs = QUICK_NOISE_RUNS if quick else NOISE_RUNS
    grids = {(ties, levels): noise.errors(seed, runs, levels, ties) for ties in get_args(Ties) for levels in GRIDS}
    times, shown = timings(seed), states(seed)
    title = f"Table 1, state 2, {len(seeds)} runs × {STEPS} steps; *here* is the spread of single runs"
    said = "What the paper says of Table 1 and Figure 2"
    return Outcome(
        tables=[
            table("p2018-table-1", title, ["estimator", "quantity"], comparison(found)),
            ties(found),
            table("p2018-statements", said, ["about", "quantity"], [*statements(found), *noise.what_matters(grids)]),
            _ours(found, len(seeds)),
            _times(found, times),
            states_table(shown),
            noise.table(grids["old", LEVELS]),
            times_table(times),
        ],
        checks=checks(found),
        figures={
            "p2018-figure-1": partial(draw_states, shown),
            "p2018-figure-2": partial(noise.draw_errors, grids["old", LEVELS]),
            "p2018-figure-3-times": partial(draw_times, times),
        },
        title=TITLE,
        notes=_notes(seeds),
        captions={
            "p2018-figure-1": "Figure 1. Simulated and estimated states with estimated bounds (a part of the run)",
            "p2018-figure-2": "Figure 2. Error of the estimate of state 2 over state noise ρ and output noise r",
            "p2018-figure-3-times": "Figure 3. Processing time of a step against the number of states",
        },
        errata=ERRATA,
    )


def _notes(seeds: range) -> str:
    return (
        f"System (15): ρ = 0.1, r = 0.3, {STEPS} steps, u ~ N(0, 1), seeds {seeds[0]} to {seeds[-1]}. The paper gives "
        f"one run and no prior: here the box ±{START:g} in every state, from which x_1 is drawn. A strip that cuts one "
        "face of the box leaves two parallelotopes of equal volume. The paper does not say which one is kept. *LSUO* "
        "keeps the old edge, which is the default of this library; *LSUO, new strip* takes the strip. The zonotopic "
        "Kalman filter is shown in the predictor form, which is Combastel's, and in the filter form, which uses the "
        f"step's own data. The window estimator has Δ = {WINDOW}, κ = {KAPPA:g} and a vertex of the optimal face; its "
        "intervals are no guaranteed bounds. The paper gives neither Δ nor κ."
    )


def results(seeds: range, watch: Watch = unwatched) -> dict[str, list[Result]]:
    """The runs of every estimator."""
    jobs = [Job(name, seed) for name in ESTIMATORS for seed in seeds]
    found = spread(result, jobs, watch)
    return {name: found[i * len(seeds) : (i + 1) * len(seeds)] for i, name in enumerate(ESTIMATORS)}


def _ours(found: Mapping[str, list[Result]], runs: int) -> Table:
    """What the paper does not have: other forms and filters."""
    names = [name for name, estimator in ESTIMATORS.items() if not estimator.column]
    rows: list[tuple[Cell, ...]] = [
        (name, *(spread_of(found[name], statistic) for statistic in STATISTICS)) for name in names
    ]
    columns = (Column("estimator"), *(Column(f"{statistic}{SPREAD}") for statistic in STATISTICS))
    return Table("p2018-ours", f"The same for estimators that the paper does not have, {runs} runs", columns, rows)


def _times(found: Mapping[str, list[Result]], times: list[Timing]) -> Table:
    """The last row of Table 1, and Figure 3: measured, so different in every run."""
    milliseconds = {name: Spread.of([1e3 * one.seconds for one in runs]) for name, runs in found.items()}
    rows = []
    for name, estimator in ESTIMATORS.items():
        labels = (name, f"execution time of {STEPS} steps, ms")
        if estimator.column:
            paper = f"{1e3 * PAPER_SECONDS[estimator.column]:.0f}"
            faster = milliseconds[name].mean < 1e3 * PAPER_SECONDS[estimator.column]
            rows.append(stated(labels, paper, milliseconds[name], holds=faster, why="slower than the paper's"))
        else:
            rows.append(ours(labels, milliseconds[name]))
    largest = times[-1]
    power = exponent(times)
    rows.append(
        stated(
            ("Figure 3", f"p in time ~ nᵖ, up to n = {largest.states} ({largest.microseconds:.3g} µs a step)"),
            "appropriately low", power, holds=power < 3.0,
        )
    )  # fmt: skip
    title = "Processor times, measured; *reproduced* is not slower than the paper's time"
    return table("p2018-times", title, ["estimator", "quantity"], rows)


def checks(found: Mapping[str, list[Result]]) -> list[Check]:
    """The numbers to reach."""
    made = []
    for name, (low, high) in LIMITS.items():
        made += between(f"p2018: {name}, Σ (x̂₂ − x₂)²", spread_of(found[name], STATISTICS[0]).mean, low, high)
    outside = max(one.statistics[-1] for name, runs in found.items() if ESTIMATORS[name].is_guaranteed for one in runs)
    return [*made, Check("p2018: states outside, any guaranteed estimator, %", outside, 0.0)]
