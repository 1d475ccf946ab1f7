"""Figures 1–3 of Pavelková & Kárný 2014: an estimated parameter, interval estimates, time against the dimension."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lsu_mesh.array_types import Array
from lsu_mesh.experiments.outcome import Cell, Column, Table
from lsu_mesh.experiments.p2014.runs import CORRELATED, KAPPAS, F, Job, estimator, simulate
from lsu_mesh.filters.window.window_map import WindowMAP
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import simulate as simulate_model
from lsu_mesh.supports.orthotope import Orthotope

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WINDOWS = (5, 25)
INTERVAL_WINDOW = 25
"""Δ of Figure 2: the paper does not say which."""
STATE = 2
"""Index of the state of Figure 2."""
STEPS = 300
FIRST, LAST = 100, 300
"""Steps that Figure 1 shows."""
INTERVALS_FIRST, INTERVALS_LAST = 100, 135
"""Steps that Figure 2 shows."""
DIMENSIONS = (2, 4, 6, 8, 10)
TIMED_STEPS = 20
STYLES = {5: (":", "o"), 25: ("--", "*")}
"""Of the paper's figures: the line of Figure 1 and the mark of Figure 3, by Δ."""


class Traces(NamedTuple):
    """One run: F₁₂ by Δ, each (T + 1,); states x_{t,3} (T + 1,); their intervals (T + 1, 3), NaN at the ends."""

    parameter: Mapping[int, Array]
    state: Array
    lower: Array
    upper: Array


def traces(seed: int, steps: int = STEPS) -> Traces:
    """The estimators of Figures 1 and 2 on one record; a state's interval is the one when it is about to leave."""
    X, Y, U = simulate(CORRELATED.correlated, seed, steps)
    parameter = {}
    lower, upper = np.full((2, steps + 1, len(KAPPAS)), np.nan)
    for window in WINDOWS:
        filter = estimator(
            Job(name="", case=CORRELATED, window=window, point="centre", factor=1.0, seed=seed, steps=steps)
        )
        assert isinstance(filter, WindowMAP)
        parameter[window] = np.empty(steps + 1)
        for t in range(steps + 1):
            filter.update(Y[t])
            parameter[window][t] = filter.theta[-1]
            if window == INTERVAL_WINDOW and t > window:
                for i, kappa in enumerate(KAPPAS):
                    low, high = filter.interval_estimates(kappa, met=False)
                    lower[t - window, i], upper[t - window, i] = low[1, STATE], high[1, STATE]
            if t < steps:
                filter.predict(U[t])
    return Traces(parameter, X[:, STATE], lower, upper)


def parameter_table(found: Traces) -> Table:
    """The data of Figure 1."""
    columns = (Column("t"), Column("true"), *(Column(f"window {window}") for window in found.parameter))
    rows: list[tuple[Cell, ...]] = [
        (t, F[0][1], *(float(values[t]) for values in found.parameter.values())) for t in range(FIRST, LAST + 1)
    ]
    return Table("p2014-figure-1-data", "Estimates of F12", columns, rows, is_for_files=True)


def interval_table(found: Traces) -> Table:
    """The data of Figure 2."""
    columns = [Column("t"), Column("x3")]
    for kappa in KAPPAS:
        columns += [Column(f"lower, kappa = {kappa:g}"), Column(f"upper, kappa = {kappa:g}")]
    rows: list[tuple[Cell, ...]] = []
    for t in range(INTERVALS_FIRST, INTERVALS_LAST + 1):
        ends = np.column_stack([found.lower[t], found.upper[t]]).ravel()
        rows.append((t, float(found.state[t]), *map(float, ends)))
    return Table("p2014-figure-2-data", "Interval estimates of x3", tuple(columns), rows, is_for_files=True)


