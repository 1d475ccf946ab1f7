"""Three filters with one sensor each, their fusion, and the filter that has all sensors, on P3.

Each filter sees one row of C = [1 0 .5; 0 1 .5; 1 −1 .3]. Their posteriors of a step are intersected. With feedback
every filter keeps its own set, conditioned on the fused *box*: in the same step (after which no filter knows less than
the fusion's bounds), or, as filters of a mesh do without waiting, carried forward to the prediction of the next step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from lsu_mesh import systems
from lsu_mesh.array_types import Vector
from lsu_mesh.experiments.centre import CENTRE
from lsu_mesh.experiments.outcome import Check, Column, Outcome, Table, percent
from lsu_mesh.experiments.workers import Watch, spread, unwatched
from lsu_mesh.filters.filter import Filter
from lsu_mesh.filters.lsucz import LSUCZ
from lsu_mesh.filters.lsuo import LSUO
from lsu_mesh.filters.lsup import LSUP
from lsu_mesh.filters.lsupb import LSUPB
from lsu_mesh.fusion.fuse import fuse
from lsu_mesh.fusion.intersection import Fusion
from lsu_mesh.metrics import rmse
from lsu_mesh.model import LSUModel
from lsu_mesh.simulation import simulate
from lsu_mesh.supports.orthotope import Orthotope

Make = Callable[[LSUModel, Orthotope], Filter]

C = ((1.0, 0.0, 0.5), (0.0, 1.0, 0.5), (1.0, -1.0, 0.3))
PRIOR = Orthotope([-5.0] * 3, [5.0] * 3)
X1 = (1.0, 0.5, -0.5)
KINDS: Mapping[str, Make] = {
    "LSUO": lambda model, prior: LSUO(model, prior, **CENTRE),
    "LSUP image": lambda model, prior: LSUP(model, prior, **CENTRE),
    "LSUPB": lambda model, prior: LSUPB(model, prior, **CENTRE),
    "LSUCZ": lambda model, prior: LSUCZ(model, prior, **CENTRE),
}
FEEDBACKS = ("none", "next step", "same step")
WARM_UP = 10
"""Steps that are not counted, but for containment."""
TITLE = "Fusion of three filters on P3 and Bayesian transfer, experiments of this library"
NOTES = (
    "P3 with one filter per sensor: each alone, their fusion with and without feedback, and the filter of the same "
    "class that has all sensors (*central*). Below it, transfer of a source's prediction to a target over the noise of "
    "the source, after Kuklišová Pavelková, Jirsa, Quinn (2022). LSUP keeps the parallelotope of least volume. A "
    "transfer shrinks its volume, and may widen its hull; LSUPB keeps both small."
)
VOLUME_EVERY = 5
"""The volume of the fused support, an exact polytope, is measured at every fifth step."""


@dataclass
class Tally:
    """What one kind of filter does with one kind of feedback, over all steps and seeds."""

    local: list[list[float]] = field(default_factory=list)
    """Hull volumes of the three filters at the end of the step."""
    fused: list[float] = field(default_factory=list)
    """Hull volume of the fused set."""
    central: list[float] = field(default_factory=list)
    """Hull volume of the filter with all sensors."""
    ratios: list[float] = field(default_factory=list)
    """Volume of the fused support ÷ that of the smallest local one."""
    held: list[bool] = field(default_factory=list)
    """Whether fused support, fused bounds, all local bounds and supports hold the truth."""
    errors: dict[str, list[Vector]] = field(default_factory=lambda: {"local": [], "fused": [], "central": []})
    """Errors (n,) of the points: of the local filter with the smallest hull, of the fusion, of the central filter."""


def run(quick: bool = False, seed: int = 1, watch: Watch = unwatched) -> Outcome:
    """The comparison for four kinds of filters and three kinds of feedback."""
    seeds = range(seed, seed + (2 if quick else 10))
    steps = 40 if quick else 100
    ways = [(kind, way) for kind in KINDS for way in FEEDBACKS]
    counts = spread(partial(_tally_of, seeds=seeds, steps=steps), ways, watch)
    tallies = dict(zip(ways, counts, strict=True))
    return Outcome(
        tables=[_table(tallies, len(seeds), steps)], checks=_checks(tallies), figures={}, title=TITLE, notes=NOTES
    )


def _tally_of(way: tuple[str, str], seeds: range, steps: int) -> Tally:
    return tally(*way, seeds, steps)


def tally(kind: str, feedback: str, seeds: range, steps: int) -> Tally:
    """Run the three filters, the fusion and the central filter over simulated data."""
    counts = Tally()
    base = systems.get("P3").replace(C=C, r=0.3)
    for seed in seeds:
        made = simulate(base, steps, seed, x1=X1)
        filters = [KINDS[kind](base.replace(C=C[i : i + 1], r=0.3), PRIOR) for i in range(len(C))]
        central = KINDS[kind](base, PRIOR)
        carried: Orthotope | None = None
        for k in range(steps):
            for i, local in enumerate(filters):
                if carried is not None:
                    local.condition(carried, gain=None)
                local.update(made.Y[k, i : i + 1])
            central.update(made.Y[k])
            together = fuse_filters(filters)
            if feedback == "same step":
                for local in filters:
                    local.condition(Orthotope(*together.bounds), gain=None)
            _count(counts, k, made.X[k], filters=filters, together=together, central=central)
            if feedback == "next step":
                carried = _carried(base, together, made.U[k])
            for estimator in (*filters, central):
                estimator.predict(made.U[k])
    return counts


def fuse_filters(filters: list[Filter]) -> Fusion:
    """The intersection of the filters' supports; its bounds are met with those of every filter."""
    together = fuse([local.support for local in filters])
    lower = np.max([together.bounds[0], *(local.bounds()[0] for local in filters)], axis=0)
    upper = np.min([together.bounds[1], *(local.bounds()[1] for local in filters)], axis=0)
    return together._replace(bounds=(lower, upper), point=0.5 * lower + 0.5 * upper)


