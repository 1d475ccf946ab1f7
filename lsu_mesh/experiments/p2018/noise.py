"""Figure 2 of Pavelková & Jirsa 2018: the error of one state over the noises rho and r."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lsu_mesh import systems
from lsu_mesh.experiments.centre import CENTRE
from lsu_mesh.experiments.comparison import Row, ours, stated
from lsu_mesh.experiments.effect import Effect
from lsu_mesh.experiments.monte_carlo import draw, simulate_all
from lsu_mesh.experiments.outcome import Column, Table
from lsu_mesh.experiments.p2018.runs import START, STATE, STEPS, prior
from lsu_mesh.filters.bank import FilterBank
from lsu_mesh.filters.compiled import Ties
from lsu_mesh.filters.lsuo import LSUO

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEVELS = tuple(float(level) for level in np.round(np.linspace(0.05, 0.5, 10), 2))
LOW_LEVELS = tuple(float(level) for level in np.round(np.linspace(0.01, 0.1, 10), 2))
"""Another grid: the paper does not say which its figure has."""

RULES: Mapping[Ties, str] = {"old": "old edge", "new": "new strip"}


class Errors(NamedTuple):
    """Root of the mean squared error of state 2, (rho levels, r levels)."""

    values: NDArray[np.float64]


def errors(seed: int, runs: int, levels: Sequence[float] = LEVELS, ties: Ties = "old") -> Errors:
    """LSUO of the paper on P3, over all cells and runs in one bank."""
    models = [systems.get("P3", rho=rho, r=r) for rho in levels for r in levels]
    data = simulate_all(models, draw(models[0], STEPS, seed, runs), START)
    every = [model for model in models for _ in range(runs)]
    record, _ = FilterBank(LSUO, every, [prior(models[0])] * len(every), meet=False, ties=ties, **CENTRE).run(
        data.Y, data.U
    )
    squares = np.square(record.points[:, :, STATE] - data.X[:, :, STATE]).reshape(len(models), -1).mean(axis=1)
    return Errors(np.sqrt(squares).reshape(len(levels), len(levels)))


def table(found: Errors) -> Table:
    """The data of the figure."""
    rows = [(rho, r, float(found.values[i, j])) for i, rho in enumerate(LEVELS) for j, r in enumerate(LEVELS)]
    columns = (Column("rho"), Column("r"), Column("RMSE of x2"))
    return Table("p2018-figure-2-data", "Error of state 2 over the noises", columns, rows, is_for_files=True)


def what_matters(grids: Mapping[tuple[Ties, tuple[float, ...]], Errors]) -> Iterator[Row]:
    """Whether r matters more than rho, on each grid, with each rule for ties, by factors and by differences."""
    for_r: dict[Ties, list[bool]] = {}
    for (ties, _), found in grids.items():
        ratio, difference = Effect.of(found.values), Effect.difference(found.values)
        for_r.setdefault(ties, []).extend([ratio.r > ratio.rho, difference.r > difference.rho])
    told = ", ".join(f"in {sum(one)} of {len(one)} readings with the {RULES[ties]}" for ties, one in for_r.items())
    every = [one for readings in for_r.values() for one in readings]
    yield stated(
        ("Figure 2", "RMSE of x₂ over the noises"), "r matters more than ρ", told,
        holds=every[0] if len(set(every)) == 1 else None,
        why="it depends on what the paper leaves open; the next rows are the readings",
    )  # fmt: skip
    for (ties, levels), found in grids.items():
        ratio, difference = Effect.of(found.values), Effect.difference(found.values)
        yield ours(
            (f"Figure 2, {levels[0]:g} to {levels[-1]:g}, {RULES[ties]}", "RMSE of x₂ over the noises"),
            f"{ratio}; + {difference.rho:.3g} by ρ, + {difference.r:.3g} by r",
        )


def draw_errors(found: Errors) -> Figure:
    """The surface."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.6, 4.2))
    axes = figure.add_subplot(projection="3d")
    rho, r = np.meshgrid(LEVELS, LEVELS, indexing="ij")
    axes.plot_surface(rho, r, found.values, cmap="viridis", edgecolor="#404040", linewidth=0.3)
    axes.set_xlabel("ρ")
    axes.set_ylabel("r")
    axes.set_title("RMSE of the estimate of $x_{t,2}$, LSUO", fontsize=10)
    axes.view_init(elev=25, azim=-130)
    figure.subplots_adjust(left=0.0, right=0.94, bottom=0.05, top=0.92)
    return figure
