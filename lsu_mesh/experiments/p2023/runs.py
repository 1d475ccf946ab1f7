"""The filters of Kuklišová Pavelková 2023 on P3 with little state noise, over the observation noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from lsu_mesh import systems
from lsu_mesh.array_types import Matrix
from lsu_mesh.experiments.centre import CENTRE
from lsu_mesh.filters.compiled import CompiledFilter
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.lsup import LSUP
from lsu_mesh.filters.lsupb import LSUPB
from lsu_mesh.filters.run import run_filter
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import Simulation, random_uniform, simulate
from lsu_mesh.supports.orthotope import Orthotope

OMEGA = 1e-4
START = 0.1
"""Half-width of the prior box in every state, from which x_1 is drawn: the paper gives none."""
SETTLED = 10
"""The first step that counts where the prior must not show."""
GENERATORS, CONSTRAINTS = 20, 8
"""Limits of complexity of LSUCZ: the paper gives none."""
NEW_STRIP = "LSUO, new strip"
"""LSUO that takes a strip where it and the old edge leave equal volumes; LSUO keeps the old edge."""
BOXES: Mapping[str, Callable[[LSUModel, Orthotope], CompiledFilter]] = {
    "LSUO": lambda model, prior: LSUO(model, prior, meet=False, **CENTRE),
    NEW_STRIP: lambda model, prior: LSUO(model, prior, meet=False, ties="new", **CENTRE),
    "LSUP": lambda model, prior: LSUP(model, prior, time_update="image", box=False, **CENTRE),
    "LSUO, met with the prediction": lambda model, prior: LSUO(model, prior, **CENTRE),
    "LSUP, strips": lambda model, prior: LSUP(model, prior, time_update="strips", box=False, **CENTRE),
    "LSUPB": lambda model, prior: LSUPB(model, prior, **CENTRE),
}
CZ_HULL, CZ_NEAREST = "LSUCZ-1", "LSUCZ-2"


class Job(NamedTuple):
    """One simulation with ``ν = 10^−K``."""

    K: float
    seed: int
    steps: int


class Errors(NamedTuple):
    """Of one filter in one run, over all states: root mean square, mean absolute, standard deviation; in all steps.

    ``settled``: root mean square from step ``SETTLED`` on; ``early_squares``, ``early_sizes``: the share of the steps
    before it in the sum of squared errors, and of their absolute values, in per cent; ``outside``: steps whose bounds
    miss the state.
    """

    rmse: float
    mae: float
    std: float
    settled: float
    early_squares: float
    early_sizes: float
    outside: int


def errors(job: Job) -> dict[str, Errors]:
    """All filters on one simulation."""
    model, prior, data = simulated(job)
    found = _zonotopes(model, prior, data)
    for name, make in BOXES.items():
        record = run_filter(make(model, prior), data.Y, data.U)
        found[name] = _errors(record.points, record.lower, record.upper, data.X)
    return found


def _zonotopes(model: LSUModel, prior: Orthotope, data: Simulation) -> dict[str, Errors]:
    """Both points of the same sets."""
    engine = LSUCZ(model, prior, GENERATORS, CONSTRAINTS, **CENTRE)
    hulls, nearest, lower, upper = (np.empty_like(data.X) for _ in range(4))
    for k in range(len(data.X)):
        engine.update(data.Y[k])
        lower[k], upper[k] = engine.bounds()
        hulls[k] = engine.point
        nearest[k] = np.clip(engine.support.nearest_to_center(), lower[k], upper[k])
        engine.predict(data.U[k])
    return {CZ_HULL: _errors(hulls, lower, upper, data.X), CZ_NEAREST: _errors(nearest, lower, upper, data.X)}


def _errors(points: Matrix, lower: Matrix, upper: Matrix, truth: Matrix) -> Errors:
    error = points - truth
    return Errors(
        rmse=float(np.sqrt(np.square(error).mean())), mae=float(np.abs(error).mean()), std=float(error.std()),
        settled=float(np.sqrt(np.square(error[SETTLED - 1 :]).mean())),
        early_squares=_early(np.square(error)), early_sizes=_early(np.abs(error)),
        outside=int(((lower > truth) | (upper < truth)).any(axis=1).sum()),
    )  # fmt: skip


def _early(values: Matrix) -> float:
    """The share of the first steps in the sum of all, in per cent."""
    return float(100.0 * values[: SETTLED - 1].sum() / values.sum())


def simulated(job: Job, start: float = START) -> tuple[LSUModel, Orthotope, Simulation]:
    """The model, the prior box ±start, and data whose x_1 is drawn from it."""
    model = systems.get("P3", rho=OMEGA, r=10.0**-job.K)
    data = simulate(model, job.steps, job.seed, x1=start * random_uniform(job.seed, "start", 1, 3))
    return model, Orthotope([-start] * 3, [start] * 3), data
