"""Pavelková & Kárný 2006: the linear uniform state-space model, off-line and on a sliding window."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lsu_mesh import systems
from lsu_mesh.experiments.comparison import stated, table
from lsu_mesh.experiments.outcome import Cell, Check, Column, Outcome, Spread, Table
from lsu_mesh.experiments.workers import Watch, unwatched
from lsu_mesh.filters.batch_map import batch_map, record
from lsu_mesh.filters.window_map import WindowMAP
from lsu_mesh.filters.window_program import HalfWidths
from lsu_mesh.filters.window_structure import Structure
from lsu_mesh.simulation import simulate
from lsu_mesh.supports.orthotope import Orthotope

Array = NDArray[np.float64]
STEPS, RUNS = 200, 20
QUICK_STEPS, QUICK_RUNS = 100, 3
WINDOWS = (10, 25, 50)
TITLE = "Pavelková, Kárný (2006): Estimation of state-space model with uniform innovations by linear programming"


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """Estimated half-widths beside the true ones; the off-line program beside its sliding window."""
    steps, runs = (QUICK_STEPS, QUICK_RUNS) if quick else (STEPS, RUNS)
    model = systems.get("S3")
    true = np.concatenate([model.rho, model.r])
    prior = Orthotope([-1.0, -1.0], [1.0, 1.0])
    structure = Structure(model)
    widths = HalfWidths.separate(np.zeros(3), np.full(3, np.inf), np.ones(3))
    whole: list[Array] = []
    gaps: list[float] = []
    sliding: dict[int, list[Array]] = {window: [] for window in WINDOWS}
    for i in range(runs):
        data = simulate(model, steps, seed + i)
        centre = batch_map(structure, record(structure, data.Y, data.U), widths, prior)
        vertex = batch_map(structure, record(structure, data.Y, data.U), widths, prior, point="vertex")
        whole.append(np.concatenate([centre.rho, centre.r]))
        gaps.append(abs(centre.objective - vertex.objective))
        for window in WINDOWS:
            sliding[window].append(_mean_widths(WindowMAP(model, prior, window=window), data.Y, data.U))
        watch((i + 1) / runs)
    sums = {window: np.sum(sliding[window], axis=1) for window in WINDOWS}
    rows = [
        stated(
            ("a longer window", "Σ of half-widths"), "grows towards the off-line value",
            " < ".join(f"{sums[window].mean():.3f}" for window in WINDOWS),
            holds=bool(sums[10].mean() < sums[25].mean() < sums[50].mean() < np.sum(whole, axis=1).mean()),
        ),
        stated(
            ("off-line", "Σ of half-widths"), "at most the true one", Spread.of(np.sum(whole, axis=1)),
            holds=bool((np.sum(whole, axis=1) <= true.sum() + 1e-9).all()),
        ),
        stated(
            ("Fig. 1", "half-ranges over time"), "a figure", "no",
            holds=False, why="the paper gives no matrices; S3, also with two states and one output, stands in",
        ),
    ]  # fmt: skip
    tables = [
        _table(true, whole, sliding),
        table("p2006-statements", "What the paper says, on S3", ["what", "figure"], rows),
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
        "never above the truth in sum, and below it the more, the less data there are."
    )
    return Outcome(tables, checks, {}, TITLE, notes)


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