def draw_parameter(found: Traces) -> Figure:
    """Estimates of F₁₂ with two windows, and its true value."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.8, 3.2), layout="constrained")
    axes = figure.subplots()
    steps = np.arange(FIRST, LAST + 1)
    colours = {5: "#808080", 25: "#1f5fa8"}
    for window, values in found.parameter.items():
        style, _ = STYLES[window]
        axes.plot(steps, values[steps], style, color=colours[window], linewidth=1.3, label=f"estimate, Δ = {window}")
    axes.axhline(F[0][1], color="black", linewidth=1.2, label="true value")
    axes.set_xlabel("time t")
    axes.set_ylabel(r"$\hat F_{12}$")
    axes.set_xlim(FIRST, LAST)
    axes.grid(True, linewidth=0.3)
    figure.legend(loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    return figure


def draw_intervals(found: Traces) -> Figure:
    """Interval estimates of x_{t,3} for three κ, and the true values."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.8, 3.6), layout="constrained")
    axes = figure.subplots()
    steps = np.arange(INTERVALS_FIRST, INTERVALS_LAST + 1)
    for i, (kappa, style, colour) in enumerate(
        zip(KAPPAS, ("-", "--", ":"), ("#000000", "#1f5fa8", "#606060"), strict=True)
    ):
        for values, label in ((found.lower, f"κ = {kappa:g}"), (found.upper, "")):
            axes.plot(steps, values[steps, i], style, color=colour, linewidth=1.2, label=label)
    axes.plot(steps, found.state[steps], "o", color="#c0392b", markersize=4, fillstyle="none", label="true value")
    axes.set_xlabel("time t")
    axes.set_ylabel("$x_{t;3}$")
    axes.grid(True, linewidth=0.3)
    figure.legend(loc="outside upper center", ncols=4, frameon=False, fontsize=9)
    return figure


class Timing(NamedTuple):
    """Milliseconds of a step by number of states and window."""

    states: int
    window: int
    milliseconds: float


def timings(seed: int) -> list[Timing]:
    """Window estimators with one output and one input on random stable systems, once their window is full."""
    return [_timing(n, window, seed) for window in WINDOWS for n in DIMENSIONS]


def _timing(n: int, window: int, seed: int) -> Timing:
    source = np.random.default_rng([seed, n])
    orthogonal, _ = np.linalg.qr(source.standard_normal((n, n)))
    model = LSUModel(
        A=0.9 * orthogonal, B=source.standard_normal((n, 1)), C=source.standard_normal((1, n)), rho=0.1, r=0.3
    )
    data = simulate_model(model, window + 2 + TIMED_STEPS, seed)
    filter = WindowMAP(model, Orthotope([-1.0] * n, [1.0] * n), window=window)
    seconds = []
    for k, y in enumerate(data.Y):
        began = time.process_time()
        filter.update(y)
        if k + 1 < len(data.Y):
            filter.predict(data.U[k])
        seconds.append(time.process_time() - began)
    return Timing(n, window, 1e3 * float(np.mean(seconds[window + 2 :])))


def times_table(times: Sequence[Timing]) -> Table:
    """The data of Figure 3."""
    columns = (Column("states"), Column("window"), Column("ms per step"))
    return Table("p2014-figure-3-times-data", "Time of a step", columns, list(times), is_for_files=True)


def draw_times(times: Sequence[Timing]) -> Figure:
    """Time of a step against the number of states for two windows."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 3.6), layout="constrained")
    axes = figure.subplots()
    for window in WINDOWS:
        line = [t for t in times if t.window == window]
        _, mark = STYLES[window]
        axes.plot(
            [t.states for t in line], [t.milliseconds for t in line], color="black", linewidth=0.8, marker=mark,
            markersize=8 if mark == "*" else 5, label=f"Δ = {window}",
        )  # fmt: skip
    axes.set_xlabel("number of states")
    axes.set_ylabel("t$_c$, ms per step")
    axes.set_ylim(bottom=0.0)
    axes.grid(True, linewidth=0.3)
    axes.legend(fontsize=9)
    return figure
