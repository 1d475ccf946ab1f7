"""Pavelková & Kárný 2006: the linear uniform state-space model, off-line and on a sliding window."""

from __future__ import annotations

from functools import partial

import numpy as np

from lsu_mesh import systems
from lsu_mesh.array_types import Array
from lsu_mesh.experiments.comparison import stated, table
from lsu_mesh.experiments.outcome import Cell, Check, Column, Outcome, Spread, Table
from lsu_mesh.experiments.p2006.figures import PRIOR, SYSTEMS, data_table, draw, trace
from lsu_mesh.experiments.p2006.figures import WINDOW as DRAWN
from lsu_mesh.experiments.workers import Watch, unwatched
from lsu_mesh.filters.window.batch_map import batch_map, record
from lsu_mesh.filters.window.program import HalfWidths
from lsu_mesh.filters.window.structure import Structure
from lsu_mesh.filters.window.window_map import WindowMAP
from lsu_mesh.simulation import simulate

STEPS, RUNS = 200, 20
QUICK_STEPS, QUICK_RUNS = 100, 3
WINDOWS = (10, 25, 50)
TITLE = "Pavelková, Kárný (2006): Estimation of state-space model with uniform innovations by linear programming"


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """Estimated half-widths beside the true ones; the off-line program beside its sliding window."""
    steps, runs = (QUICK_STEPS, QUICK_RUNS) if quick else (STEPS, RUNS)
    model = systems.get("S3")
    true = np.concatenate([model.rho, model.r])
    structure = Structure(model)
    widths = HalfWidths.separate(np.zeros(3), np.full(3, np.inf), np.ones(3))
    whole: list[Array] = []
    gaps: list[float] = []
    sliding: dict[int, list[Array]] = {window: [] for window in WINDOWS}
    for i in range(runs):
        data = simulate(model, steps, seed + i)
        centre = batch_map(structure, record(structure, data.Y, data.U), widths, PRIOR)
        vertex = batch_map(structure, record(structure, data.Y, data.U), widths, PRIOR, point="vertex")
        whole.append(np.concatenate([centre.rho, centre.r]))
        gaps.append(abs(centre.objective - vertex.objective))
        for window in WINDOWS:
            sliding[window].append(_mean_widths(WindowMAP(model, PRIOR, window=window), data.Y, data.U))
        watch((i + 1) / runs)
    sums = {window: np.sum(sliding[window], axis=1) for window in WINDOWS}
    offline = np.sum(whole, axis=1).mean()
    rows = [
        stated(
            ("a longer window", "Σ of half-widths"), "grows towards the off-line value",
            " < ".join(f"{value:.3f}" for value in (*(sums[window].mean() for window in WINDOWS), offline)),
            holds=bool(sums[10].mean() < sums[25].mean() < sums[50].mean() < offline),
        ),
        stated(
            ("off-line", "Σ of half-widths"), "at most the true one", Spread.of(np.sum(whole, axis=1)),
            holds=bool((np.sum(whole, axis=1) <= true.sum() + 1e-9).all()),
        ),
        stated(
            ("Figure 1", "half-ranges over time"), "a figure", "other systems",
            holds=None,
            why="the paper gives no matrices; the figures below show S2 and S3, also with two states and one output",
        ),
    ]  # fmt: skip
    traces = [trace(system, seed, steps) for system in SYSTEMS]
    tables = [
        _table(true, whole, sliding),
        table("p2006-statements", "What the paper says, on S3", ["what", "quantity"], rows),
        data_table(traces),
    ]
    checks = [
        Check("p2006: objective of both solvers, largest difference", max(gaps), 1e-7),
        Check(
            "p2006: Σ estimated ÷ Σ true half-widths, off-line, largest", max(np.sum(whole, axis=1)) / true.sum(), 1.0
        ),
    ]
    notes = (
        f"System S3 (two states, one output) instead of the paper's, whose matrices are not given; {runs} run(s) × "
        f"{steps} steps, u ~ N(0, 1), seed {seed}. The estimates are the *smallest* half-widths that explain the data: "
        "never above the truth in sum, and below it the more, the less data there are. A half-width without which the "
        "data can be explained at no higher cost is 0 at the optimum, as mostly that of the first state here."
    )
    captions = {
        "p2006-figure-1-offline": "Figure 1, off-line: half-ranges estimated from all data up to t, and the simulated "
        "ones, on two systems of L2019 with ρ = r = 0.1",
        "p2006-figure-1-online": f"Figure 1, on-line: half-ranges estimated on a sliding window, Δ = {DRAWN}, the same "
        "data",
    }
    figures = {
        "p2006-figure-1-offline": partial(draw, traces, is_online=False),
        "p2006-figure-1-online": partial(draw, traces, is_online=True),
    }
    return Outcome(tables=tables, checks=checks, figures=figures, title=TITLE, notes=notes, captions=captions)


def _mean_widths(filter: WindowMAP, Y: Array, U: Array) -> Array:
    """Mean of the estimated half-widths (q + m,) over the second half of the record."""
    widths = []
    for k in range(len(Y)):
        filter.update(Y[k])
        widths.append(np.concatenate([filter.rho, filter.r]))
        if k + 1 < len(Y):
            filter.predict(U[k])
    return np.asarray(np.mean(widths[len(Y) // 2 :], axis=0))


def _table(true: Array, whole: list[Array], sliding: dict[int, list[Array]]) -> Table:
    columns = (
        Column("half-width"), Column("true"), Column("off-line (mean ± sd)", ".3f"),
        *(Column(f"window {window} (mean ± sd)", ".3f") for window in WINDOWS),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = [
        (
            name, float(true[i]), Spread.of([w[i] for w in whole]),
            *(Spread.of([w[i] for w in sliding[window]]) for window in WINDOWS),
        )
        for i, name in enumerate(("rho 1", "rho 2", "r"))
    ]  # fmt: skip
    return Table("p2006-half-widths", "Half-widths by maximum a posteriori estimation on S3", columns, rows)
