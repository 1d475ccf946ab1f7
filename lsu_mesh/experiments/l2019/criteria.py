"""The criteria of Lainová et al. 2019 for one row of the grid of noises: 10 output noises r at one state noise rho.

T: total norm-squared error, V: volume, L: length of the interval of the predicted output, P: shares in per cent. The
filters of the report are LSUO (the box after the strip updates is not met with the prediction) and LSUP (image).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lsu_mesh import systems
from lsu_mesh.array_types import Matrix, Vector
from lsu_mesh.experiments.centre import CENTRE
from lsu_mesh.experiments.monte_carlo import Draws, draw, simulate_all
from lsu_mesh.filters.bank import FilterBank
from lsu_mesh.filters.compiled import CompiledFilter
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.lsup import LSUP
from lsu_mesh.filters.lsupb import LSUPB
from lsu_mesh.filters.run import run_filter
from lsu_mesh.filters.run_record import FilterRun
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import Simulation
from lsu_mesh.supports.orthotope import Orthotope

PerRun = Vector
"""One number per output noise and run, (levels, runs)."""

START = 2.0
"""Half-width of the prior box in every state, from which x_1 is drawn: the report gives none."""
TRANSIENT = 50
"""Steps that do not count for volumes and lengths, which else show the prior."""
KINDS: Mapping[str, tuple[type[CompiledFilter], Mapping[str, object]]] = {
    "LSUO": (LSUO, {"meet": False, **CENTRE}),
    "LSUP": (LSUP, {"time_update": "image", "box": False, **CENTRE}),
    "LSUO, met with the prediction": (LSUO, {**CENTRE}),
    "LSUP, strips": (LSUP, {"time_update": "strips", "box": False, **CENTRE}),
    "LSUPB": (LSUPB, {**CENTRE}),
}
"""The report's two, then ours."""
OF_A_FILTER = ("T states", "T outputs", "V", "L", "P states outside", "P outputs outside")
MEASURED, LAST_LENGTH = "T measured", "L, last tenth"
"""Error of C x̂ as an estimate of C x, which for S2 is the position; L over the last tenth of the steps."""
OF_THE_PAIR = ("P5", "P6", "P7", "P8", "P10")
SETTLED = "T outputs, settled"
WITHOUT_INPUT = "T outputs, settled, B u left out"
CZ = "LSUCZ"


class Job(NamedTuple):
    """One row of the grid."""

    system: str
    rho: float
    levels: tuple[float, ...]
    runs: int
    steps: int
    seed: int
    start: float = START

    def models(self) -> list[LSUModel]:
        """One model per output noise."""
        return [systems.get(self.system, rho=self.rho, r=r) for r in self.levels]

    def draws(self) -> Draws:
        """The noise of all runs, the same for every row."""
        return draw(systems.get(self.system), self.steps, self.seed, self.runs)


def criteria(job: Job) -> dict[tuple[str, str], PerRun]:
    """By filter and criterion; those of the pair stand under the filter ``""``."""
    models = job.models()
    data = simulate_all(models, job.draws(), job.start)
    shape = (len(models), job.runs)
    found: dict[tuple[str, str], PerRun] = {}
    kept: dict[str, FilterRun] = {}
    for name, (kind, options) in KINDS.items():
        record = run_bank(kind, options, models, runs=job.runs, data=data)
        for criterion, values in of_a_filter(record, data, models[0].C).items():
            found[name, criterion] = values.reshape(shape)
        if name in ("LSUO", "LSUP"):
            kept[name] = record
    for criterion, values in of_the_pair(kept["LSUO"], kept["LSUP"]).items():
        found["", criterion] = values.reshape(shape)
    for name, criterion, with_input in (("LSUO", SETTLED, True), ("LSUP", WITHOUT_INPUT, False)):
        found[name, criterion] = settled(kept[name], data, models[0], with_input=with_input).reshape(shape)
    return found


def with_zonotopes(job: Job) -> dict[tuple[str, str], PerRun]:
    """The criteria of single filters, those of LSUCZ as well, over few and short runs."""
    models = job.models()
    data = simulate_all(models, job.draws(), job.start)
    shape = (len(models), job.runs)
    records = {name: run_bank(*KINDS[name], models, job.runs, data) for name in KINDS}
    records[CZ] = _one_by_one(models, job.runs, data)
    return {
        (name, criterion): values.reshape(shape)
        for name, record in records.items()
        for criterion, values in of_a_filter(record, data, models[0].C).items()
    }


