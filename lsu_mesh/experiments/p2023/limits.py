"""Whether other limits of complexity, or another prior, give the paper's numbers: neither is in the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.experiments.centre import CENTRE
from lsu_mesh.experiments.outcome import Cell, Column, Table
from lsu_mesh.experiments.p2023.runs import SETTLED, Job, simulated
from lsu_mesh.filters.lsucz import LSUCZ

LIMITS = ((3, 0), (4, 1), (5, 1), (6, 2), (8, 2), (12, 4), (20, 8), (40, 16))
"""Generators and constraints, from the fewest that three states can have."""
PRIORS = (0.05, 0.1, 0.2, 0.4, 0.8)
MAX_K = 0.0
"""The noise at which the paper's errors of LSUCZ are the largest."""


class Trial(NamedTuple):
    """One simulation with one pair of limits and one prior."""

    job: Job
    limits: tuple[int, int]
    start: float


def errors(trial: Trial) -> Matrix:
    """RMSE × 10³, (all steps or from ``SETTLED`` on, point 1 or 2)."""
    model, prior, data = simulated(trial.job, trial.start)
    engine = LSUCZ(model, prior, *trial.limits, **CENTRE)
    off = np.empty((len(data.X), 2, 3))
    for k in range(len(data.X)):
        engine.update(data.Y[k])
        off[k] = engine.point - data.X[k], engine.support.nearest_to_center() - data.X[k]
        engine.predict(data.U[k])
    return np.array([1e3 * np.sqrt(np.square(rows).mean(axis=(0, 2))) for rows in (off, off[SETTLED - 1 :])])


def table(found: Mapping[tuple[tuple[int, int], float], Matrix], paper: Sequence[float]) -> Table:
    """By limits and prior; ``paper``: its two numbers."""
    rows: list[tuple[Cell, ...]] = [
        (f"{limits[0]}, {limits[1]}", f"±{start:g}", *(float(value) for value in values.ravel()))
        for (limits, start), values in found.items()
    ]
    rows.append(("the paper", "–", float(paper[0]), float(paper[1]), "–", "–"))
    titles = [f"LSUCZ-{point}, {steps}" for steps in ("all steps", f"from step {SETTLED}") for point in (1, 2)]
    columns = (Column("generators, constraints"), Column("prior"), *(Column(title, ".4g") for title in titles))
    return Table("p2023-limits", f"RMSE × 10³ of LSUCZ at K = {MAX_K:g}: other limits and other priors", columns, rows)