def _carried(model: LSUModel, together: Fusion, u: Vector) -> Orthotope:
    """The fused box one step later."""
    box = LSUO(model, Orthotope(*together.bounds))
    box.predict(u)
    return Orthotope(*box.bounds())


def _count(counts: Tally, k: int, x: Vector, filters: list[Filter], together: Fusion, central: Filter) -> None:
    boxes = [together.bounds, central.bounds(), *(local.bounds() for local in filters)]
    supports = [together.support, central.support, *(local.support for local in filters)]
    counts.held.append(
        all((low <= x).all() and (x <= high).all() for low, high in boxes) and all(s.contains(x) for s in supports)
    )
    if k < WARM_UP:
        return
    fused, center, *local = [float(np.prod(high - low)) for low, high in boxes]
    counts.local.append(local)
    counts.fused.append(fused)
    counts.central.append(center)
    best = filters[int(np.argmin(local))]
    for who, point in (("local", best.point), ("fused", together.point), ("central", central.point)):
        counts.errors[who].append(point - x)
    if k % VOLUME_EVERY == 0:
        counts.ratios.append(together.support.volume() / min(estimator.volume() for estimator in filters))


def _rmse(errors: list[Vector]) -> float:
    return rmse(errors, np.zeros_like(errors))


def _table(tallies: Mapping[tuple[str, str], Tally], seeds: int, steps: int) -> Table:
    columns = [
        Column("filters"), Column("feedback"), Column("best local"), Column("worst local"), Column("fused"),
        Column("central"), Column("fused ÷ best local"), Column("RMSE best local", ".4f"), Column("RMSE fused", ".4f"),
        Column("RMSE central", ".4f"), Column("truth inside, %", ".4g"),
    ]  # fmt: skip
    rows = []
    for (kind, way), counts in tallies.items():
        local = np.mean(counts.local, axis=0)
        rows.append(
            (
                kind, way, float(local.min()), float(local.max()), float(np.mean(counts.fused)),
                float(np.mean(counts.central)), float(np.mean(counts.ratios)), _rmse(counts.errors["local"]),
                _rmse(counts.errors["fused"]), _rmse(counts.errors["central"]), percent(float(np.mean(counts.held))),
            )
        )  # fmt: skip
    title = (
        f"P3, one filter per sensor, rho = 0.1, r = 0.3, {seeds} seeds × {steps} steps: mean volume of interval hulls; "
        "fused ÷ best local compares volumes of supports"
    )
    return Table("fusion", title, tuple(columns), rows)


def _checks(tallies: Mapping[tuple[str, str], Tally]) -> list[Check]:
    every = [held for counts in tallies.values() for held in counts.held]
    ratio = float(np.mean(tallies["LSUP image", "none"].ratios))
    worst = float(np.mean(tallies["LSUCZ", "same step"].local, axis=0).max())
    return [
        Check("fusion: share of steps with the truth inside every set", float(np.mean(every)), 1.0, "at least"),
        Check("fusion: LSUP image, volume of the fused support ÷ best local", ratio, 0.5),
        Check("fusion: LSUCZ with the fused box fed back, hull volume of the worst local filter", worst, 0.09),
    ]
