"""Figures 1–3 of Kuklišová Pavelková 2023: errors of four filters over the observation noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLES = {
    "LSUCZ-1": ("o-", "#1f5fa8"),
    "LSUCZ-2": ("s--", "#6aa84f"),
    "LSUO": ("^-.", "#c0392b"),
    "LSUP": ("d:", "#000000"),
}


def draw_errors(levels: Sequence[float], curves: Mapping[str, Sequence[float]], label: str) -> Figure:
    """On the left the paper's linear axis, on the right a logarithmic one that shows the low noises too."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 3.6), layout="constrained")
    for i, axes in enumerate(figure.subplots(1, 2)):
        for name, values in curves.items():
            style, colour = STYLES[name]
            axes.plot(levels, values, style, color=colour, linewidth=1.4, markersize=4, label=name)
        axes.set_xlabel("K, where ν = 10$^{-K}$")
        axes.set_ylabel(f"{label} of state estimates")
        axes.grid(True, linewidth=0.3)
        if i:
            axes.set_yscale("log")
    axes.legend(fontsize=9)
    return figure
