"""What LSUCZ owes to the outputs: how often one cuts its hull, and how it does without any.

The dynamics of P3 forget the prior: the spectral radius of A is below 1 (that of |A|, by which boxes grow, is not).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lsu_mesh import systems
from lsu_mesh.experiments.centre import CENTRE
from lsu_mesh.experiments.outcome import SPREAD, Cell, Column, Spread, Table
from lsu_mesh.experiments.p2023.runs import CONSTRAINTS, GENERATORS, SETTLED, Job, simulated
from lsu_mesh.filters.lsucz import LSUCZ

CUT = 1e-9
"""Share of the hull's width by which a bound must move to count."""

LATE = 50
"""The first step that counts for the errors: by then a filter without any output has forgotten the prior as well."""


class Memory(NamedTuple):
    """Steps from ``SETTLED`` on whose output cuts the hull; RMSE × 10³ from ``LATE`` on, with and without outputs."""

    cuts: int
    with_outputs: float
    without: float


def memory(job: Job) -> Memory:
    """One simulation."""
    model, prior, data = simulated(job)
    fed, blind = (LSUCZ(model, prior, GENERATORS, CONSTRAINTS, **CENTRE) for _ in range(2))
    cuts, errors, late = 0, [], min(LATE - 1, job.steps // 2)
    for k in range(job.steps):
        before = fed.bounds()
        fed.update(data.Y[k])
        lower, upper = fed.bounds()
        if k >= SETTLED - 1:
            room = CUT * (before[1] - before[0])
            cuts += bool((lower > before[0] + room).any() or (upper < before[1] - room).any())
        if k >= late:
            errors.append((fed.point - data.X[k], blind.point - data.X[k]))
        for one in (fed, blind):
            one.predict(data.U[k])
    with_outputs, without = 1e3 * np.sqrt(np.square(errors).mean(axis=(0, 2)))
    return Memory(cuts, float(with_outputs), float(without))


def spectral_radii() -> tuple[float, float]:
    """Of A and of |A|."""
    A = systems.get("P3").A
    radius, of_sizes = (float(np.abs(np.linalg.eigvals(matrix)).max()) for matrix in (A, np.abs(A)))
    return radius, of_sizes


def table(found: Mapping[float, Sequence[Memory]], steps: int) -> Table:
    """By K."""
    columns = (
        Column("K"), Column(f"steps whose output cuts the hull, of {steps - SETTLED + 1}{SPREAD}"),
        Column(f"RMSE × 10³{SPREAD}", ".4g"), Column(f"RMSE × 10³ without any output{SPREAD}", ".4g"),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    for K, runs in found.items():
        rows.append((f"{K:g}", *(Spread.of([one[i] for one in runs]) for i in range(len(Memory._fields)))))
    title = (
        f"What LSUCZ-1 owes to the outputs: cuts from step {SETTLED} on, errors from step {LATE} on; the spectral "
        f"radius of A is {spectral_radii()[0]:.2f}, that of abs(A) {spectral_radii()[1]:.2f}"
    )
    return Table("p2023-memory", title, columns, rows)