def run_bank(
    kind: type[CompiledFilter],
    options: Mapping[str, object],
    models: Sequence[LSUModel],
    runs: int,
    data: Simulation,
    start: float = START,
) -> FilterRun:
    """All runs of all models through one bank, from the prior box."""
    every = [model for model in models for _ in range(runs)]
    priors = [prior(models[0], start)] * len(every)
    record, done = FilterBank(kind, every, priors, threads=1, **options).run(data.Y, data.U)
    if (done < data.Y.shape[1]).any():
        raise AssertionError(f"{kind.__name__}: data that fulfil the bounds contradict the set")
    return record


def prior(model: LSUModel, start: float = START) -> Orthotope:
    """The box that x_1 is drawn from."""
    return Orthotope([-start] * model.state_count, [start] * model.state_count)


def of_a_filter(record: FilterRun, data: Simulation, C: Matrix) -> dict[str, PerRun]:
    """One number per instance, (N,)."""
    late = _late(data)
    outside_x = ((record.lower > data.X) | (record.upper < data.X)).any(axis=2)
    outside_y = ((record.y_lower > data.Y) | (record.y_upper < data.Y)).any(axis=2)
    values = (
        np.square(record.points - data.X).sum(axis=(1, 2)),
        np.square(record.y_points - data.Y).sum(axis=(1, 2)),
        record.volumes[:, late].mean(axis=1),
        (record.y_upper - record.y_lower)[:, late].mean(axis=(1, 2)),
        100.0 * outside_x.mean(axis=1),
        100.0 * outside_y.mean(axis=1),
        np.square((record.points - data.X) @ C.T).sum(axis=(1, 2)),
        (record.y_upper - record.y_lower)[:, -(data.X.shape[1] // 10) :].mean(axis=(1, 2)),
    )
    return dict(zip((*OF_A_FILTER, MEASURED, LAST_LENGTH), values, strict=True))


def of_the_pair(box: FilterRun, body: FilterRun) -> dict[str, PerRun]:
    """P5–P8 and P10. A parallelotope lies in a box exactly if its interval hull does."""
    overlap = np.minimum(box.y_upper, body.y_upper) - np.maximum(box.y_lower, body.y_lower)
    length, other = body.y_upper - body.y_lower, box.y_upper - box.y_lower
    inside = (body.lower >= box.lower) & (body.upper <= box.upper)
    inside_y = (body.y_lower >= box.y_lower) & (body.y_upper <= box.y_upper)
    values = (
        (body.volumes < box.volumes).mean(axis=1),
        (length < other).mean(axis=(1, 2)),
        inside.all(axis=2).mean(axis=1),
        inside_y.mean(axis=(1, 2)),
        (np.maximum(overlap, 0.0) / length).mean(axis=(1, 2)),
    )
    return {name: 100.0 * value for name, value in zip(OF_THE_PAIR, values, strict=True)}


def settled(record: FilterRun, data: Simulation, model: LSUModel, *, with_input: bool) -> PerRun:
    """T of the outputs after the first steps; without input: if the predictor of the output forgot ``C B u``.

    The latter is what the report's T4 looks like.
    """
    points = record.y_points.copy()
    if not with_input and model.B is not None:
        points[:, 1:] -= np.einsum("ij,jk,ntk->nti", model.C, model.B, data.U[:, :-1])
    late = _late(data)
    return np.asarray(np.square(points - data.Y)[:, late].sum(axis=(1, 2)))


def _late(data: Simulation) -> slice:
    return slice(min(TRANSIENT, data.X.shape[1] // 2), None)


def _one_by_one(models: Sequence[LSUModel], runs: int, data: Simulation) -> FilterRun:
    """LSUCZ has no bank."""
    records = [
        run_filter(LSUCZ(model, prior(model), **CENTRE), data.Y[i * runs + run], data.U[i * runs + run])
        for i, model in enumerate(models)
        for run in range(runs)
    ]
    return FilterRun(*(np.array(column) for column in zip(*records, strict=True)))
