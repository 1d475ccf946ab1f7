"""Figures 1 and 3 of Pavelková & Jirsa 2018: states with their bounds, and the time of a step against the dimension."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.experiments.centre import CENTRE
from lsu_mesh.experiments.outcome import Cell, Column, Table
from lsu_mesh.experiments.p2018.runs import data_of, prior
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.run import run_filter
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import simulate
from lsu_mesh.supports.orthotope import Orthotope

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIRST, LAST = 40, 70
"""Steps that Figure 1 shows."""
DIMENSIONS = (2, 3, 5, 8, 12, 20, 30)
TIMED_STEPS = 200
ROUNDS = 5


class States(NamedTuple):
    """What Figure 1 shows, each (steps, 3): simulated and estimated states of P3, and the orthotopic bounds (13)."""

    simulated: Array
    estimated: Array
    lower: Array
    upper: Array


def states(seed: int) -> States:
    """A part of one run."""
    model, data = data_of(seed, LAST)
    record = run_filter(LSUO(model, prior(model), meet=False, **CENTRE), data.Y, data.U)
    shown = slice(FIRST - 1, LAST)
    return States(*(values[shown] for values in (data.X, record.points, record.lower, record.upper)))


def states_table(found: States) -> Table:
    """The data of Figure 1."""
    columns = [Column("t"), *(Column(f"{name} x{i}") for i in (1, 2, 3) for name in States._fields)]
    rows: list[tuple[Cell, ...]] = [
        (FIRST + k, *(float(values[k, i]) for i in range(3) for values in found)) for k in range(LAST - FIRST + 1)
    ]
    return Table("p2018-figure-1-data", "States and bounds", tuple(columns), rows, is_for_files=True)


def draw_states(found: States) -> Figure:
    """Simulated and estimated states with their bounds."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 6.0), layout="constrained")
    steps = np.arange(FIRST, LAST + 1)
    for i, axes in enumerate(figure.subplots(3, 1, sharex=True)):
        axes.plot(steps, found.simulated[:, i], "-.", color="#808080", label="simulated")
        axes.plot(steps, found.estimated[:, i], "-", color="black", label="estimated")
        for bound, label in ((found.lower, "bounds"), (found.upper, "")):
            axes.plot(steps, bound[:, i], ":", color="#1f5fa8", linewidth=1.2, label=label)
        axes.set_ylabel(f"$x_{{t,{i + 1}}}$")
        axes.grid(True, linewidth=0.3)
    axes.set_xlabel("step t")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, frameon=False)
    return figure


class Timing(NamedTuple):
    """Microseconds of one step for a number of states."""

    states: int
    microseconds: float


def timings(seed: int) -> list[Timing]:
    """LSUO on random stable systems with two outputs: the fastest of several rounds of a compiled run."""
    return [_timing(n, seed) for n in DIMENSIONS]


def _timing(n: int, seed: int) -> Timing:
    source = np.random.default_rng([seed, n])
    orthogonal, _ = np.linalg.qr(source.standard_normal((n, n)))
    model = LSUModel(
        A=0.9 / np.sqrt(n) * orthogonal, B=np.ones((n, 1)), C=source.standard_normal((2, n)), rho=0.1, r=0.3
    )
    data = simulate(model, TIMED_STEPS, seed)
    best = np.inf
    for _ in range(ROUNDS):
        engine = LSUO(model, Orthotope([-1.0] * n, [1.0] * n), meet=False)
        began = time.perf_counter()
        run_filter(engine, data.Y, data.U)
        best = min(best, time.perf_counter() - began)
    return Timing(n, 1e6 * best / TIMED_STEPS)


def exponent(times: Sequence[Timing]) -> float:
    """p of the fit ``time ~ nᵖ`` to the upper half of the dimensions."""
    upper = times[len(times) // 2 :]
    slope, _ = np.polyfit(np.log([t.states for t in upper]), np.log([t.microseconds for t in upper]), 1)
    return float(slope)


def times_table(times: Sequence[Timing]) -> Table:
    """The data of Figure 3."""
    columns = (Column("states"), Column("µs per step"))
    return Table("p2018-figure-3-times-data", "Time of a step", columns, list(times), is_for_files=True)


def draw_times(times: Sequence[Timing]) -> Figure:
    """Time of a step against the number of states."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.plot([t.states for t in times], [t.microseconds for t in times], "o-", color="black", markersize=4)
    axes.set_xlabel("number of states")
    axes.set_ylabel("µs per step")
    axes.set_ylim(bottom=0.0)
    axes.grid(True, linewidth=0.3)
    axes.set_title("LSUO, two outputs, one core", fontsize=10)
    return figure
