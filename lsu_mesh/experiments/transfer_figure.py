"""The figure of transfer against the source's noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from lsu_mesh.experiments.transfer_result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES = {"LSUO lp": ("#d1495b", "^"), "LSUP": ("#2f5d50", "v"), "LSUPB": ("#1a1a1a", "o"), "LSUCZ": ("#8fa3d8", "s")}
"""Colour, of another grey each, and mark by filter."""
PANELS: Sequence[tuple[str, Callable[[Result], float]]] = (
    ("width ÷ isolated", lambda result: result.width),
    ("TNSE ÷ isolated", lambda result: result.tnse_ratio),
    ("gain, nats", lambda result: result.gain),
    ("truth inside, %", lambda result: 100.0 * result.inside),
)


def draw_transfer(results: Sequence[Result]) -> Figure:
    """One row of panels per system: solid lines are the state predictor, dashed ones the data predictor."""
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(result.system for result in results))
    figure = Figure(figsize=(11.0, 2.4 * len(names) + 0.6), layout="constrained")
    grid = figure.subplots(len(names), len(PANELS), squeeze=False, sharex=True)
    for row, system in zip(grid, names, strict=True):
        own = [result for result in results if result.system == system]
        for axes, (title, value) in zip(row, PANELS, strict=True):
            _draw_panel(axes, own, value)
            axes.set_title(f"{system}: {title}", fontsize=9)
    for axes in grid[-1]:
        axes.set_xlabel("r_S ÷ r", fontsize=9)
    handles, labels = grid[-1][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), fontsize=8, frameon=False)
    return figure


def _draw_panel(axes: Axes, results: Sequence[Result], value: Callable[[Result], float]) -> None:
    for kind in dict.fromkeys(result.kind for result in results):
        colour, mark = STYLES[kind]
        for way, style in (("predictor", "-"), ("data-predictor", "--")):
            line = [result for result in results if (result.kind, result.way) == (kind, way)]
            axes.semilogx(
                [r.ratio for r in line], [value(r) for r in line], style, color=colour, linewidth=1.4,
                marker=mark, markersize=3.5, label=f"{kind}, {way}",
            )  # fmt: skip
    axes.grid(True, linewidth=0.3)
    axes.tick_params(labelsize=8)
