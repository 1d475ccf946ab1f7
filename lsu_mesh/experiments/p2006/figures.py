"""Estimated half-widths over time, as in Figure 1 of Pavelková & Kárný 2006: off-line and on a sliding window."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lsu_mesh import systems
from lsu_mesh.array_types import Array
from lsu_mesh.experiments.outcome import Cell, Column, Table
from lsu_mesh.filters.window.batch_map import batch_map, record
from lsu_mesh.filters.window.program import HalfWidths
from lsu_mesh.filters.window.structure import Structure
from lsu_mesh.filters.window.window_map import WindowMAP
from lsu_mesh.simulation import simulate
from lsu_mesh.supports.orthotope import Orthotope

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SYSTEMS = ("S2", "S3")
"""Two states and one output, as the paper's system."""
WINDOW = 25
STEPS = 200
PRIOR = Orthotope([-1.0, -1.0], [1.0, 1.0])
STYLES = (("-", "#000000"), ("-", "#7f9fc8"))


class Trace(NamedTuple):
    """Half-widths rho_1, rho_2, r (T, 3) of one system: true (3,), and estimated from the data up to each step."""

    system: str
    true: Array
    offline: Array
    online: Array


def trace(system: str, seed: int, steps: int = STEPS) -> Trace:
    """Off-line: the whole record up to t, from t = 2 on (NaN before). On-line: the window of the last steps."""
    model = systems.get(system)
    data = simulate(model, steps, seed)
    structure = Structure(model)
    widths = HalfWidths.separate(np.zeros(3), np.full(3, np.inf), np.ones(3))
    offline, online = np.full((2, steps, 3), np.nan)
    filter = WindowMAP(model, PRIOR, window=WINDOW)
    for k in range(steps):
        filter.update(data.Y[k])
        online[k] = *filter.rho, *filter.r
        if k:
            whole = batch_map(structure, record(structure, data.Y[: k + 1], data.U[:k]), widths, PRIOR)
            offline[k] = *whole.rho, *whole.r
        if k + 1 < steps:
            filter.predict(data.U[k])
    return Trace(system, np.concatenate([model.rho, model.r]), offline, online)


def data_table(traces: Sequence[Trace]) -> Table:
    """The data of both figures."""
    rows: list[tuple[Cell, ...]] = [
        (one.system, k + 1, *map(float, one.offline[k]), *map(float, one.online[k]))
        for one in traces
        for k in range(len(one.online))
    ]
    titles = [f"{name}, {way}" for way in ("off-line", "on-line") for name in ("rho 1", "rho 2", "r")]
    columns = (Column("system"), Column("t"), *map(Column, titles))
    return Table("p2006-figure-1-data", "Half-widths over time", columns, rows, is_for_files=True)


def draw(traces: Sequence[Trace], is_online: bool) -> Figure:
    """The state noise above, the output noise below, a column per system."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 4.4), layout="constrained")
    grid = figure.subplots(2, len(traces), sharex=True, sharey=True)
    for column, one in zip(grid.T, traces, strict=True):
        values = one.online if is_online else one.offline
        steps = np.arange(1, len(values) + 1)
        for i in range(3):
            style, colour = STYLES[i % 2]
            name = ("ρ₁", "ρ₂", "r")[i]
            column[i // 2].plot(steps, values[:, i], style, color=colour, linewidth=1.3, label=f"{name}, estimated")
        for axes, true, name in zip(column, one.true[1:], ("state noise", "output noise"), strict=True):
            axes.axhline(true, linestyle="--", color="#404040", linewidth=1.0, label="simulated")
            axes.set_ylabel(f"half-width of {name}", fontsize=9)
            axes.set_ylim(bottom=0.0)
            axes.grid(True, linewidth=0.3)
            axes.legend(fontsize=7, loc="upper left", ncols=3)
        column[0].set_title(f"{one.system}, {'on-line, Δ = ' + str(WINDOW) if is_online else 'off-line'}", fontsize=10)
        column[1].set_xlabel("time t")
        column[0].set_ylim(0.0, 0.16)
    return figure
