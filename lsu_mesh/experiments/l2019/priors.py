"""How much ``T3 ÷ T4`` and ``L1 ÷ L2`` of S2 depend on the prior, which the report does not give."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from lsu_mesh.array_types import Matrix
from lsu_mesh.experiments.comparison import UNEXPLAINED, Row, ours, stated
from lsu_mesh.experiments.l2019.criteria import KINDS, Job, of_a_filter, run_bank
from lsu_mesh.experiments.monte_carlo import simulate_all
from lsu_mesh.experiments.workers import Watch, spread, unwatched

PRIORS = (0.5, 2.0, 10.0)
"""Half-widths of the box that x_1 is drawn from."""
ABOUT = (50.0, 200.0)
"""What counts as *about 100*."""


def ratios(job: Job) -> Matrix:
    """``T3 ÷ T4`` and ``L1 ÷ L2`` at one rho, (2, levels)."""
    models = job.models()
    data = simulate_all(models, job.draws(), job.start)
    found = []
    for name in ("LSUO", "LSUP"):
        record = run_bank(*KINDS[name], models, job.runs, data, job.start)
        criteria = of_a_filter(record, data, models[0].C)
        found.append([criteria[what].reshape(len(models), -1).mean(axis=1) for what in ("T outputs", "L")])
    box, body = np.array(found)
    return np.asarray(box / body)


def by_prior(levels: Sequence[float], job: Job, watch: Watch = unwatched) -> dict[float, Matrix]:
    """By prior the two ratios over the grid, (2, cells); ``job`` has everything but the noises and the prior."""
    jobs = [job._replace(rho=rho, levels=tuple(levels), start=start) for start in PRIORS for rho in levels]
    found = spread(ratios, jobs, watch)
    size = len(levels)
    return {start: np.hstack(found[i * size : (i + 1) * size]) for i, start in enumerate(PRIORS)}


def rows(found: Mapping[float, Matrix]) -> Iterator[Row]:
    """Whether ``T3 ÷ T4`` is about 100, and both ratios for each prior."""
    outputs = {start: values[0] for start, values in found.items()}
    holds = [ABOUT[0] <= cells.mean() <= ABOUT[1] for cells in outputs.values()]
    is_open = len(set(holds)) > 1
    yield stated(
        ("S2", "T3 ÷ T4, all priors"), "about 100", f"with {sum(holds)} of {len(holds)} priors",
        holds=None if is_open else holds[0],
        why="it depends on the prior, which the report does not give; see the next rows" if is_open else UNEXPLAINED,
    )  # fmt: skip
    for what, label in enumerate(("T3 ÷ T4", "L1 ÷ L2")):
        for start, values in found.items():
            cells = values[what]
            span = f"{cells.min():.3g} to {cells.max():.3g}, mean {cells.mean():.3g}"
            yield ours(("S2", f"{label}, prior ±{start:g}"), span)
