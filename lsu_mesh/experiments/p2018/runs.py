"""The estimators of Pavelková & Jirsa 2018 on the system P3, and what Table 1 says of each run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from lsu_mesh import systems
from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.experiments.centre import CENTRE
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.lsupb import LSUPB
from lsu_mesh.filters.run import run_filter
from lsu_mesh.filters.window.window_map import WindowMAP
from lsu_mesh.filters.zonotopic_kalman import ZonotopicKalman
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import Simulation, random_uniform, simulate
from lsu_mesh.supports.orthotope import Orthotope

Make = Callable[[LSUModel, Orthotope], Filter]

STEPS = 100
START = 0.7
"""Half-width of the prior box in every state, from which x_1 is drawn: the paper gives none."""
WINDOW, KAPPA = 5, 3.0
"""Length of the window and κ of its intervals: the paper gives none. These have intervals as wide as its."""
STATE = 1
"""Index of the state of Table 1."""


OLD_EDGE, NEW_STRIP = "LSUO", "LSUO, new strip"
"""The paper's filter, by what it does with a strip that leaves two parallelotopes of equal volume: not in the paper."""
ON_THE_DATA = 1e-12
"""Up to this an output's residual is 0 but for rounding."""


class Estimator(NamedTuple):
    """An estimator, the column of Table 1 that it stands for (or none), and whether ŷ there is that of the filter."""

    make: Make
    column: str = ""
    filtered_output: bool = False
    """Table 1 compares C x̂ after the data for LSU, the one-step prediction of y for the others."""
    is_guaranteed: bool = True


ESTIMATORS: Mapping[str, Estimator] = {
    OLD_EDGE: Estimator(lambda model, prior: LSUO(model, prior, meet=False, **CENTRE), "LSU", filtered_output=True),
    NEW_STRIP: Estimator(
        lambda model, prior: LSUO(model, prior, meet=False, ties="new", **CENTRE), "LSU", filtered_output=True
    ),
    "WindowMAP, vertex": Estimator(
        lambda model, prior: WindowMAP(model, prior, window=WINDOW, kappa=KAPPA, point="vertex"),
        "WIN",
        is_guaranteed=False,
    ),
    "ZKF q=15, predictor": Estimator(
        lambda model, prior: ZonotopicKalman(
            model, prior, order=15, form="predictor", box=False, scaled=False, point="centre"
        ),
        "ZKF q=15",
    ),
    "ZKF q=3, predictor": Estimator(
        lambda model, prior: ZonotopicKalman(
            model, prior, order=3, form="predictor", box=False, scaled=False, point="centre"
        ),
        "ZKF q=3",
    ),
    "ZKF q=15, filter": Estimator(
        lambda model, prior: ZonotopicKalman(model, prior, order=15, box=False, scaled=False, point="centre")
    ),
    "ZKF q=3, filter": Estimator(
        lambda model, prior: ZonotopicKalman(model, prior, order=3, box=False, scaled=False, point="centre")
    ),
    "WindowMAP, centre": Estimator(
        lambda model, prior: WindowMAP(model, prior, window=25, kappa=KAPPA), is_guaranteed=False
    ),
    "LSUO, met with the prediction": Estimator(lambda model, prior: LSUO(model, prior, **CENTRE), filtered_output=True),
    "LSUPB": Estimator(lambda model, prior: LSUPB(model, prior, **CENTRE), filtered_output=True),
    "LSUCZ": Estimator(lambda model, prior: LSUCZ(model, prior, **CENTRE), filtered_output=True),
}
STATISTICS = (
    "Σ (x̂₂ − x₂)²", "median (x̂₂ − x₂)", "std (x̂₂ − x₂)", "median (ŷ₁ − y₁)", "std (ŷ₁ − y₁)", "median (ŷ₂ − y₂)",
    "std (ŷ₂ − y₂)", "median half-width of x₂", "std half-width of x₂", "x₂ outside, %",
)  # fmt: skip
"""The rows of Table 1, but for the execution time."""


class Job(NamedTuple):
    """One run of one estimator."""

    name: str
    seed: int
    steps: int = STEPS


class Result(NamedTuple):
    """The rows of Table 1 for one run, the seconds of processor time that it took, and what explains them.

    ``rmse``: root mean square error of all states; ``on_the_data`` (2,): steps in which an output's residual is 0, %.
    """

    statistics: tuple[float, ...]
    seconds: float
    rmse: float
    on_the_data: tuple[float, float]


def data_of(seed: int, steps: int, rho: float | None = None, r: float | None = None) -> tuple[LSUModel, Simulation]:
    """P3 and its simulation."""
    model = systems.get("P3", rho=rho, r=r)
    x1 = START * random_uniform(seed, "start", 1, model.state_count)
    return model, simulate(model, steps, seed, x1=x1)


def prior(model: LSUModel) -> Orthotope:
    """The box that x_1 is drawn from."""
    return Orthotope([-START] * model.state_count, [START] * model.state_count)


def result(job: Job) -> Result:
    """Run an estimator over one simulation."""
    estimator = ESTIMATORS[job.name]
    model, data = data_of(job.seed, job.steps)
    run_filter(estimator.make(model, prior(model)), data.Y[:2], data.U[:2], volumes=False)  # loads the kernels
    engine = estimator.make(model, prior(model))
    began = time.process_time()
    record = run_filter(engine, data.Y, data.U, volumes=False)
    seconds = time.process_time() - began
    outputs = record.points @ model.C.T if estimator.filtered_output else record.y_points
    first, second = 100.0 * (np.abs(outputs - data.Y) < ON_THE_DATA).mean(axis=0)
    return Result(
        statistics=statistics(record.points, record.lower, record.upper, outputs=outputs, data=data),
        seconds=seconds,
        rmse=float(np.sqrt(np.square(record.points - data.X).mean())),
        on_the_data=(float(first), float(second)),
    )


def statistics(points: Matrix, lower: Matrix, upper: Matrix, outputs: Matrix, data: Simulation) -> tuple[float, ...]:
    """The rows of Table 1; points, bounds (T, n), outputs (T, m)."""
    error = points[:, STATE] - data.X[:, STATE]
    residual = outputs - data.Y
    half_width = 0.5 * (upper[:, STATE] - lower[:, STATE])
    outside = (lower[:, STATE] > data.X[:, STATE]) | (upper[:, STATE] < data.X[:, STATE])
    return (
        float(np.square(error).sum()), *_median_and_std(error), *_median_and_std(residual[:, 0]),
        *_median_and_std(residual[:, 1]), *_median_and_std(half_width), 100.0 * float(outside.mean()),
    )  # fmt: skip


def _median_and_std(values: Vector) -> tuple[float, float]:
    return float(np.median(values)), float(values.std(ddof=1))
