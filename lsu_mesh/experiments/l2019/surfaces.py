"""The criteria of Lainová et al. 2019 over the whole grid of noises, as surfaces: mean and deviation over runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.experiments.l2019.criteria import OF_A_FILTER, OF_THE_PAIR, PerRun
from lsu_mesh.experiments.outcome import Cell, Column, Spread, Table

Key = tuple[str, str, str]
"""System, filter ("" for what belongs to the pair), criterion."""

PAPER_NAMES: Mapping[str, tuple[str, str]] = {
    "T1": ("LSUO", "T states"),
    "T2": ("LSUP", "T states"),
    "T3": ("LSUO", "T outputs"),
    "T4": ("LSUP", "T outputs"),
    "V1": ("LSUO", "V"),
    "V2": ("LSUP", "V"),
    "L1": ("LSUO", "L"),
    "L2": ("LSUP", "L"),
    "P1": ("LSUO", "P states outside"),
    "P2": ("LSUP", "P states outside"),
    "P3": ("LSUO", "P outputs outside"),
    "P4": ("LSUP", "P outputs outside"),
    **{name: ("", name) for name in (*OF_THE_PAIR[:4], "P9", OF_THE_PAIR[4])},
}
"""The report's names of the criteria, in its order."""
MEANING: Mapping[str, str] = {
    "T1": "TNSE of states, LSUO",
    "T2": "TNSE of states, LSUP",
    "T3": "TNSE of predicted outputs, LSUO",
    "T4": "TNSE of predicted outputs, LSUP",
    "V1": "volume of the state's support, LSUO",
    "V2": "volume of the state's support, LSUP",
    "L1": "length of the predicted output's interval, LSUO",
    "L2": "length of the predicted output's interval, LSUP",
    "P1": "states outside, LSUO, %",
    "P2": "states outside, LSUP, %",
    "P3": "outputs outside, LSUO, %",
    "P4": "outputs outside, LSUP, %",
    "P5": "V2 < V1, % of steps",
    "P6": "L2 < L1, % of steps",
    "P7": "support of LSUP in that of LSUO, % of steps",
    "P8": "output interval of LSUP in that of LSUO, % of steps",
    "P9": "volume of LSUP's support in LSUO's, %",
    "P10": "length of LSUP's output interval in LSUO's, %",
}


@dataclass
class Surfaces:
    """Means and deviations over runs, each (rho levels, r levels), by system, filter and criterion."""

    rho: Sequence[float]
    r: Sequence[float]
    mean: dict[Key, Matrix] = field(default_factory=dict)
    sd: dict[Key, Matrix] = field(default_factory=dict)

    def add(self, system: str, rows: Sequence[Mapping[tuple[str, str], PerRun]]) -> None:
        """Take what was found, one mapping per rho with arrays (r levels, runs)."""
        for name, criterion in rows[0]:
            stack = np.array([row[name, criterion] for row in rows])
            self.mean[system, name, criterion] = stack.mean(axis=2)
            alone = np.full(stack.shape[:2], np.nan)
            self.sd[system, name, criterion] = stack.std(axis=2, ddof=1) if stack.shape[2] > 1 else alone

    def of(self, system: str, paper_name: str) -> Matrix:
        """The surface (rho levels, r levels) of the report's criterion."""
        return self.mean[(system, *PAPER_NAMES[paper_name])]

    def over_cells(self, key: Key) -> Spread:
        """Mean and deviation over the cells of the grid."""
        return Spread.of(self.mean[key])

    def systems(self) -> list[str]:
        """In the order in which they came."""
        return list(dict.fromkeys(key[0] for key in self.mean))

    def filters(self, system: str) -> list[str]:
        """The filters of a system, in order."""
        return list(dict.fromkeys(key[1] for key in self.mean if key[0] == system and key[1]))


def every_cell(surfaces: Surfaces) -> Table:
    """All criteria of all cells: the data of the figures."""
    names = [name for name in PAPER_NAMES if (surfaces.systems()[0], *PAPER_NAMES[name]) in surfaces.mean]
    rows: list[tuple[Cell, ...]] = []
    for system in surfaces.systems():
        for i, rho in enumerate(surfaces.rho):
            for j, r in enumerate(surfaces.r):
                keys = [(system, *PAPER_NAMES[name]) for name in names]
                cells = [Spread(float(surfaces.mean[key][i, j]), float(surfaces.sd[key][i, j])) for key in keys]
                rows.append((system, rho, r, *cells))
    columns = (Column("system"), Column("rho"), Column("r"), *(Column(f"{name} (mean ± sd)") for name in names))
    return Table("l2019-surfaces", "Every criterion in every cell", columns, rows, is_for_files=True)


def ranges(surfaces: Surfaces) -> Table:
    """Each criterion of the report: mean over the grid, smallest and largest cell."""
    rows: list[tuple[Cell, ...]] = []
    for name, meaning in MEANING.items():
        cells: list[Cell] = []
        for system in surfaces.systems():
            values = surfaces.of(system, name)
            cells += [float(values.min()), float(values.mean()), float(values.max())]
        rows.append((name, meaning, *cells))
    titles = [f"{system} {which}" for system in surfaces.systems() for which in ("min", "mean", "max")]
    columns = (Column("criterion"), Column("meaning"), *map(Column, titles))
    return Table(
        "l2019-criteria", "The report's criteria over the grid: smallest cell, mean, largest cell", columns, rows
    )


def filters(surfaces: Surfaces, name: str, title: str) -> Table:
    """All filters side by side, as ratios to the report's LSUO: geometric means over the grid."""
    rows: list[tuple[Cell, ...]] = []
    for system in surfaces.systems():
        for kind in surfaces.filters(system):
            ratios = [
                float(np.exp(np.log(surfaces.mean[system, kind, c] / surfaces.mean[system, "LSUO", c]).mean()))
                for c in OF_A_FILTER[:4]
            ]
            outside = [float(surfaces.mean[system, kind, c].max()) for c in OF_A_FILTER[4:]]
            rows.append((system, kind, *ratios, *outside))
    titles = ("system", "filter", "T states", "T outputs", "V", "L", "states outside, %", "outputs outside, %")
    return Table(name, title, tuple(map(Column, titles)), rows)
