"""The 26 figures of Lainová et al. 2019: pairs of surfaces over the noises rho and r."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lsu_mesh.experiments.l2019.surfaces import MEANING, Surfaces

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAIRS = (
    ("T1", "T2"), ("T3", "T4"), ("V1", "V2"), ("L1", "L2"), ("P1", "P2"), ("P3", "P4"), ("P5", "P6"), ("P7", "P8"),
    ("P9", "P10"),
)  # fmt: skip
WITHOUT = {"S2": ("P3", "P4")}
"""The report has no figure of it, because all is 0."""


class Plan(NamedTuple):
    """A figure of the report."""

    number: int
    system: str
    pair: tuple[str, str]

    @property
    def stem(self) -> str:
        """Name of its file."""
        return f"l2019-figure-{self.number:02d}"

    @property
    def caption(self) -> str:
        """What it shows."""
        return f"Figure {self.number}. {self.system}: " + "; ".join(f"{name}, {MEANING[name]}" for name in self.pair)


def plans() -> Iterator[Plan]:
    """All figures in the report's order."""
    number = 0
    for system in ("S1", "S2", "S3"):
        for pair in PAIRS:
            if pair != WITHOUT.get(system):
                number += 1
                yield Plan(number, system, pair)


def figures(surfaces: Surfaces) -> tuple[dict[str, Callable[[], Figure]], dict[str, str]]:
    """What draws each figure, and its caption, by stem."""
    every = list(plans())
    return {plan.stem: partial(draw, surfaces, plan) for plan in every}, {plan.stem: plan.caption for plan in every}


def draw(surfaces: Surfaces, plan: Plan) -> Figure:
    """Two surfaces side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 3.5))
    rho, r = np.meshgrid(surfaces.rho, surfaces.r, indexing="ij")
    for i, name in enumerate(plan.pair):
        axes = figure.add_subplot(1, 2, i + 1, projection="3d")
        values = surfaces.of(plan.system, name)
        axes.plot_surface(rho, r, values, cmap="viridis", edgecolor="#404040", linewidth=0.3, antialiased=True)
        if name.startswith("P"):
            axes.set_zlim(*_percent_limits(float(values.min()), float(values.max())))
        axes.set_xlabel("ρ", fontsize=9)
        axes.set_ylabel("r", fontsize=9)
        axes.set_title(f"{plan.system}: {name}\n{MEANING[name]}", fontsize=9)
        axes.tick_params(labelsize=7, pad=0)
        axes.view_init(elev=25, azim=-130)
    figure.subplots_adjust(left=0.02, right=0.94, bottom=0.06, top=0.86, wspace=0.12)
    return figure


def _percent_limits(low: float, high: float) -> tuple[float, float]:
    """Of an axis of shares: at least one point, so that what hardly varies looks so, and nothing above 100."""
    if high - low >= 1.0:
        return low, high
    return (min(np.floor(low), 99.0), 100.0) if high > 50.0 else (0.0, max(1.0, np.ceil(high)))
